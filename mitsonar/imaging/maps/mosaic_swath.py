"""Positions of sidescan bins on a map, in even steps over the ground.

    flat     p = P + v r/c + h tan(pitch) f + g s,      r² = h² (1 + tan²(pitch)) + g²       level bed below a ping
    truth    p = the recorded position of the bed in every bin, linear between bins

P position of the ping, v velocity (the sonar moves during the two-way time 2 r/c, on average r/c), h ``altitude``, f
ahead and s abeam to port or starboard, both level; g ground range in steps, r the slant range of its bin. Next to nadir
the bin of the first return covers the ground from g = 0. Shadows have no recorded position; `truth` interpolates
between the bed before and behind them.
"""
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr

from .georeference import map_places

PLACES = ("flat", "truth")


@dataclass(frozen=True, kw_only=True, eq=False)
class MosaicGround:
    """Samples of the ground for pings of one side."""

    place: np.ndarray  # (K, G, 2) [m]: on the map
    bin: np.ndarray  # (K, G): number of the bin
    ground_range: np.ndarray  # (G,) [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class MosaicSwath:
    """Geometry of one record on the map."""

    record: xr.Dataset
    position: np.ndarray  # (P, 2) [m]: on the map
    derivative: np.ndarray  # (P, 2, 2): of the map by the scene
    velocity: np.ndarray  # (P, 2) [m/s]: in the scene
    place: str  # 'flat' or 'truth'
    steepest: float  # [rad]: from nadir

    @classmethod
    def of(cls, record: xr.Dataset, crs: str | None, place: str, steepest: float) -> "MosaicSwath":
        """Return the geometry of a record; for errors see `map_places`."""
        places = map_places(record, crs)
        time, scene = (np.asarray(record["ping_time"].values, float),
                       np.stack([np.asarray(record[axis].values, float) for axis in "xy"], -1))
        velocity = np.gradient(scene, time, axis=0) if time.size > 1 else np.zeros_like(scene)
        return cls(record=record, position=places.position, derivative=places.derivative, velocity=velocity,
                   place=place, steepest=steepest)

    @property
    def bin_width(self) -> float:
        """Return the length of a bin [m]."""
        slant_range = self.record["range"].values
        return float(slant_range[-1] - slant_range[0]) / (slant_range.size - 1)

    @property
    def spacing(self) -> float:
        """Return the median distance of consecutive pings [m]; 0 for a single ping."""
        steps = np.linalg.norm(np.diff(self.position, axis=0), axis=1)
        return float(np.median(steps)) if steps.size else 0.0

    @property
    def reach(self) -> float:
        """Return the farthest ground range [m]."""
        return float(self.record["range"].values[-1]) + 0.5 * self.bin_width

    @property
    def around(self) -> float:
        """Return the largest distance on the map from a ping to its bins [m]."""
        stretch = float(np.linalg.norm(self.derivative, axis=(1, 2), ord=2).max())
        speed = float(np.linalg.norm(self.velocity, axis=1).max())
        return 1.01 * stretch * self.reach * (1 + speed / float(self.record.attrs["sound_speed"]))

    def bounds(self) -> tuple[float, float, float, float]:
        """Return west, south, east and north [m] of the region that the record can cover."""
        around = self.around
        (west, south), (east, north) = self.position.min(0) - around, self.position.max(0) + around
        return float(west), float(south), float(east), float(north)

    def ground(self, pings: slice, step: float) -> Iterator[tuple[int, MosaicGround]]:
        """Yield each side (0: port) with samples of its ground for pings, in steps [m]."""
        ground_range = step * (np.arange(int(self.reach / step)) + 0.5)
        sample = self._flat if self.place == "flat" else self._true
        for side, sign in enumerate((-1.0, 1.0)):
            yield side, sample(pings, side, sign, ground_range)

    def _flat(self, pings, side, sign, ground_range):
        record = self.record
        heading, pitch, altitude = (np.asarray(record[name].values[pings], float)
                                    for name in ("heading", "pitch", "altitude"))
        altitude = np.where((altitude > 0) & np.isfinite(altitude), altitude, np.nan)
        ahead = np.stack([np.sin(heading), np.cos(heading)], -1)
        abeam = sign * np.stack([ahead[:, 1], -ahead[:, 0]], -1)
        height = altitude[:, None]
        slant = np.hypot(height / np.cos(pitch)[:, None], ground_range)
        late = slant / float(record.attrs["sound_speed"])
        offset = (late[..., None] * self.velocity[pings][:, None] + (altitude * np.tan(pitch))[:, None, None]
                  * ahead[:, None] + ground_range[:, None] * abeam[:, None])
        first = float(record["range"].values[0])
        number = np.rint((slant - first) / self.bin_width)
        there = (number >= 0) & (number < record.sizes["range"]) & (ground_range >= height * np.tan(self.steepest))
        return self._laid(offset, number, there, ground_range, pings)

    def _true(self, pings, side, sign, ground_range):
        record, bins = self.record, np.arange(self.record.sizes["range"], dtype=float)
        known = np.stack([record[name].transpose("ping", "side", "range").values[pings, side].astype(float)
                          for name in ("seabed_x", "seabed_y")], -1)
        scene = np.stack([np.asarray(record[axis].values[pings], float) for axis in "xy"], -1)
        altitude = np.asarray(record["altitude"].values[pings], float)
        offset = np.full((*known.shape[:1], ground_range.size, 2), np.nan)
        number = np.zeros(offset.shape[:2])
        for ping, (places, start) in enumerate(zip(known, scene, strict=True)):
            at = np.flatnonzero(np.isfinite(places).all(1))
            if at.size < 2:
                continue
            away = places[at] - start
            far = np.maximum.accumulate(np.hypot(*away.T))           # layover may come nearer again
            number[ping] = np.interp(ground_range, far, bins[at])
            offset[ping] = np.stack([np.interp(number[ping], bins[at], axis) for axis in away.T], -1)
            offset[ping, (ground_range < far[0]) | (ground_range > far[-1])] = np.nan
        steep = ground_range < np.where(np.isfinite(altitude), altitude, 0)[:, None] * np.tan(self.steepest)
        return self._laid(offset, np.rint(number), ~steep, ground_range, pings)

    def _laid(self, offset, number, there, ground_range, pings):
        moved = np.einsum("pij,pgj->pgi", self.derivative[pings], offset)
        there = there & (np.hypot(moved[..., 0], moved[..., 1]) <= self.around)      # False for NaN
        place = np.where(there[..., None], moved + self.position[pings][:, None], np.nan)
        return MosaicGround(place=place, ground_range=ground_range, bin=np.where(there, number, 0).astype(np.int64))
