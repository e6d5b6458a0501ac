"""What in the scene made a record: fits, with what they can and cannot see.

`fit` fits any `ForwardModel`; the other verbs are problems that are ready to solve. Names are imported when first used.
"""
import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .answer import Fit, FittedParameter
    from .calibration import Calibration, calibrated
    from .classes import Classes
    from .first_order import LBFGS, Adam
    from .fitting import fit
    from .gauss_newton import GaussNewton
    from .heights import HeightPrior, fit_heights
    from .iteration import Stopping
    from .likelihood import Gamma, Gaussian
    from .pose import PosePrior, fit_pose
    from .priors import Prior
    from .profile import fit_lines, fit_profile
    from .scene_fit import KeyPrior, fit_scene
    from .sediment_map import StrengthPrior, fit_sediment_map
    from .sharpness import Sway, sharpened

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
