"""Echoes from one source of rays at all elements of an array: their delays, spreading, patterns and Doppler factors."""
