"""Rotating head: signals of its pings, and its pings as rows of an energy record."""
