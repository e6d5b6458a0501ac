"""Scattering function of a target: the pressure f at 1 m by frequency and directions of incidence and scattering.

    f(frequency, incident, scattered)          [m],    20 log |f| the target strength

An incident pressure p at the target's origin scatters as p f e^(-ikr) / r for time e^(+iωt): a part d nearer to source
and receiver contributes e^(+2ikd). Directions are directions of travel in the target's axes.

Between the nodes of a table f is f = g e^(-i2π frequency τ), τ the delay of the echo at the nodes' angles; both are
linear between angles, and g is a cubic spline over frequency. The phase of g changes slowly, while that of f may change
by whole cycles between nodes.
"""
from __future__ import annotations

import itertools
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from .sphere_series import WATER_DENSITY, SphereBody, sphere_form

AXES = ("aspect", "incident_azimuth", "incident_elevation", "scattered_azimuth", "scattered_elevation")
TURN = 2 * np.pi
FULL_TURN = 1.001                  # largest gap, in steps, at which an azimuth axis counts as a full circle
MOST_EXAMPLES = 64


class ScatteringFunction(Protocol):
    """Interface of a target's scattering function.

    Attributes
    ----------
    covered : (float, float) [Hz]
        Valid frequencies, lowest and highest.
    """

    @property
    def covered(self) -> tuple[float, float]: ...

    def form(self, frequency: np.ndarray, incident: np.ndarray, scattered: np.ndarray,
             sound_speed: float) -> np.ndarray:
        """Return the scattering function f, complex (R, F) [m].

        Parameters
        ----------
        frequency : (F,) [Hz]
        incident, scattered : (R, 3)
            Unit directions of travel, in the target's axes.
        sound_speed : float [m/s]
            Sound speed of the water.
        """
        ...

    def examples(self) -> tuple[np.ndarray, np.ndarray]:
        """Return example directions (E, 3), incident and scattered, that include the longest echo."""
        ...

    def latest(self, sound_speed: float) -> float:
        """Return the largest delay [s], early or late, of the echo relative to that of the target's origin."""
        ...


