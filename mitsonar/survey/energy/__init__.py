"""Energy records: powers of echoes summed by row and time bin."""
