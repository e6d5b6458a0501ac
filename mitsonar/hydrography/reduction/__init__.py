"""Reduction of angles and travel times to soundings, with their errors."""
