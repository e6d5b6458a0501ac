"""Propagation: how sound gets from one point to another in refracting water."""
from .eigenrays import Eigenray, eigenray, eigenrays

__all__ = ["Eigenray", "eigenray", "eigenrays"]
