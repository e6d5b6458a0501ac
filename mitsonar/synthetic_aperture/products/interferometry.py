"""Heights of the bed from two banks of a focused image.

    φ(p) = arg Σ I₁ I₀*            = -k [(ρ₁(s) - ρ₀(s)) - (ρ₁(p) - ρ₀(p))]             over a window
    ρ₀(s) + ρ₁(s) = ρ₀(p) + ρ₁(p)                                                       s sounds where p is focused
    σ_h = σ_φ |dh/dφ|,             σ_φ by `coherence_statistics.phase_spread`

p -> a point of the grid, s -> the place of what is heard there: on the ellipse about p through equal ways, turned
about the arrays until the banks differ as measured. Newton's method finds it, so heights are exact for any geometry.
I₀, I₁ -> the ``banks``, ρ -> `geometry`, k = 2πf₀/c. Banks are focused on one grid, so the phase of a bed that lies in
the grid is 0. Coherence is what `windowed_coherence` estimates, its bias taken out.

References
----------
Sæbø (2010), Seafloor depth estimation by means of interferometric synthetic aperture sonar, University of Tromsø.

Phases without jumps of a turn, over an image.

    minimise  Σ w_pq (u_p - u_q - W(φ_p - φ_q))²                 over neighbours p, q; w of the less coherent of two
    φ + 2π round((u - φ) / 2π)                                   so that what comes out is the phase itself, and turns

φ -> ``phase``, W wraps into -π ... π. Solved by conjugate gradients, preconditioned with the same sum without weights,
which cosine transforms invert (Ghiglia and Romero 1994, J. Opt. Soc. Am. A 11, 107).

It follows any bed whose neighbours differ by less than half a turn. Where a step is higher, as at a wall, the turns of
what lies beyond are right only if some way round the step is not; and the whole is known but for a common turn.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy import fft, ndimage

from ..focusing.compression import window_samples
from ..focusing.geometry import ArrayPaths, array_paths, bank_paths, ground_across, with_array_paths
from ..record import IMAGE_VARIABLES, check_image
from .coherence_statistics import independent_looks, phase_spread, unbiased_coherence, windowed_coherence

__all__ = ["height_of_phase", "interferogram", "phase_of_height", "unwrapped"]


ROUNDS, ENOUGH = 200, 1e-4


def unwrapped(phase: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Unwrap phases.

    Parameters
    ----------
    phase : (A, C) [rad]
        NaN where there is none.
    weight : (A, C) [-]
        0 where a phase counts for nothing.

    Returns
    -------
    (A, C) [rad]
        `phase` plus whole turns; the mean over the weights is within half a turn of 0. NaN where it was.

    Raises
    ------
    ValueError
        If the shapes differ, or a weight is negative or no number.
    """
    if phase.ndim != 2 or phase.shape != weight.shape or not np.all(weight >= 0):
        raise ValueError(f"phases of the shape {phase.shape} and weights of {weight.shape} were given; give two "
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
    for part in range(1, count + 1):                    # patches apart know nothing of each other's turns
        inside = parts == part
        mean = np.sum(share[inside] * result[inside]) / np.sum(share[inside])
        result[inside] -= 2 * np.pi * np.round(mean / (2 * np.pi))
    return np.where(known, result, np.nan)


def _solved(right: np.ndarray, links: list[np.ndarray]) -> np.ndarray:
    found, rest = np.zeros_like(right), right.copy()
    size, before, along = float(np.linalg.norm(right)), 0.0, np.zeros_like(right)
    for _ in range(ROUNDS):
        if np.linalg.norm(rest) <= ENOUGH * size:
            break
        better = _without_weights(rest)
        product = float(np.sum(rest * better))
        along = better + (product / before if before else 0.0) * along
        before = product
        pushed = _divergence([link * np.diff(along, axis=axis) for axis, link in enumerate(links)], right.shape)
        length = product / float(np.sum(along * pushed))
        found, rest = found + length * along, rest - length * pushed
    return found


def _divergence(flows: list[np.ndarray], shape: tuple[int, ...]) -> np.ndarray:
    """What flows (A - 1, C), (A, C - 1) to later neighbours leave behind, (A, C), with the sign of a positive sum."""
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


NEWTON = 5
ELLIPSE = 2                        # rounds: off by the square of the arrays' height over the range, each
FARTHEST_TURN = 0.2                # [rad] of a step of Newton's
TINY = 1e-4                        # [rad] of differences
SPREADS = 65                       # of the table of phase spreads over the arc cosine of coherence


def interferogram(image: xr.Dataset, raw: xr.Dataset | None = None, window: tuple[float, float] = (0.3, 0.3), *,
                  banks: tuple[int, int] = (0, 1), trajectory: xr.Dataset | None = None,
                  sound_speed: float | None = None, unwrap: bool = True) -> xr.Dataset:
    """Tell phase, coherence and height of the bed from two banks of an image.

    Parameters
    ----------
    image : Dataset
        Focused.
    raw : Dataset or None
        Raw echoes that it was focused of, one ping at least, for where their arrays were. None: the image has what
        `geometry.with_array_paths` adds.
    window : (float, float) [m]
        Along and across the track, over which looks are summed.
    banks : (int, int)
    trajectory : Dataset or None
        That the image was focused with; None: the raw echoes' own.
    sound_speed : float or None [m/s]
        One for all the way; None: the image's attribute sound_speed. A bed in the grid has the height 0 in any water;
        how heights grow from there with the phase is that of straight rays.
    unwrap : bool
        False leaves phases within half a turn, which is right for beds that near the grid.

    Returns
    -------
    Dataset
        The image with phase [rad], coherence, height [m] above the grid's points and height_deviation [m], all
        (along_track, across_track); points that were not focused are NaN. A height belongs to what is heard at the
        point: a little nearer to the sonar where it stands out.

    Raises
    ------
    ValueError
        If the image has no such banks, its arrays' places are not known, or a window is no window.
    """
    check_image(image)
    if raw is not None:
        image = with_array_paths(image, raw, trajectory)
    count = image.sizes["bank"]
    if len(set(banks)) != 2 or not all(0 <= bank < count for bank in banks):
        raise ValueError(f"banks {banks[0]} and {banks[1]} are asked for, and the image has {count}, counted from 0; "
                         "heights need two that differ")
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
    # near 1 a spread goes by √(1 - coherence²), which a straight line over the coherence itself misses by a third
    nodes = np.linspace(0, 0.5 * np.pi, SPREADS)
    spread = np.interp(np.arccos(np.clip(coherence, 0.0, 1.0)), nodes,
                       [phase_spread(node, max(looks, 1.0)) for node in np.clip(np.cos(nodes), 0.0, 1.0)])
    values = {"phase": phase, "coherence": coherence, "height": height, "height_deviation": spread * np.abs(slope)}
    return image.assign({name: (IMAGE_VARIABLES[name].dims, some.astype(np.float32), {
        "units": IMAGE_VARIABLES[name].unit, "long_name": IMAGE_VARIABLES[name].meaning})
        for name, some in values.items()}).assign_attrs(looks=looks)


def phase_of_height(height: np.ndarray | float, image: xr.Dataset, paths: ArrayPaths, wavenumber: float,
                    banks: tuple[int, int] = (0, 1)) -> np.ndarray:
    """Return the phase (A, C) [rad] of a bed `height` [m] above the grid's points, heard where they are focused."""
    heard = _Heard.at(image, paths, banks)
    turn, wanted = heard.turn, heard.height + np.asarray(height, float)
    for _ in range(NEWTON):
        here, ahead = (heard.place(angle)[1] for angle in (turn, turn + TINY))
        turn = turn - (here - wanted) / ((ahead - here) / TINY)
    return -wavenumber * heard.difference(turn)


def height_of_phase(phase: np.ndarray, image: xr.Dataset, paths: ArrayPaths, wavenumber: float,
                    banks: tuple[int, int] = (0, 1)) -> tuple[np.ndarray, np.ndarray]:
    """Return heights (A, C) [m] above the grid's points that have the phases, and dh/dφ [m/rad].

    Parameters
    ----------
    phase : (A, C) [rad]
        Unwrapped.
    image : Dataset
    paths : ArrayPaths
    wavenumber : float [rad/m]
    banks : (int, int)
    """
    heard = _Heard.at(image, paths, banks)
    turn = heard.turn
    for _ in range(NEWTON):
        now, then = (-wavenumber * heard.difference(angle) for angle in (turn, turn + TINY))
        slope = (then - now) / TINY
        turn = turn + np.clip((phase - now) / slope, -FARTHEST_TURN, FARTHEST_TURN)
    here, ahead = (heard.place(angle)[1] for angle in (turn, turn + TINY))
    return here - heard.height, (ahead - here) / TINY / slope


@dataclass(frozen=True, kw_only=True)
class _Heard:
    """Where what is heard at an image's points may lie: on ellipses about the arrays' middle."""

    paths: ArrayPaths
    banks: tuple[int, int]
    middle: np.ndarray  # (A, 2) [m]: of the arrays, across the track and z
    turn: np.ndarray  # (A, C) [m]: of the grid's points about it
    away: np.ndarray  # (A, C) [m]: of the grid's points about it
    height: np.ndarray  # (A, C) [m]: of those points, z up
    way: np.ndarray  # (A, C) [m]: sum of both banks' paths to them, and the second's less the first's
    apart: np.ndarray  # (A, C) [m]: sum of both banks' paths to them, and the second's less the first's

    @classmethod
    def at(cls, image: xr.Dataset, paths: ArrayPaths, banks: tuple[int, int]) -> _Heard:
        across, height = ground_across(image), -image["depth"].values.astype(float)
        middle = 0.5 * paths.sender + 0.25 * (paths.bank[banks[0]] + paths.bank[banks[1]])
        aside, up = across - middle[:, :1], height - middle[:, 1:]
        first, second = (bank_paths(paths, bank, across, height) for bank in banks)
        return cls(paths=paths, banks=banks, middle=middle, turn=np.arctan2(up, aside), away=np.hypot(aside, up),
                   height=height, way=first + second, apart=second - first)

    def place(self, turn: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the points (across, z) in directions from the middle whose paths have the grid's points' sum."""
        sine, cosine, reach = np.sin(turn), np.cos(turn), self.away
        for _ in range(ELLIPSE):                          # the sum grows as fourfold the distance, nearly
            across, height = self.middle[:, :1] + reach * cosine, self.middle[:, 1:] + reach * sine
            reach = reach * self.way / sum(bank_paths(self.paths, bank, across, height) for bank in self.banks)
        return self.middle[:, :1] + reach * cosine, self.middle[:, 1:] + reach * sine

    def difference(self, turn: np.ndarray) -> np.ndarray:
        """Return by how much more the banks' paths differ there than at the grid's points [m]."""
        first, second = (bank_paths(self.paths, bank, *self.place(turn)) for bank in self.banks)
        return second - first - self.apart


def _sound_speed(image: xr.Dataset, given: float | None) -> float:
    value = image.attrs.get("sound_speed") if given is None else given
    if value is None or not (np.isfinite(value) and value > 0):
        raise ValueError(f"the sound speed at the arrays is {value}; give sound_speed in m/s")
    return float(value)
