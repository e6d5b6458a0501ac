"""Errors of planned soundings: by a wrong cast, and by all sensors."""
