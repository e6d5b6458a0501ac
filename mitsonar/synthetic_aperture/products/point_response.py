"""Image of a point target: place, level, phase, widths and side lobes of its peak.

    I(a, s) = Σ_kl S_kl e^{i2π(k a/A + l s/C)},     S the spectrum of the points about the peak

A focused image has a limited band about a carrier, which the grid may alias. The spectrum is taken about its own
middle, so that the sum interpolates the points as a sinc does. Widths, side lobes and their energy are those of the two
cuts through the peak. At -3 dB, a boxcar of sines |u| <= U gives 0.886 λ/4U along the track, a sweep of bandwidth B
0.886 c/2B across it, over the cosine of the grazing angle on the ground (Cumming and Wong 2005, ch. 2).
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.units import db_from_amplitude, db_from_power

from ..record import check_image

REACH = 64                         # points to either side of the peak, at most
FINER = 32                         # points of the cuts per point of the grid


@dataclass(frozen=True, kw_only=True)
class Cut:
    """Cut of the image through the peak."""

    place: float  # [m], of the peak on this axis
    width: float  # [m], at -3 dB
    side_lobe_db: float  # [dB], highest side lobe relative to the peak
    integrated_db: float  # [dB], energy outside the main lobe relative to that inside


@dataclass(frozen=True, kw_only=True)
class PointResponse:
    """Measured image of a point target.

    Attributes
    ----------
    along_track, across_track : Cut
    level_db : float [dB re 1 m²]
    phase : float [rad]
    """

    along_track: Cut
    across_track: Cut
    level_db: float
    phase: float


def point_response(image: xr.Dataset, place: tuple[float, float] | None = None, *, bank: int = 0,
                   within: float = 0.5) -> PointResponse:
    """Measure the highest peak near a place.

    Parameters
    ----------
    image : xarray.Dataset
        A focused image.
    place : (float, float) or None [m]
        ``along_track`` and ``across_track``. None: the whole image.
    bank : int
    within : float [m]
        Of the place, on either axis.

    Raises
    ------
    ValueError
        If the image has fewer than 8 points to a side there, no value, or its axes are uneven.
    """
    check_image(image)
    axes = [np.asarray(image[name].values, float) for name in ("along_track", "across_track")]
    for name, axis in zip(("along_track", "across_track"), axes, strict=True):
        if len(axis) < 8 or not np.allclose(np.diff(axis), axis[1] - axis[0], rtol=1e-6, atol=1e-9):
            raise ValueError(f"{name} of the image must have 8 or more points at even steps; focus on such a grid")
    values = np.asarray(image["image"].values)[bank]
    near = [np.ones(len(axis), bool) if place is None else np.abs(axis - at) <= within
            for axis, at in zip(axes, place or (0, 0), strict=True)]
    power = np.where(near[0][:, None] & near[1], np.abs(values) ** 2, 0.0)
    if not power.max(initial=0) > 0:
        raise ValueError(f"the image has no value within {within:g} m of {place}; give a place inside the image")
    peak = np.unravel_index(int(power.argmax()), power.shape)
    cuts = tuple(slice(max(0, int(at) - REACH), int(at) + REACH) for at in peak)
    patch = _ImagePatch(values[cuts])
    fine = patch.peak(np.array([int(at) - cut.start for at, cut in zip(peak, cuts, strict=True)], float))
    value = patch.at(fine[:1], fine[1:])[0, 0]
    measured = [_cut(axis[cut], patch.along(number, fine), fine[number])
                for number, (axis, cut) in enumerate(zip(axes, cuts, strict=True))]
    return PointResponse(along_track=measured[0], across_track=measured[1],
                         level_db=float(db_from_amplitude(float(np.abs(value)))), phase=float(np.angle(value)))


class _ImagePatch:
    """Part of an image (A, C) as a sum of waves; places are counted in points."""

    def __init__(self, values: np.ndarray):
        self.shape = values.shape
        self._spectrum = np.fft.fft2(values) / values.size
        self._waves = []
        for axis, count in enumerate(self.shape):
            power = (np.abs(self._spectrum) ** 2).sum(1 - axis)
            middle = np.angle(power @ np.exp(2j * np.pi * np.arange(count) / count)) / (2 * np.pi)
            wave = np.fft.fftfreq(count)
            self._waves.append(wave + np.round(middle - wave))

    def at(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return the values (R, C) at rows (R,) and columns (C,)."""
        left, right = (np.exp(2j * np.pi * np.outer(places, wave))
                       for places, wave in zip((rows, columns), self._waves, strict=True))
        return left @ self._spectrum @ right.T

    def peak(self, about: np.ndarray) -> np.ndarray:
        """Return the place (2,) of the peak next to a point."""
        step = 1.0
        for _ in range(4):
            offsets = np.linspace(-step, step, 17)
            values = np.abs(self.at(about[0] + offsets, about[1] + offsets))
            row, column = np.unravel_index(int(values.argmax()), values.shape)
            about = about + [offsets[row], offsets[column]]
            step /= 6
        return about

    def along(self, axis: int, peak: np.ndarray) -> np.ndarray:
        """Return the power along one axis through the peak, `FINER` values per point."""
        places = np.arange((self.shape[axis] - 1) * FINER + 1) / FINER
        lines = (places, peak[1:]) if axis == 0 else (peak[:1], places)
        return np.abs(self.at(*lines).ravel()) ** 2


def _cut(axis: np.ndarray, power: np.ndarray, peak: float) -> Cut:
    """Return the measures of a cut with its peak at a place in points."""
    top = int(round(peak * FINER))
    highest = power[top]
    step = (axis[1] - axis[0]) / FINER
    ends = []
    for way in (-1, 1):
        side = power[top::way]
        below = np.flatnonzero(side < 0.5 * highest)
        if not len(below):
            raise ValueError("the image ends within the main lobe of the point; focus on a larger grid")
        k = below[0]
        half = k - 1 + (side[k - 1] - 0.5 * highest) / (side[k - 1] - side[k])
        rising = np.flatnonzero(np.diff(side[k:]) > 0)
        ends.append((half, k + rising[0] if len(rising) else len(side)))
    (left, before), (right, after) = ends
    main = slice(max(top - before + 1, 0), top + after)
    beside = np.concatenate([power[:main.start], power[main.stop:]])
    return Cut(place=float(axis[0] + peak * (axis[1] - axis[0])), width=float((left + right) * step),
               side_lobe_db=float(db_from_power(beside.max() / highest)) if len(beside) else float("nan"),
               integrated_db=float(db_from_power(beside.sum() / power[main].sum())) if len(beside) else float("nan"))
