"""Soundings of a line, by whatever sonar measures them."""
