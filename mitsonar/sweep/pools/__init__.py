"""Pools of processes that render for a sweep: here, or on a Dask cluster."""
