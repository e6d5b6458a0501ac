"""Exact rays on the host: eigenrays and travel times in NumPy, double precision."""
