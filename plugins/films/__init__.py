"""The record: time bins."""
