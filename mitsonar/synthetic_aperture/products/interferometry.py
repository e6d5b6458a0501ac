"""Heights of the bed from two banks of a focused image.

    φ(p) = arg Σ I₁ I₀*            = -k [(ρ₁(s) - ρ₀(s)) - (ρ₁(p) - ρ₀(p))]             over a window
    ρ₀(s) + ρ₁(s) = ρ₀(p) + ρ₁(p)                                                       s: the echo focused at p
    σ_h = σ_φ |dh/dφ|,             σ_φ by `coherence_statistics.phase_spread`

p -> a point of the grid, s -> the true place of its echo, on the ellipse of equal paths through p. Newton's method
turns s about the arrays until the banks differ as measured, so heights are exact for any geometry. I₀, I₁ -> the
``banks``, ρ -> `geometry`, k = 2πf₀/c. Both banks are focused on one grid, so the phase of a bed in the grid is 0. The
coherence is that of `windowed_coherence`, without its bias.

Phases are unwrapped by weighted least squares:

    minimise  Σ w_pq (u_p - u_q - W(φ_p - φ_q))²                 over neighbours p, q; w of the less coherent point
    φ + 2π round((u - φ) / 2π)                                   the result is the phase itself, plus whole turns

φ -> ``phase``, W wraps into -π ... π. The solver is the method of conjugate gradients, preconditioned with the same sum
without weights, which cosine transforms invert (Ghiglia and Romero 1994, J. Opt. Soc. Am. A 11, 107). The result is
right for any bed whose neighbours differ by less than half a turn, up to a common number of turns. Beyond a higher
step, such as a wall, turns are right only if a way around the step exists.

References
----------
Sæbø (2010), Seafloor depth estimation by means of interferometric synthetic aperture sonar, University of Tromsø.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import fft, ndimage

from ..focusing.compression import window_samples
from ..focusing.geometry import (
    ArrayPaths,
    array_paths,
    bank_paths,
    ground_across,
    image_variables,
    with_array_paths,
)
from ..record import check_image
from .coherence_statistics import independent_looks, phase_spread, unbiased_coherence, windowed_coherence

__all__ = ["height_of_phase", "interferogram", "phase_of_height", "unwrapped"]
ROUNDS, ENOUGH = 200, 1e-4         # most steps of conjugate gradients; relative residual
NEWTON = 5                         # steps
ELLIPSE = 2                        # rounds; each leaves the square of the arrays' height over the range
FARTHEST_TURN = 0.2                # [rad], largest step of Newton's method
TINY = 1e-4                        # [rad], of finite differences
SPREADS = 65                       # of the table of phase spreads over the arc cosine of coherence


def unwrapped(phase: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Unwrap phases.

    Parameters
    ----------
    phase : (A, C) [rad]
        NaN where unknown.
    weight : (A, C) [-]
        0 where a phase does not count.

    Returns
    -------
    (A, C) [rad]
        `phase` plus whole turns; the weighted mean is within half a turn of 0. NaN where `phase` is.

    Raises
    ------
    ValueError
        If the shapes differ, or a weight is negative or NaN.
    """
    if phase.ndim != 2 or phase.shape != weight.shape or not np.all(weight >= 0):
        raise ValueError(f"the phases have the shape {phase.shape} and the weights {weight.shape}; give two "
                         "dimensions, the same for both, and weights of 0 or more")
    known = np.isfinite(phase)
    flat, share = np.where(known, phase, 0.0), np.where(known, weight, 0.0)
    if not share.any():
        return np.where(known, phase, np.nan)
    share = share / share.max()
    links = [np.minimum(share[1:], share[:-1]), np.minimum(share[:, 1:], share[:, :-1])]
    steps = [_wrapped(np.diff(flat, axis=axis)) for axis in (0, 1)]
    smooth = _solved(_divergence([link * step for link, step in zip(links, steps)], phase.shape), links)
    smooth = smooth - np.angle(np.sum(share * np.exp(1j * (smooth - flat))))
    result = flat + 2 * np.pi * np.round((smooth - flat) / (2 * np.pi))
    parts, count = ndimage.label(share > 0)
    for part in range(1, count + 1):                    # separate patches do not determine each other's turns
        inside = parts == part
        mean = np.sum(share[inside] * result[inside]) / np.sum(share[inside])
        result[inside] -= 2 * np.pi * np.round(mean / (2 * np.pi))
    return np.where(known, result, np.nan)


