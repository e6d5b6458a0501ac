"""Fits of sound-speed profiles to lines of soundings."""
