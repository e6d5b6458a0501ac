"""Focusing of raw echoes to images."""
