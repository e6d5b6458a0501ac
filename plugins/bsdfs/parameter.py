"""Hold a parameter of a law: one number, a number for each class of a map, or a texture."""
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload


class Parameter:
    """Return a parameter at surface interactions, from a value, values (C,) of C classes, or a texture."""
    def __init__(self, value: float | np.ndarray | mi.Texture, low: float = -np.inf, high: float = np.inf,
                 least: float = -np.inf) -> None:
        self.textured = isinstance(value, mi.Texture)
        self.low, self.high, self.least = low, high, least
        numbers = np.zeros(1) if isinstance(value, mi.Texture) else np.asarray(value, np.float32)
        self.classes = numbers.size
        self.value: Any = value if self.textured else upload(mi.Float, numbers)
        self.keep()

    def check(self, name: str) -> None:
        """Refuse changed numbers that are not finite or out of bounds."""
        if self.textured:
            return
        numbers = dr.detach(self.value).numpy()
        if len(numbers) != self.classes or not np.isfinite(numbers).all():
            raise ValueError(f"{name} is {numbers.tolist()}; give as many finite numbers as before, {self.classes}.")
        slack = 1e-6 * abs(numbers)                                    # rounding of float32
        if np.any(numbers + slack < self.least) or np.any(numbers - slack > self.high):
            raise ValueError(f"{name} is {numbers.tolist()}; give numbers from {self.least:g} to {self.high:g}.")

    def keep(self) -> None:
        """Keep the numbers variables of kernels, not literals."""
        if not self.textured:
            dr.make_opaque(self.value)

    def traverse(self, name: str, callback: mi.TraversalCallback, *, followed: bool = True) -> None:
        """Show the value to `mi.traverse`; `followed` is True if derivatives follow everything made of the value."""
        callback.put(name, self.value, mi.ParamFlags.Differentiable if followed else mi.ParamFlags.NonDifferentiable)

    def at(self, si: mi.SurfaceInteraction3f, number: mi.UInt32, active: mi.Bool | bool) -> mi.Float:
        """Return the value at interactions of the class `number`, Float (R,)."""
        if self.textured:
            return dr.clip(self.value.eval_1(si, active), self.low, self.high)
        return self.of_class(number, active)

    def of_class(self, number: mi.UInt32, active: mi.Bool | bool) -> mi.Float:
        """Return the value of classes, for a parameter without a texture."""
        if self.classes == 1:
            return self.value
        return dr.gather(mi.Float, self.value, number, active)
