"""Fits to signals of arrays: calibration, arrivals, sharpness."""
