"""Synthetic aperture: from the echoes that a moving array records to focused images.

    record        what a strip of raw echoes holds, and what a focused image holds: `xarray.Dataset`s
"""
