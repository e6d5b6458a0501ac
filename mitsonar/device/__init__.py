"""What numbers are computed on: libLLVM, arrays on the device, tables that no number leads astray, chance."""
