"""Sums of echoes into the bins of a record."""
