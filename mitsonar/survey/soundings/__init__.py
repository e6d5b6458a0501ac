"""Soundings of a line, for every kind of sonar that makes soundings."""
