"""Fits: what in the scene made a record, with what the record can and cannot tell.

`fit` fits any `ForwardModel`; the other verbs are problems that are ready to solve.
"""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
