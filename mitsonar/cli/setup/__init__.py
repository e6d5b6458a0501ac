"""Set-up of a machine: environment, libLLVM, the doctor."""
