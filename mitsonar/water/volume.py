"""Volume scattering strength of the water against depth, and volume reverberation.

    s_v(z) = 10^(S_v(z)/10) + Σ_j 10^(S_j/10)  over the layers j with top_j <= z < bottom_j
    RL = SL - 20 log R - 2 α R + S_v + 10 log(ψ c τ/2)

S_v -> ``strength_db`` [dB re 1/m] at ``depth`` [m], linear in decibels between nodes and constant beyond the ends; s_v
[1/m] is the power scattered per volume and solid angle over the incident intensity, equal in all directions. The second
line is the reverberation of uniform water: SL -> ``source_level_db``,
R -> ``slant_range``, α -> ``absorption_db``, ψ -> ``beam_solid_angle``, τ -> ``pulse_length``, c -> ``sound_speed``.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.types import Real
from mitsonar.units import db_from_power, power_from_db

WEAKEST_DB, STRONGEST_DB = -200.0, 0.0

# name -> (top [m], bottom [m], strength [dB re 1/m]): round figures from the ranges of Urick (1983), Principles of
# Underwater Sound, chapter 8: -90 to -60 dB in the open sea, -70 dB in the deep scattering layer by day, up to -50 dB
# in bubbles or silt. Layers with other names need all three numbers. "bubbles" are those of wakes: the law of the sea
# surface includes bubbles from wind.
LAYERS = {"fish": (300.0, 500.0, -70.0), "plankton": (10.0, 60.0, -80.0), "bubbles": (0.0, 5.0, -50.0)}


@dataclass(frozen=True)
class Layer:
    """Layer of scatterers in addition to those of the water."""

    name: str
    top: float  # [m]: depth of the upper edge
    bottom: float  # [m]: depth of the lower edge
    strength_db: float  # [dB re 1/m]

    def __post_init__(self):
        if not -np.inf < self.top < self.bottom < np.inf:
            raise ValueError(f"layer {self.name} reaches from {self.top:g} to {self.bottom:g} m; give the depth of its "
                             "top, then a greater depth of its bottom.")
        _check_strength(f"layer {self.name}", self.strength_db)

    @classmethod
    def read(cls, text: str) -> Layer:
        """Return a layer from "name top bottom dB"; names in `LAYERS` supply missing last numbers."""
        name, *numbers = text.replace(",", " ").split() or [""]
        known = LAYERS.get(name, ())
        try:
            numbers = [float(number) for number in numbers]
        except ValueError:
            numbers = [0.0] * 4
        if len(numbers) > 3 or len(numbers) < 3 and not known:
            raise ValueError(f'the layer "{text.strip()}" is not "name top bottom dB", such as "kelp 5 12 -55"; the '
                             f"numbers of {', '.join(LAYERS)} may be left out.")
        return cls(name, *numbers, *known[len(numbers):])


class VolumeScattering:
    """Volume scattering strength of the water against depth.

    Parameters
    ----------
    depth : array (K,) [m] or None
        Increasing depths; None if only ``layers`` scatter.
    strength_db : array (K,) [dB re 1/m] or None
        S_v at these depths.
    layers : sequence of Layer
        Additional layers.

    Attributes
    ----------
    depth, strength_db, layers
        Arguments, as read-only arrays.
    edges : array (E,) [m]
        Depths at which the formula of s_v changes, increasing.
    pieces : array (E + 1, 3)
        Coefficients (a, b, c) of s_v = c + exp(a + b z) above each edge and below the last; a is -inf if the piece
        has no exponential term.

    Raises
    ------
    ValueError
        If depths do not increase, or a number is missing, not finite or out of range.
    """

    def __init__(self, depth: ArrayLike | None = None, strength_db: ArrayLike | None = None,
                 layers: Sequence[Layer] = ()):
        if (depth is None) != (strength_db is None):
            raise ValueError("volume scattering: give both depth and strength_db, or neither.")
        self.depth, self.strength_db = (_column(values) for values in (depth, strength_db))
        self.layers = tuple(layers)
        if self.depth.shape != self.strength_db.shape:
            raise ValueError(f"volume scattering: {self.depth.size} depths but {self.strength_db.size} strengths; give "
                             "one strength for each depth.")
        if not np.isfinite(self.depth).all() or np.any(np.diff(self.depth) <= 0):
            raise ValueError("volume scattering: depths must be finite and increase downwards; sort them.")
        for strength in self.strength_db:
            _check_strength("volume scattering", strength)
        if not self.depth.size and not self.layers:
            raise ValueError("volume scattering: neither strengths nor layers are given; give one of them.")
        bounds = [bound for layer in self.layers for bound in (layer.top, layer.bottom)]
        self.edges = np.unique(np.concatenate([self.depth, bounds]))
        self.pieces = self._pieces()

    def _pieces(self) -> np.ndarray:
        log_s = np.log(10) / 10 * self.strength_db
        inside = np.concatenate([self.edges[:1] - 1, 0.5 * (self.edges[1:] + self.edges[:-1]), self.edges[-1:] + 1])
        pieces = np.zeros((len(inside), 3))
        pieces[:, 0] = -np.inf
        if self.depth.size:
            slope = np.concatenate([[0.0], np.diff(log_s) / np.diff(self.depth), [0.0]])
            k = np.searchsorted(self.depth, inside)
            node = np.maximum(k - 1, 0)
            pieces[:, 1] = slope[k]
            pieces[:, 0] = log_s[node] - slope[k] * self.depth[node]
        for layer in self.layers:
            pieces[(inside > layer.top) & (inside < layer.bottom), 2] += power_from_db(layer.strength_db)
        return pieces

    def lifted(self, height: float) -> VolumeScattering:
        """Return the scattering of water whose surface lies `height` [m] above depth 0; itself if nothing changes."""
        if height == 0 or (len(self.depth) == 1 and not self.layers):
            return self
        layers = [replace(one, top=one.top - height, bottom=one.bottom - height) for one in self.layers]
        given = (self.depth - height, self.strength_db) if self.depth.size else (None, None)
        return VolumeScattering(*given, layers)

    def at(self, depth: ArrayLike) -> np.ndarray:
        """Return s_v [1/m] at ``depth`` [m], any shape."""
        a, b, c = np.moveaxis(self.pieces[np.searchsorted(self.edges, depth, side="right")], -1, 0)
        return c + np.exp(a + b * np.asarray(depth, float))

    def strength_db_at(self, depth: ArrayLike) -> np.ndarray:
        """Return S_v with all layers [dB re 1/m] at ``depth`` [m], any shape; -inf without scatterers."""
        return db_from_power(self.at(depth))


def volume_reverberation_db(source_level_db: Real, slant_range: ArrayLike, volume_strength_db: Real,
                            beam_solid_angle: ArrayLike, pulse_length: ArrayLike, absorption_db: Real = 0.0,
                            sound_speed: Real = 1500.0) -> np.ndarray:
    """Return the level of the reverberation of uniform water.

    Parameters
    ----------
    source_level_db : array [dB re 1 µPa @ 1 m]
    slant_range : array [m]
        Middle of the gate.
    volume_strength_db : array [dB re 1/m]
    beam_solid_angle : array [sr]
        ψ, the integral of the two-way intensity pattern over all directions.
    pulse_length : array [s]
    absorption_db : array [dB/m]
    sound_speed : array [m/s]
        All arguments broadcast.

    Returns
    -------
    array [dB re 1 µPa]

    Notes
    -----
    Urick (1983), Principles of Underwater Sound, chapter 8. The finite length of the gate is neglected: 0.003 dB at
    1/20 of the range.
    """
    slant_range = np.asarray(slant_range, float)
    return (source_level_db - 20 * np.log10(slant_range) - 2 * absorption_db * slant_range + volume_strength_db
            + db_from_power(np.asarray(beam_solid_angle) * sound_speed * np.asarray(pulse_length) / 2))


def _column(values: ArrayLike | None) -> np.ndarray:
    column = np.array([] if values is None else np.atleast_1d(values), float)
    column.flags.writeable = False
    return column


def _check_strength(subject: str, strength_db: float) -> None:
    if not WEAKEST_DB <= strength_db <= STRONGEST_DB:
        raise ValueError(f"{subject}: strength is {strength_db:g} dB re 1/m; it must lie in {WEAKEST_DB:g}.."
                         f"{STRONGEST_DB:g} dB, and is -90 to -50 dB in the sea.")
