"""Tracks and navigation in files."""
