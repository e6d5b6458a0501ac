"""The part of a speckled image that a fit compares: intensities summed over a few bins.

    Y = Σ_k (y + f),    M = Σ_k (m + f),    Y ~ Gamma(L_k, M),    1/L_k = 1/(k L) + ε²

y, m -> intensities seen and modelled; f -> ``floor``: what keeps bins that the model leaves dark, shadows and the water
before the first return, from counting without end; L -> ``looks`` of a bin; ε -> ``model_error``: what a model with
other rays and facets cannot match. The deviance is 2 L_k (Y/M - 1 - log(Y/M)), Huber's beyond 3.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from ..fitting.likelihood import Gamma
from .scene_fit import image_intensities

HUBER = 3.0                        # √deviance beyond which it grows linearly
BRIGHT, FAINT = 0.1, 0.15          # floors about the first return, re the loudest bin; beyond, re the bin's own level
ABOUT = 1.7                        # [m] of slant range beyond the first return that the first of them reaches
BEFORE = 1.4                       # [m] of slant range that counts before the first return


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageRecord:
    """A sidescan's image as intensities."""

    intensity: np.ndarray  # [µPa²]
    first: int  # bins that count
    last: int  # bins that count
    floor: np.ndarray  # [µPa²]
    looks: float
    model_error: float  # relative, of a bin's mean
    first_return: np.ndarray  # [m]
    bin_width: float  # [m]

    @classmethod
    def of(cls, image: xr.Dataset, shape: tuple[int, ...], *, looks: float, farthest: float | None = None,
           model_error: float = 0.05) -> ImageRecord:
        """Read an image that a model of some shape is to match."""
        # farthest [m]
        if "level" in image and {"ping", "side", "range"} == set(image["level"].dims):
            image = image.transpose("ping", "side", "range", ...)
        seen = image_intensities(image, "sidescan", shape)
        if not np.all(np.isfinite(seen)):
            raise ValueError("levels of the image are missing or not finite; cut pings without a record off")
        if not (looks > 0 and np.isfinite(looks)):
            raise ValueError(f"looks is {looks:g}; give the number of looks of a bin, above 0: 1 for raw speckle")
        ranges = image["range"].values.astype(float)
        width = float(np.mean(np.diff(ranges)))
        returns = first_return_range(seen, width)
        nearest = float(np.median(returns))
        counted = ranges > nearest - BEFORE
        counted &= ranges < (np.inf if farthest is None else farthest)
        if counted.sum() < 8:
            raise ValueError(f"only {counted.sum()} bins lie between the first return at {nearest:.1f} m and "
                             f"{farthest} m; give a farther range")
        typical = np.median(seen.reshape(-1, seen.shape[-1]), 0)
        floor = np.where(ranges < nearest + ABOUT, BRIGHT * typical[counted].max(), FAINT * typical)
        first, last = np.flatnonzero(counted)[[0, -1]]
        return cls(intensity=seen, first=int(first), last=int(last), floor=np.maximum(floor, 1e-300), looks=looks,
                   model_error=model_error, first_return=returns, bin_width=width)

    def at(self, bins: int) -> Comparison:
        """Return the comparison of sums over so many bins."""
        return Comparison(self, bins)


class Comparison:
    """Sums of bins of a record, and of a model's."""

    def __init__(self, record: ImageRecord, bins: int):
        self._record, self._bins = record, bins
        self._count = (record.last + 1 - record.first) // bins
        self.seen = self.summed((record.intensity + record.floor).ravel())
        self.looks = 1 / (1 / (record.looks * bins) + record.model_error ** 2)

    def summed(self, values: np.ndarray) -> np.ndarray:
        """Sum a flat record (N,) over bins, those that do not count left out."""
        first = self._record.first
        rows = values.reshape(-1, self._record.intensity.shape[-1])[:, first:first + self._count * self._bins]
        return rows.reshape(len(rows), self._count, self._bins).sum(2).ravel()

    def transposed(self, weights: np.ndarray) -> np.ndarray:
        """Return the transpose of `summed`."""
        shape, first = self._record.intensity.shape, self._record.first
        rows = np.zeros((shape[0] * shape[1], shape[2]))
        rows[:, first:first + self._count * self._bins] = np.repeat(weights.reshape(len(rows), -1), self._bins, 1)
        return rows.ravel()

    def likelihood(self) -> Gamma:
        """Return that of the sums."""
        return self._likelihood(self.seen)

    def over_speckle(self, predicted: np.ndarray) -> float:
        """Return the deviance of a model's sums (M,) over that of a draw of speckle about them."""
        looks = self._record.looks * self._bins
        drawn = np.random.default_rng(0).gamma(looks, np.maximum(predicted, 0) / looks) + self._floor
        seen, expected = (one.terms(predicted).misfit for one in (self.likelihood(), self._likelihood(drawn)))
        return seen / expected

    def _likelihood(self, seen: np.ndarray) -> Gamma:
        return Gamma(seen, self.looks, background=self._floor, robust=HUBER)

    @property
    def _floor(self) -> np.ndarray:
        record = self._record
        return self.summed(np.broadcast_to(record.floor, record.intensity.shape).ravel())


def first_return_range(intensity: np.ndarray, bin_width: float) -> np.ndarray:
    """Return the slant range (pings,) [m] of the bed's first return, of both sides' mean."""
    from mitsonar.imaging.picture_statistics import first_return

    found = np.mean([first_return(np.sqrt(side), bin_width) for side in np.moveaxis(intensity, 1, 0)], 0)
    return (found + 0.5) * bin_width


def saturated(intensity: np.ndarray) -> int:
    """Count bins at the recorder's full scale: those that share the loudest level, where more than two do."""
    count = int(np.sum(intensity >= intensity.max() * (1 - 1e-9)))
    return count if count > 2 else 0
