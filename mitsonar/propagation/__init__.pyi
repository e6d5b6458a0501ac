from .numpy_rays.eigenrays import Eigenray as Eigenray, eigenray as eigenray, eigenrays as eigenrays
from .numpy_rays.return_times import return_time as return_time, return_time_error as return_time_error
