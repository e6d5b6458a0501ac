"""Recorded lines of soundings, changed before they are reduced again."""
