"""Compute the contribution of each ping of a strip to its focused image, and its phase when the ping moves sideways.

    I(x; s) = Σ_p A_p(x) exp(iθ_p(x) s_p),     θ = 2πf₀ ∂τ/∂s = -4π (f₀/c) n_p·(x - x_p) / |x - x_p|

A -> images of one ping each, by back-projection along the assumed ``trajectory``; s -> `sway`, displacement to
starboard at a ping; n -> starboard, level. Envelopes are not moved: s must be small against the resolution in range, or
images be made again.
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from mitsonar.synthetic_aperture.focusing.focusing import Focuser
from mitsonar.synthetic_aperture.focusing.grids import Grid, default_grid
from mitsonar.synthetic_aperture.focusing.poses import MOTION, poses_of
from mitsonar.synthetic_aperture.record import check_raw

MOST_BYTES = 1 << 30               # of all pings' images


@dataclass(frozen=True, kw_only=True, eq=False)
class PingImages:
    """Images of pings.

    Attributes
    ----------
    images : complex64 (P, N)
        A, for points that some ping sees.
    rates : float32 (P, N) [rad/m]
        Rates θ of phase with sway.
    points : (N,) int
        Numbers of the points in the grid.
    grid : Grid
        Grid of the image.
    time : (P,) [s]
        Times of the transmissions.
    along : (P,) [m]
        Position of the sonar along the strip, about the middle.
    """

    images: np.ndarray
    rates: np.ndarray
    points: np.ndarray
    grid: Grid
    time: np.ndarray
    along: np.ndarray

    @classmethod
    def of(cls, raw: xr.Dataset, grid: Grid | None = None, trajectory: xr.Dataset | None = None,
           **how: Any) -> PingImages:
        """Focus the first bank of every ping alone.

        Parameters
        ----------
        raw : Dataset
            Raw echoes.
        grid : Grid or None
            Points of the image; None: `grids.default_grid`.
        trajectory : Dataset or None
            Assumed trajectory; None: the record's own.
        **how
            Windows and the profile, as in `synthetic_aperture.focusing.focus`.

        Raises
        ------
        ValueError
            See `focus`; or if images of all pings take more than 1 GiB.
        """
        check_raw(raw)
        believed = raw if trajectory is None else trajectory
        poses, pings = poses_of(believed), raw.sizes["ping"]
        if pings < 3:
            raise ValueError(f"sway needs at least three pings, got {pings}")
        if grid is None:
            grid = default_grid(raw.assign({name: believed[name] for name in ("motion_time", *MOTION)}))
        if 8 * pings * grid.depth.size > MOST_BYTES:
            raise ValueError(f"images of {pings} pings at {grid.depth.size} points take "
                             f"{8 * pings * grid.depth.size / 2**30:.1f} GiB, and 1 is the most; lay a smaller grid "
                             "about what is bright")
        focuser = _Alone(raw, grid, trajectory=trajectory, **how)
        focuser.add(raw)
        images, weight = focuser.images()
        seen = np.flatnonzero(weight > 0)
        if not len(seen):
            raise ValueError(f"none of {pings} pings sees the grid within its beam and record; lay it where the record "
                             "looks")
        images = (images[:, seen] / weight[seen]).astype(np.complex64)
        time = np.asarray(raw["ping_time"].values, float)
        # a ping is where it is half-way between transmission and reception
        middle = time + 0.5 * float(np.mean(raw["time"].values))
        place, rotation = poses.position(middle), poses.rotation(middle)
        starboard = rotation[:, :, 1] * [1, 1, 0]
        starboard /= np.linalg.norm(starboard, axis=1, keepdims=True)
        point = np.stack([grid.x.ravel()[seen], grid.y.ravel()[seen], -np.asarray(grid.depth, float).ravel()[seen]], 1)
        away = point - place[:, None]
        sine = np.einsum("pnx,px->pn", away, starboard) / np.linalg.norm(away, axis=2)
        wavelength = focuser.sound_speed / focuser.frequency
        ahead = rotation[:, :, 0].mean(0)
        along = place @ ahead
        return cls(images=images, rates=(-4 * np.pi / wavelength * sine).astype(np.float32), points=seen, grid=grid,
                   time=time, along=along - along.mean())

    @property
    def period(self) -> float:
        """Sway [m] that turns the phases of the brightest points by a whole turn: half a wavelength, seen level."""
        power = np.sum(np.abs(self.images) ** 2, 0, dtype=float)
        return float(2 * np.pi * power.sum() / (power @ np.abs(self.rates).mean(0, dtype=float)))

    def turned(self, sway: np.ndarray) -> np.ndarray:
        """Return the pings' images (P, N) with a sway (P,) [m]."""
        phase = self.rates * sway[:, None].astype(np.float32)
        return self.images * (np.cos(phase) + 1j * np.sin(phase))

    def image(self, sway: np.ndarray) -> np.ndarray:
        """Return the image on the whole grid, complex64, 0 where no ping sees it."""
        whole = np.zeros(self.grid.depth.size, np.complex64)
        whole[self.points] = self.turned(sway).sum(0)
        return whole.reshape(self.grid.depth.shape)

    def part(self, chosen: np.ndarray) -> PingImages:
        """Return the image at a part of the points (N,)."""
        return PingImages(images=self.images[:, chosen], rates=self.rates[:, chosen], points=self.points[chosen],
                          grid=self.grid, time=self.time, along=self.along)


class _Alone(Focuser):
    """Focus pings without adding them."""

    def __init__(self, *arguments: Any, **how: Any):
        super().__init__(*arguments, **how)
        self._alone: dict[float, np.ndarray] = {}

    def _add(self, start: float, transmitter: np.ndarray, heard: np.ndarray, step: float) -> None:
        image = self._images[0]
        before = image.real.numpy() + 1j * image.imaginary.numpy()
        super()._add(start, transmitter, heard, step)
        self._alone[start] = (image.real.numpy() + 1j * image.imaginary.numpy() - before).astype(np.complex64)

    def images(self) -> tuple[np.ndarray, np.ndarray]:
        """Return images (P, N) in the order of the pings, and the weight (N,) of them all."""
        return np.stack([self._alone[start] for start in sorted(self._alone)]), self._images[0].weight.numpy()


def moved(trajectory: xr.Dataset, time: np.ndarray, sway: np.ndarray) -> xr.Dataset:
    """Move a trajectory to starboard by a sway (P,) [m] at times (P,) [s], smoothly between."""
    poses = poses_of(trajectory)
    when = np.asarray(trajectory["motion_time"].values, float)
    there = CubicSpline(time, sway)(np.clip(when, time[0], time[-1]))
    heading = poses.heading(when)
    changed = {"motion_x": np.cos(heading) * there, "motion_y": -np.sin(heading) * there}
    return trajectory.assign({name: trajectory[name] + change for name, change in changed.items()})
