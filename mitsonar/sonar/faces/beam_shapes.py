"""Beam of a face in one plane: a uniform line, or one that is shaded, curved, measured, and built with errors.

    b²(s) = (1 - f) p²(s) + f,     p(s) = ∫ w(ξ) exp(i 2π (x ξ + g (2ξ)²)) dξ / ∫ w exp(i 2π g (2ξ)²) dξ,   x = L s / λ

s is the sine of the angle to the normal, L -> the side, ξ from -1/2 to 1/2 along it. w -> ``window``, a window of
`shading`. g -> ``sag`` [wavelengths], how far the edges of a curved face stand back: the phase of an arc, to second
order; 0.5 to 1 make beams flat-topped. A uniform, flat line has p = sinc x. f -> ``floor``, the mean power of diffuse
side lobes: what errors σ of amplitude and phase [rad] from segment to segment leave of a line of N of them,
f = σ²/N of the axis (Mailloux 2005, Phased Array Antenna Handbook, ch. 7); -20 to -35 dB of faces in use. Where the
housing shields the face above (``shielded``), f is f (1 + s) of s < 0: nothing straight up, which lies behind the plane
of a face that looks down.
"""
from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from mitsonar.device.lazy import module_alone
from mitsonar.device.types import Numbers

from ..arrays.shading import window_weights

SEGMENTS = 256                     # that a line is summed of, at least; two a wavelength
STEPS_PER_LOBE, FEWEST_STEPS = 32, 512
NARROWEST = np.deg2rad(0.01)       # measured beam, of which steps of tables are a tenth
BLOCK = 1 << 21                    # phases that are summed one by one; more go by the chirp z transform
FAR, FINE = 8.0, 4001              # x within which half the power lies, and steps of the search


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamShape:
    """One face's beam in one plane, of pressure 1 on its axis."""

    table: np.ndarray | None = None  # (K,) [-]: pressures at equal steps of s from -1 to 1
    floor: float = 0.0  # mean power of diffuse side lobes, relative to the axis
    shielded: bool = False  # whether they fade to nothing towards s = -1

    def __post_init__(self):
        if not 0 <= self.floor < 1:
            raise ValueError(f"the floor of side lobes is {self.floor:g} of the axis; give a power from 0 to below 1")
        if self.table is not None and not (len(self.table) > 1 and np.isfinite(self.table).all()):
            raise ValueError("a table of pressures needs at least two values, all finite; give such a table")

    def lobes(self, s: Numbers, size: Numbers) -> Numbers:
        """Return p at sines s, of a side `size` [wavelengths]."""
        if self.table is None:
            return np.sinc(s * size)
        return np.interp(s, np.linspace(-1, 1, len(self.table)), self.table)

    def pressure(self, s: Numbers, size: Numbers) -> Numbers:
        """Return ±b, with the sign of p."""
        lobes = self.lobes(s, size)
        if not self.floor:
            return lobes
        floor = self.floor * np.clip(1 + s, 0, 1) if self.shielded else self.floor
        return np.copysign(np.sqrt((1 - floor) * lobes * lobes + floor), lobes)

    def envelope(self, s: np.ndarray, size: float) -> np.ndarray:
        """Return the largest b from |s| outwards."""
        s = np.abs(s)
        if self.table is None:
            lobes = np.minimum(1 / np.maximum(np.pi * size * s, 1e-9), 1)
        else:
            half = len(self.table) // 2
            folded = np.maximum(np.abs(self.table[:half + 1][::-1]), np.abs(self.table[-half - 1:]))
            highest = np.maximum.accumulate(folded[::-1])[::-1]
            lobes = np.interp(s, np.linspace(0, 1, half + 1), highest)
        return np.sqrt((1 - self.floor) * lobes * lobes + self.floor)


EVEN = BeamShape()


def half_power(window: str = "boxcar", sag: float = 0.0) -> float:
    """Return x = L s / λ where p² of a line falls to a half for good, on one side of the axis."""
    return _half_power(window, float(sag))


