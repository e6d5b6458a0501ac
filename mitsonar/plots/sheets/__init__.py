"""Sheets of fits, plans and beam patterns."""
