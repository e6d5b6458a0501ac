"""A parameter of a law at a place: one number, a number for each class of a map, or a texture."""
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload


class Parameter:
    """Return a parameter at surface interactions."""
    # value (C,)

    def __init__(self, value: float | np.ndarray | mi.Texture, low: float = -np.inf, high: float = np.inf,
                 least: float = -np.inf) -> None:
        self.textured = isinstance(value, mi.Texture)
        self.low, self.high, self.least = low, high, least
        numbers = np.zeros(1) if isinstance(value, mi.Texture) else np.asarray(value, np.float32)
        self.classes = numbers.size
        self.value: Any = value if self.textured else upload(mi.Float, numbers)
        self.keep()

    def check(self, name: str) -> None:
        """Refuse numbers that were changed into what cannot be."""
        if self.textured:
            return
        numbers = dr.detach(self.value).numpy()
        if len(numbers) != self.classes or not np.isfinite(numbers).all():
            raise ValueError(f"{name} is {numbers.tolist()}; give as many finite numbers as before, {self.classes}.")
        slack = 1e-6 * abs(numbers)                                    # rounding of float32
        if np.any(numbers + slack < self.least) or np.any(numbers - slack > self.high):
            raise ValueError(f"{name} is {numbers.tolist()}; give numbers from {self.least:g} to {self.high:g}.")

    def keep(self) -> None:
        """Have numbers stay variables of kernels, after they were changed too."""
        if not self.textured:
            dr.make_opaque(self.value)

    def traverse(self, name: str, callback: mi.TraversalCallback, *, followed: bool = True) -> None:
        """Show the value to `mi.traverse`; `followed`: whether derivatives know all that is made of it."""
        callback.put(name, self.value, mi.ParamFlags.Differentiable if followed else mi.ParamFlags.NonDifferentiable)

    def at(self, si: mi.SurfaceInteraction3f, number: mi.UInt32, active: mi.Bool | bool) -> mi.Float:
        """Value at interactions `si`, Float; `number`, UInt32, is that of each one's class."""
        if self.textured:
            return dr.clip(self.value.eval_1(si, active), self.low, self.high)
        return self.of_class(number, active)

    def of_class(self, number: mi.UInt32, active: mi.Bool | bool) -> mi.Float:
        """Value of classes, of a parameter that is no texture."""
        if self.classes == 1:
            return self.value
        return dr.gather(mi.Float, self.value, number, active)
