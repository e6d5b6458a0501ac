"""Models of a few lines whose gradients are right, or wrong in a way that is known."""
from __future__ import annotations

import zlib

import numpy as np

NUMBERS = 60


class Fake:
    """y_i = (2 + sin(i/9)) (1 + depth·e^(-i/30) + Σ_k bed_k hat_k(i) + squares), a record that is loud near by.

    Parameters
    ----------
    spoil : function of the Jacobian (N, parameters) and of the key, giving another
    beside : function of the parameters, what the record has besides and no gradient knows
    """

    shape = (3, NUMBERS // 3)
    units = {"depth": "m", "bed": "m", "unheard": "1", "gain": "dB"}

    def __init__(self, spoil=lambda jacobian, key: jacobian, beside=lambda values: 0.0):
        self.start = {"depth": np.array(0.3), "bed": np.linspace(-0.1, 0.2, 12), "unheard": np.array(1.0),
                      "gain": np.array([0.5, -1.0])}
        self._spoil, self._beside = spoil, beside
        i = np.arange(NUMBERS)
        self._shown = (2 + np.sin(i / 9)) * np.exp(-i / 20)
        self._decay = np.exp(-i / 30)
        self._hats = np.maximum(0, 1 - np.abs(i[:, None] / NUMBERS * 11 - np.arange(12)))
        self._halves = np.stack([i < NUMBERS // 2, i >= NUMBERS // 2], 1) * np.log(10) / 10

    def _parts(self, values):
        at = {**self.start, **values}
        heights = self._hats @ at["bed"]
        return at, heights, np.exp(self._halves @ at["gain"]) * self._shown

    def value(self, values):
        at, heights, gain = self._parts(values)
        return gain * (1 + at["depth"] * self._decay + heights + heights ** 2) + self._beside(at)

    def linearised(self, values):
        at, heights, gain = self._parts(values)
        inner = 1 + at["depth"] * self._decay + heights + heights ** 2
        jacobians = {"depth": (gain * self._decay)[:, None],
                     "bed": (gain * (1 + 2 * heights))[:, None] * self._hats,
                     "unheard": np.zeros((NUMBERS, 1)),
                     "gain": (gain * inner)[:, None] * self._halves}
        return FakeLinearised(self.value(values), {key: self._spoil(jacobian, key)
                                                   for key, jacobian in jacobians.items()}, self.start)


class FakeLinearised:
    """The same about a point; `also` is added to backward gradients alone."""

    also = 0.0

    def __init__(self, value, jacobians, start):
        self.value, self._jacobians, self._start = value, jacobians, start
        self.told = {"bins in shadow": 0.25}

    def forward(self, tangents):
        return sum(self._jacobians[key] @ np.ravel(tangent) for key, tangent in tangents.items())

    def backward(self, cotangent):
        return {key: (jacobian.T @ cotangent).reshape(self._start[key].shape) + self.also
                for key, jacobian in self._jacobians.items()}


def of_key(wanted, change):
    """What spoils the Jacobian of one key."""
    return lambda jacobian, key: change(jacobian) if key == wanted else jacobian


def shaken(size, key="depth"):
    """What no step smooths: chance that is drawn anew for each value of a parameter."""
    def beside(values):
        return size * np.random.default_rng(zlib.crc32(values[key].tobytes())).standard_normal(NUMBERS)
    return beside
