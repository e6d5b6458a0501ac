"""Signals of the elements of arrays: delays, spreading, patterns and Doppler factors of the echoes of every ping."""