@dataclass(frozen=True, kw_only=True)
class SphereScattering:
    """Sphere, by its exact series.

    Attributes
    ----------
    radius : float [m]
    body : SphereBody
    density : float [kg/m³]
        Density of the water.
    """

    radius: float
    body: SphereBody
    density: float = WATER_DENSITY

    @property
    def covered(self) -> tuple[float, float]:
        """Return the valid frequencies [Hz]: all, as the series checks its own upper limit."""
        return 0.0, np.inf

    def form(self, frequency: np.ndarray, incident: np.ndarray, scattered: np.ndarray,
             sound_speed: float) -> np.ndarray:
        """Return f; see `ScatteringFunction.form`."""
        angle = 2 * np.arctan2(np.linalg.norm(incident - scattered, axis=-1),
                               np.linalg.norm(incident + scattered, axis=-1))
        angle, which = np.unique(angle, return_inverse=True)      # backwards, most often
        return sphere_form(self.radius, frequency, sound_speed, body=self.body, density=self.density,
                           angle=angle[:, None])[which]

    def examples(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the backscattering direction, where the echo is longest."""
        incident = np.array([[1.0, 0.0, 0.0]])
        return incident, -incident

    def latest(self, sound_speed: float) -> float:
        """See `ScatteringFunction.latest`."""
        return 2 * self.radius / sound_speed


@dataclass(frozen=True, kw_only=True, eq=False)
class ScatteringTable:
    """Table of a target's scattering function.

    Attributes
    ----------
    frequency : (F,) [Hz]
        Increasing frequencies.
    axes : dict of str to (N,) [rad]
        Names of `AXES` and their increasing nodes, in the order of the table's dimensions. Azimuths (from x towards y)
        and elevations (up from the xy plane) point from the target to source and receiver. A table without receiver
        angles, and the ``aspect`` (angle from the x axis), use the direction half-way between the two.
    values : complex (..., F) [m]
        Scattering function f.

    Raises
    ------
    ValueError
        If shapes do not fit, nodes do not rise, an axis is unknown or a value is not finite.
    """

    frequency: np.ndarray
    values: np.ndarray
    axes: dict[str, np.ndarray] = field(default_factory=dict)

    def __post_init__(self):
        unknown = [name for name in self.axes if name not in AXES]
        if unknown:
            raise ValueError(f"a scattering function has no angle {unknown[0]}; there are {', '.join(AXES)}.")
        if "aspect" in self.axes and len(self.axes) > 1:
            raise ValueError("a scattering function has the aspect and other angles; give the aspect or the others.")
        expected = *(len(nodes) for nodes in self.axes.values()), len(self.frequency)
        if self.values.shape != expected:
            raise ValueError(f"values of a scattering function are {self.values.shape}; the axes ask for {expected}.")
        if not np.isfinite(self.values).all() or not np.any(self.values):
            raise ValueError("a scattering function has values that are not finite, or no value above 0; mend them.")
        for name, nodes in [("frequency", self.frequency), *self.axes.items()]:
            if not (len(nodes) and np.isfinite(nodes).all() and np.all(np.diff(nodes) > 0)):
                raise ValueError(f"the {name} of a scattering function does not rise from value to value.")
        if self.frequency[0] <= 0:
            raise ValueError("a scattering function has a frequency of 0 or less; give frequencies above 0.")
        late = _delays(self.frequency, self.values)
        object.__setattr__(self, "_late", late)
        object.__setattr__(self, "_still", self.values * np.exp(2j * np.pi * late[..., None] * self.frequency))

    @property
    def covered(self) -> tuple[float, float]:
        """Return the first and last frequency [Hz]."""
        return float(self.frequency[0]), float(self.frequency[-1])

    def form(self, frequency: np.ndarray, incident: np.ndarray, scattered: np.ndarray,
             sound_speed: float) -> np.ndarray:
        """Return f; see `ScatteringFunction.form`. Beyond the ends of an axis the last value is used."""
        late, still = getattr(self, "_late"), getattr(self, "_still")
        corners = [_between(nodes, self._angle(name, incident, scattered), turns="azimuth" in name)
                   for name, nodes in self.axes.items()]
        total_late, total = np.zeros(len(incident)), np.zeros((len(incident), len(self.frequency)), complex)
        for corner in itertools.product(*corners):
            weight = np.prod([share for _, share in corner], axis=0) * np.ones(len(incident))
            index = tuple(number for number, _ in corner)
            total_late += weight * late[index]
            total += weight[:, None] * still[index]
        found = total[:, :1]
        if len(self.frequency) > 1:
            from scipy.interpolate import make_interp_spline

            found = make_interp_spline(self.frequency, total, k=min(3, len(self.frequency) - 1), axis=1)(
                np.clip(frequency, *self.covered))
        return found * np.exp(-2j * np.pi * total_late[:, None] * frequency)

    def examples(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the directions of the nodes, at most MOST_EXAMPLES, evenly chosen."""
        nodes = np.stack(np.meshgrid(*self.axes.values(), indexing="ij"), -1).reshape(-1, len(self.axes))
        nodes = nodes[np.unique(np.linspace(0, len(nodes) - 1, MOST_EXAMPLES).round().astype(int))]
        at = {name: nodes[:, number] for number, name in enumerate(self.axes)}
        nothing = np.zeros(len(nodes))
        if "aspect" in at:
            source = receiver = _direction(at["aspect"], nothing)
        else:
            source = _direction(at.get("incident_azimuth", nothing), at.get("incident_elevation", nothing))
            receiver = source if not self._bistatic else _direction(
                at.get("scattered_azimuth", nothing), at.get("scattered_elevation", nothing))
        return -source, receiver

    def latest(self, sound_speed: float) -> float:
        """See `ScatteringFunction.latest`."""
        return float(np.max(np.abs(getattr(self, "_late"))))

    @property
    def _bistatic(self) -> bool:
        return any(name.startswith("scattered") for name in self.axes)

    def _angle(self, name: str, incident: np.ndarray, scattered: np.ndarray) -> np.ndarray:
        """Return the angle (R,) [rad] along an axis."""
        seen = scattered if name.startswith("scattered") else -incident
        if not self._bistatic:
            middle = scattered - incident
            length = np.linalg.norm(middle, axis=-1, keepdims=True)
            seen = np.where(length > 1e-6, middle / np.maximum(length, 1e-6), seen)
        if name == "aspect":
            return np.arccos(np.clip(seen[:, 0], -1, 1))
        if name.endswith("azimuth"):
            return np.arctan2(seen[:, 1], seen[:, 0])
        return np.arcsin(np.clip(seen[:, 2], -1, 1))


def _direction(azimuth: np.ndarray, elevation: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1)


def _delays(frequency: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the echo's delay [s] at each angle node: the slope of the phase, weighted by energy."""
    if len(frequency) < 2:
        return np.zeros(values.shape[:-1])
    step = np.diff(frequency)
    turned = values[..., 1:] * np.conj(values[..., :-1])
    # phase steps of an uneven frequency grid differ; scale them to the median step before averaging
    middle = np.isclose(step, np.median(step), rtol=1e-3)
    turned, step = turned[..., middle], step[middle]
    return -np.angle(turned.sum(-1)) / (TURN * step.mean())


def _between(nodes: np.ndarray, value: np.ndarray, *, turns: bool) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Return the nodes on either side of the values and their weights, held beyond the ends unless the axis `turns`."""
    if len(nodes) == 1:
        return ((np.zeros(len(value), int), np.ones(len(value))),)
    numbers = np.arange(len(nodes))
    if turns:
        value = nodes[0] + np.mod(value - nodes[0], TURN)
        gap = nodes[0] + TURN - nodes[-1]
        if gap <= FULL_TURN * np.max(np.diff(nodes)):
            if gap > 1e-9:             # else both ends are the same direction
                nodes, numbers = np.append(nodes, nodes[0] + TURN), np.append(numbers, 0)
        else:                          # in the gap, the nearer end
            value = np.where(value > nodes[-1] + 0.5 * gap, nodes[0], value)
    low = np.clip(np.searchsorted(nodes, value, side="right") - 1, 0, len(nodes) - 2)
    share = np.clip((value - nodes[low]) / (nodes[low + 1] - nodes[low]), 0, 1)
    return (numbers[low], 1 - share), (numbers[low + 1], share)
