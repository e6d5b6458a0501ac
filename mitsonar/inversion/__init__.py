"""What in the scene made a record: fits, with what they can and cannot see.

`fit` fits any `ForwardModel`; the other verbs are problems that are ready to solve. Names are imported when first used.
"""
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .arrays.calibration import Calibration, calibrated
    from .arrays.sharpness import Sway, sharpened
    from .fit.answer import Fit, FittedParameter
    from .fit.classes import Classes
    from .fit.first_order import LBFGS, Adam
    from .fit.fitting import fit
    from .fit.gauss_newton import GaussNewton
    from .fit.iteration import Stopping
    from .fit.likelihood import Gamma, Gaussian
    from .fit.priors import Prior
    from .images.heights import HeightPrior, fit_heights
    from .images.pose import PosePrior, fit_pose
    from .images.scene_fit import KeyPrior, fit_scene
    from .images.sediment_map import StrengthPrior, fit_sediment_map
    from .profile.profile import fit_lines, fit_profile

__all__ = ["LBFGS", "Adam", "Calibration", "Classes", "Fit", "FittedParameter", "Gamma", "Gaussian", "GaussNewton",
           "HeightPrior", "KeyPrior", "PosePrior", "Prior", "Stopping", "StrengthPrior", "Sway", "calibrated", "fit",
           "fit_heights", "fit_lines", "fit_pose", "fit_profile", "fit_scene", "fit_sediment_map", "sharpened"]

_HOMES = {
    "answer": ("Fit", "FittedParameter"), "calibration": ("Calibration", "calibrated"), "classes": ("Classes",),
    "first_order": ("LBFGS", "Adam"), "fitting": ("fit",), "gauss_newton": ("GaussNewton",),
    "heights": ("HeightPrior", "fit_heights"), "iteration": ("Stopping",), "likelihood": ("Gamma", "Gaussian"),
    "pose": ("PosePrior", "fit_pose"), "priors": ("Prior",), "profile": ("fit_profile",),
    "profile_lines": ("fit_lines",), "scene_fit": ("KeyPrior", "fit_scene"),
    "sediment_map": ("StrengthPrior", "fit_sediment_map"), "sharpness": ("Sway", "sharpened"),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str):
    if name not in _HOME:
        raise AttributeError(f"module 'mitsonar.inversion' has no attribute {name!r}; it has {', '.join(__all__)}")
    return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
