"""Inverse problems: estimate the scene from its records, with the uncertainty of the answer.

`fit` fits any `ForwardModel`; the other functions solve problems that are set up already.
"""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
