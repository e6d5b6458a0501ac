"""Sights of points from a sonar: eigenrays, straight or by way of the sea surface or the bed."""
