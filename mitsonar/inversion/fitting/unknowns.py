"""All parameters of a fit as one vector z of independent numbers of deviation 1, and back."""
from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mitsonar.device.spelling import meant
from mitsonar.gradients.model import ForwardModel, Values

from .priors import Prior


class Unknowns:
    """Parameters of a model, with their priors."""
    # priors [str, Prior]

    def __init__(self, model: ForwardModel, priors: Mapping[str, Prior]):
        if not priors:
            raise ValueError(f"no parameter has a prior; give one for {', '.join(model.start)}")
        for name in priors:
            if name not in model.start:
                raise ValueError(f"{name!r} is not a parameter of the model{meant(name, model.start)}: "
                                 f"{', '.join(model.start)}")
        self.names = tuple(priors)
        self.start = {name: np.asarray(model.start[name], float) for name in self.names}
        self.bound = {name: priors[name].bound(name, self.start[name]) for name in self.names}
        ends = np.cumsum([self.start[name].size for name in self.names])
        self.parts = {name: slice(int(end) - self.start[name].size, int(end)) for name, end in zip(self.names, ends)}
        sizes = [self.bound[name].root.size for name in self.names]
        ends = np.cumsum(sizes)
        self.pieces = {name: slice(int(end) - size, int(end)) for name, end, size in zip(self.names, ends, sizes)}
        self.size = int(ends[-1])

    def values(self, z: np.ndarray) -> dict[str, np.ndarray]:
        """Return the parameters of z, in their shapes."""
        return self.shaped(np.concatenate([self.bound[name].limits.inside(free) for name, free in self._free(z)]))

    def shaped(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Return numbers (n,) as arrays by name."""
        return {name: numbers[part].reshape(self.start[name].shape) for name, part in self.parts.items()}

    def flat(self, values: Values) -> np.ndarray:
        """Return arrays by name as numbers (n,)."""
        return np.concatenate([np.ravel(values[name]) for name in self.names])

    def slope(self, z: np.ndarray) -> np.ndarray:
        """Return dx/dq (n,) about z."""
        return np.concatenate([self.bound[name].limits.slope(free) for name, free in self._free(z)])

    def mapped(self, z: np.ndarray, deviation: np.ndarray) -> np.ndarray:
        """Return deviations (n,) of x about z where those of q are (n,)."""
        return np.concatenate([self.bound[name].limits.deviation(free, deviation[self.parts[name]])
                               for name, free in self._free(z)])

    def pushed(self, slope: np.ndarray, dz: np.ndarray) -> np.ndarray:
        """Return dx (n,) of dz (n,)."""
        return slope * np.concatenate([self.bound[name].root.forward(dz[piece]) for name, piece in self.pieces.items()])

    def pulled(self, slope: np.ndarray, dx: np.ndarray) -> np.ndarray:
        """Return the transpose of `pushed`."""
        dx = slope * dx
        return np.concatenate([self.bound[name].root.transpose(dx[part]) for name, part in self.parts.items()])

    @property
    def deviation(self) -> np.ndarray:
        """The prior deviations of x, (n,)."""
        return np.concatenate([self.bound[name].deviation for name in self.names])

    def _free(self, z: np.ndarray):
        """Return the names, and q of each."""
        for name, piece in self.pieces.items():
            yield name, self.bound[name].mean + self.bound[name].root.forward(z[piece])