@functools.lru_cache(maxsize=64)
def line_shape(size: float, *, window: str = "boxcar", sag: float = 0.0, floor: float = 0.0,
               shielded: bool = False) -> BeamShape:
    """Return the beam of a line."""
    # size [wavelengths]; sag [wavelengths]
    if size == 0 or (window.split() == ["boxcar"] and sag == 0):
        return BeamShape(floor=floor, shielded=shielded)
    steps = max(FEWEST_STEPS, int(np.ceil(STEPS_PER_LOBE * size)))
    half = _line(np.linspace(0, size, steps + 1), window, sag, max(SEGMENTS, int(np.ceil(2 * size))))
    table = np.concatenate([half[:0:-1], half])
    table.flags.writeable = False                  # of all that ask for the same beam
    return BeamShape(table=table, floor=floor, shielded=shielded)


def measured_shape(angle: np.ndarray, level_db: np.ndarray) -> tuple[BeamShape, float]:
    """Return a measured beam, and its full width at -3 dB [rad]."""
    # angle (K,) [rad]; level_db (K,) [dB]
    if not (len(angle) > 1 and (np.diff(angle) > 0).all() and np.abs(angle).max() <= np.pi / 2 + 1e-9):
        raise ValueError("a measured beam needs two angles or more that increase from -90 degrees to 90 at most; sort "
                         "them")
    finest = max(np.diff(np.sin(angle)).min(), 1e-5)
    steps = int(np.clip(np.ceil(4 / finest), 2 * FEWEST_STEPS, 1 << 17)) // 2 * 2
    levels = np.interp(np.arcsin(np.linspace(-1, 1, steps + 1)), angle, level_db - np.max(level_db))
    table = 10 ** (levels / 20)
    loud = np.flatnonzero(levels >= -3.0103)
    ends = np.arcsin(np.clip(np.linspace(-1, 1, steps + 1)[[max(loud[0] - 1, 0), min(loud[-1] + 1, steps)]], -1, 1))
    width = float(ends[1] - ends[0])
    if width < NARROWEST:
        raise ValueError(f"a measured beam is {np.rad2deg(width):.3g} degrees wide at -3 dB; give one of "
                         f"{np.rad2deg(NARROWEST):g} degrees or more")
    return BeamShape(table=table), width


@functools.cache
def _half_power(window, sag):
    x = np.linspace(0, FAR, FINE)
    power = _line(x, window, sag, SEGMENTS) ** 2 - 0.5
    last = np.flatnonzero(power >= 0)[-1]
    if last == FINE - 1:
        raise ValueError(f'a line with the window "{window}" and a sag of {sag:g} wavelengths has no beam; take a '
                         "wider window or a smaller sag")
    from scipy.optimize import brentq

    return float(brentq(lambda x: float(_line(np.array([x]), window, sag, SEGMENTS)[0]) ** 2 - 0.5, x[last],
                        x[last + 1]))


def _line(x: np.ndarray, window: str, sag: float, segments: int) -> np.ndarray:
    """Return pressures of a line at even steps x (K,): signed for a flat line, magnitudes for a curved one."""
    weights = window_weights(window, segments)
    place = (np.arange(segments) + 0.5) / segments - 0.5
    weights = weights * np.exp(8j * np.pi * sag * place ** 2) if sag else weights
    if len(x) * segments <= BLOCK:
        # windows are symmetric, so that the sum of phases is that of cosines
        sums = np.cos(2 * np.pi * x[:, None] * place) @ weights
    else:
        czt = module_alone("scipy.signal", "_czt.py").czt
        # the same at even steps of x, without the phase of the first segment
        turns = (x[-1] - x[0]) / (len(x) - 1) / segments
        sums = czt(weights * np.exp(-2j * np.pi * x[0] * place), len(x), np.exp(-2j * np.pi * turns))
        sums = sums * np.exp(-2j * np.pi * (x - x[0]) * place[0])
        sums = sums if sag else sums.real
    lobes = sums / weights.sum() * np.sinc(x / segments)
    return np.abs(lobes) if sag else lobes
