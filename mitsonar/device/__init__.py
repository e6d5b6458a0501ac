"""Arrays on the device and their types, random numbers, libLLVM, files and texts of errors."""
