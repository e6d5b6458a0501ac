"""What in the scene made a record: fits, with what they can and cannot see."""
from .answer import Fit, FittedParameter
from .classes import Classes
from .first_order import LBFGS, Adam
from .fitting import fit
from .gauss_newton import GaussNewton
from .iteration import Stopping
from .likelihood import Gamma, Gaussian
from .priors import Prior

__all__ = ["LBFGS", "Adam", "Classes", "Fit", "FittedParameter", "Gamma", "Gaussian", "GaussNewton", "Prior",
           "Stopping", "fit"]
