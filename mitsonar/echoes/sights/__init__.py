"""Sights of points from an array: eigenrays, mirrors of a flat bed."""