def _solved(right: np.ndarray, links: list[np.ndarray]) -> np.ndarray:
    solution, rest = np.zeros_like(right), right.copy()
    size, before, along = float(np.linalg.norm(right)), 0.0, np.zeros_like(right)
    for _ in range(ROUNDS):
        if np.linalg.norm(rest) <= ENOUGH * size:
            break
        preconditioned = _without_weights(rest)
        product = float(np.sum(rest * preconditioned))
        along = preconditioned + (product / before if before else 0.0) * along
        before = product
        pushed = _divergence([link * np.diff(along, axis=axis) for axis, link in enumerate(links)], right.shape)
        length = product / float(np.sum(along * pushed))
        solution, rest = solution + length * along, rest - length * pushed
    return solution


def _divergence(flows: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """Return the sums (A, C) of flows (A - 1, C), (A, C - 1) to later neighbours, positive where they arrive."""
    total = np.zeros(shape)
    total[1:] += flows[0]
    total[:-1] -= flows[0]
    total[:, 1:] += flows[1]
    total[:, :-1] -= flows[1]
    return total


def _without_weights(right: np.ndarray) -> np.ndarray:
    waves = [2 - 2 * np.cos(np.pi * np.arange(size) / size) for size in right.shape]
    total = waves[0][:, None] + waves[1]
    total[0, 0] = np.inf
    return fft.idctn(fft.dctn(right, type=2) / total, type=2)


def _wrapped(phase: np.ndarray) -> np.ndarray:
    return phase - 2 * np.pi * np.round(phase / (2 * np.pi))


def interferogram(image: xr.Dataset, raw: xr.Dataset | None = None, window: tuple[float, float] = (0.3, 0.3), *,
                  banks: tuple[int, int] = (0, 1), trajectory: xr.Dataset | None = None,
                  sound_speed: float | None = None, unwrap: bool = True) -> xr.Dataset:
    """Compute phase, coherence and height of the bed from two banks of an image.

    Parameters
    ----------
    image : Dataset
        Focused image.
    raw : Dataset or None
        Raw echoes of the image, at least one ping, which determine the places of the arrays. None: the image has the
        variables of `geometry.with_array_paths`.
    window : (float, float) [m]
        Along and across the track, over which looks are averaged.
    banks : (int, int)
    trajectory : Dataset or None
        Trajectory that the image was focused with. None: that of the raw echoes.
    sound_speed : float or None [m/s]
        One value for the whole path. None: the image's attribute sound_speed. A bed in the grid has the height 0 in any
        water; the change of height with phase is that of straight rays.
    unwrap : bool
        False: phases stay within half a turn, which is right for beds near the grid.

    Returns
    -------
    Dataset
        The image with phase [rad], coherence, height [m] above the grid's points and height_deviation [m], all
        (along_track, across_track); points that were not focused are NaN. A height belongs to the true place of the
        point's echo, which is a little nearer to the sonar where the bed is above the grid.

    Raises
    ------
    ValueError
        If the image has no such banks, the places of its arrays are unknown, or the window is not positive.
    """
    check_image(image)
    if raw is not None:
        image = with_array_paths(image, raw, trajectory)
    count = image.sizes["bank"]
    if len(set(banks)) != 2 or not all(0 <= bank < count for bank in banks):
        raise ValueError(f"banks {banks[0]} and {banks[1]} were asked for, and the image has {count}, counted from 0; "
                         "give two different ones")
    paths, speed = array_paths(image), _sound_speed(image, sound_speed)
    size = window_samples(image, window)
    first, second = (np.where(image["image"].values[bank] == 0, np.nan, image["image"].values[bank]) for bank in banks)
    estimate = windowed_coherence(first, second, size)
    looks = max(independent_looks(first, size), 1.01)
    known = np.isfinite(estimate)
    coherence = np.where(known, unbiased_coherence(np.abs(np.where(known, estimate, 0)), looks), np.nan)
    phase = np.angle(estimate)
    if unwrap:
        weight = np.where(known, coherence, 0.0) ** 2
        phase = unwrapped(phase, weight)
    wavenumber = 2 * np.pi * float(image.attrs["frequency"]) / speed
    height, slope = height_of_phase(phase, image, paths, wavenumber, banks)
    # near 1 the spread varies as √(1 - coherence²), which linear interpolation over coherence misses by a third
    nodes = np.linspace(0, 0.5 * np.pi, SPREADS)
    spread = np.interp(np.arccos(np.clip(coherence, 0.0, 1.0)), nodes,
                       [phase_spread(node, max(looks, 1.0)) for node in np.clip(np.cos(nodes), 0.0, 1.0)])
    values = {"phase": phase, "coherence": coherence, "height": height, "height_deviation": spread * np.abs(slope)}
    return image.assign(image_variables({name: array.astype(np.float32) for name, array in values.items()})
                        ).assign_attrs(looks=looks)


def phase_of_height(height: np.ndarray | float, image: xr.Dataset, paths: ArrayPaths, wavenumber: float,
                    banks: tuple[int, int] = (0, 1)) -> np.ndarray:
    """Return the phase (A, C) [rad] of a bed `height` [m] above the grid's points."""
    focused = _FocusedPoints.at(image, paths, banks)
    turn, wanted = focused.turn, focused.height + np.asarray(height, float)
    for _ in range(NEWTON):
        here, ahead = (focused.place(angle)[1] for angle in (turn, turn + TINY))
        turn = turn - (here - wanted) / ((ahead - here) / TINY)
    return -wavenumber * focused.difference(turn)


def height_of_phase(phase: np.ndarray, image: xr.Dataset, paths: ArrayPaths, wavenumber: float,
                    banks: tuple[int, int] = (0, 1)) -> tuple[np.ndarray, np.ndarray]:
    """Return the heights (A, C) [m] above the grid's points that have these phases, and dh/dφ [m/rad].

    Parameters
    ----------
    phase : (A, C) [rad]
        Unwrapped.
    image : Dataset
    paths : ArrayPaths
    wavenumber : float [rad/m]
    banks : (int, int)
    """
    focused = _FocusedPoints.at(image, paths, banks)
    turn = focused.turn
    for _ in range(NEWTON):
        now, then = (-wavenumber * focused.difference(angle) for angle in (turn, turn + TINY))
        slope = (then - now) / TINY
        turn = turn + np.clip((phase - now) / slope, -FARTHEST_TURN, FARTHEST_TURN)
    here, ahead = (focused.place(angle)[1] for angle in (turn, turn + TINY))
    return here - focused.height, (ahead - here) / TINY / slope


@dataclass(frozen=True, kw_only=True)
class _FocusedPoints:
    """Possible places of the echoes at an image's points: ellipses about the arrays' middle."""

    paths: ArrayPaths
    banks: tuple[int, int]
    middle: np.ndarray  # (A, 2) [m], of the arrays, across the track and z
    turn: np.ndarray  # (A, C) [rad], direction of the grid's points from it
    away: np.ndarray  # (A, C) [m], their distance
    height: np.ndarray  # (A, C) [m], their z, up
    way: np.ndarray  # (A, C) [m], sum of both banks' paths to them
    apart: np.ndarray  # (A, C) [m], the second bank's path minus the first's

    @classmethod
    def at(cls, image: xr.Dataset, paths: ArrayPaths, banks: tuple[int, int]) -> _FocusedPoints:
        across, height = ground_across(image), -image["grid_depth"].values.astype(float)
        middle = 0.5 * paths.sender + 0.25 * (paths.bank[banks[0]] + paths.bank[banks[1]])
        aside, up = across - middle[:, :1], height - middle[:, 1:]
        first, second = (bank_paths(paths, bank, across, height) for bank in banks)
        return cls(paths=paths, banks=banks, middle=middle, turn=np.arctan2(up, aside), away=np.hypot(aside, up),
                   height=height, way=first + second, apart=second - first)

    def place(self, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (across, z) in directions from the middle with the grid's points' sum of paths."""
        sine, cosine, reach = np.sin(turn), np.cos(turn), self.away
        for _ in range(ELLIPSE):                          # the sum is nearly four times the distance
            across, height = self.middle[:, :1] + reach * cosine, self.middle[:, 1:] + reach * sine
            reach = reach * self.way / sum(bank_paths(self.paths, bank, across, height) for bank in self.banks)
        return self.middle[:, :1] + reach * cosine, self.middle[:, 1:] + reach * sine

    def difference(self, turn: np.ndarray) -> np.ndarray:
        """Return the difference of the banks' paths in directions `turn` minus that at the grid's points [m]."""
        first, second = (bank_paths(self.paths, bank, *self.place(turn)) for bank in self.banks)
        return second - first - self.apart


def _sound_speed(image: xr.Dataset, given: float | None) -> float:
    value = image.attrs.get("sound_speed") if given is None else given
    if value is None or not (np.isfinite(value) and value > 0):
        raise ValueError(f"the sound speed at the arrays is {value}; give sound_speed in m/s")
    return float(value)
