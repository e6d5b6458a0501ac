"""What numbers are computed on: libLLVM, arrays on the device and their types, safe look-ups in tables, chance."""
