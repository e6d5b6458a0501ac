"""Rays through layers on the device: tables, fans, and rays between two points."""
