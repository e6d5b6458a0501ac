"""Propagation: how sound gets from one point to another in refracting water."""
from .numpy_rays.eigenrays import Eigenray, eigenray, eigenrays
from .numpy_rays.return_times import return_time, return_time_error

__all__ = ["Eigenray", "eigenray", "eigenrays", "return_time", "return_time_error"]
