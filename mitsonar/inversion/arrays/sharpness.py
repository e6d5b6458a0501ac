"""Estimate the sway of a synthetic aperture, ping by ping, from the sharpness of its image or from point targets.

    L(s) = -ln(⟨|I|⁴⟩ / ⟨|I|²⟩²),   ∂L/∂s_p = -Σ θ_p Im(g* A_p e^(iθ_p s_p)),   g = 4 (1/⟨|I|²⟩ - |I|²/⟨|I|⁴⟩) I / N

Symbols are those of `ping_images`. L falls as an image gets sharper. A common sway, or one that grows along the strip,
cannot be separated from a shift of the scene or a squint. The answer therefore has no mean and no trend of sway. Sway
at a ping is determined modulo half a wavelength, and taken to change by less than a quarter of one
from ping to ping. A scene of speckle alone is as sharp with any sway.

References
----------
Callow (2003), Signal processing for synthetic aperture sonar image enhancement, ch. 6; Muller and Buffington (1974), J.
Opt. Soc. Am. 64, 1200.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.synthetic_aperture.focusing.grids import Grid

from .ping_images import PingImages, moved

ITERATIONS = 80                    # of each stage
SCALE = 2e-3                       # [m] of the unknowns
STEP = 2e-5                        # [m] of differences of the gradient
LEAST_GAIN = 0.02                  # of L, below which an image is no sharper than before
CONTRAST = 3.0                     # <|I|^4>/<|I|^2>^2 of speckle is 2


@dataclass(frozen=True, kw_only=True, eq=False)
class Sway:
    """Sway of pings.

    Attributes
    ----------
    sway : (P,) [m]
        Displacement of the sonar to starboard of the assumed trajectory, without mean and trend.
    uncertainty : (P,) [m]
        Half the difference of the sways of two halves of the scene, rms over neighbouring pings.
    contrast : (float, float)
        ⟨|I|⁴⟩ / ⟨|I|²⟩² before and after; it is 2 for speckle.
    curvature : (P,) [1/m²]
        Eigenvalues of L's second derivative at the answer, falling.
    patterns : (P, P)
        Sways of these eigenvalues, one a row.
    half_wavelength : float [m]
        Sways of single pings are determined modulo this length.
    before, after : complex64 (along_track, across_track)
        Images with the assumed trajectory, and with the sway.
    trajectory : Dataset
        Trajectory with the sway.
    """

    sway: np.ndarray
    uncertainty: np.ndarray
    contrast: tuple[float, float]
    curvature: np.ndarray
    patterns: np.ndarray
    half_wavelength: float
    before: np.ndarray
    after: np.ndarray
    trajectory: xr.Dataset

    @property
    def null_share(self) -> tuple[float, float]:
        """Shares of a common shift, and of a trend, in directions of less than a thousandth of the curvature."""
        count = len(self.sway)
        flat = self.patterns[np.abs(self.curvature) < 1e-3 * self.curvature[0]]
        parts = np.stack([np.ones(count), np.linspace(-1, 1, count)])
        parts /= np.linalg.norm(parts, axis=1, keepdims=True)
        shift, trend = (float(np.sum((flat @ part) ** 2)) for part in parts)
        return shift, trend

    def sentences(self) -> list[str]:
        """Return sentences about what the data determined."""
        said = ["Mean and trend of the sway are not observable by sharpness: they shift and turn the image; and single "
                f"pings are told modulo {1e3 * self.half_wavelength:.3g} mm. Navigation needs a second source."]
        if np.log(self.contrast[1] / self.contrast[0]) < LEAST_GAIN:
            said.append(f"The image is no sharper than before ({self.contrast[0]:.2f} to {self.contrast[1]:.2f}): "
                        "nothing was found, or there was nothing to find.")
        if self.contrast[1] < CONTRAST:
            said.append(f"Its contrast is {self.contrast[1]:.2f}, and speckle's is 2: a scene without bright points "
                        "hardly tells sway.")
        return said

    def to_dataset(self) -> xr.Dataset:
        """Return sway by the names of `Fit.to_dataset`, and the trajectory with it, for `focus`."""
        metres, still = {"units": "m"}, np.zeros(len(self.sway))
        found = xr.Dataset({"sway": ("ping", self.sway, metres), "sway_start": ("ping", still, metres),
                            "sway_deviation": ("ping", self.uncertainty, metres),
                            "curvature": ("pattern", self.curvature, {"units": "1/m^2"}),
                            "pattern": (("pattern", "ping"), self.patterns, {"units": "1"})})
        motion = [name for name in self.trajectory.variables if str(name).startswith("motion_")]
        return found.merge(self.trajectory[motion].drop_attrs()).assign_attrs(
            kind="fit", parameters=["sway"], observable=" ".join(self.sentences()), contrast=list(self.contrast),
            half_wavelength=self.half_wavelength)


def sharpness(pings: PingImages, sway: np.ndarray) -> tuple[float, np.ndarray]:
    """Return L and its gradient (P,) [1/m] at a sway (P,) [m]."""
    turned = pings.turned(sway)
    image = turned.sum(0)
    power = np.abs(image) ** 2
    mean, square = float(power.mean(dtype=float)), float(np.mean(power.astype(float) ** 2))
    weight = (4 / len(power) * (1 / mean - power / square)) * image
    gradient = -np.sum(pings.rates * (np.conj(weight) * turned).imag, 1, dtype=float)
    return -float(np.log(square / mean ** 2)), gradient


def without_trend(sway: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Remove mean and trend (along the strip) from a sway (..., P)."""
    line = np.linalg.qr(np.stack([np.ones(len(along)), along], 1))[0]
    return sway - (sway @ line) @ line.T


def sharpened(raw: xr.Dataset, grid: Grid | None = None, *, trajectory: xr.Dataset | None = None,
              correlation: float = 3.0, rounds: int = 3, say: Callable[[str], None] | None = None,
              **how: Any) -> Sway:
    """Find the sway that makes an image sharpest.

    Parameters
    ----------
    raw : Dataset
        Raw echoes; a part of a strip about as long as its aperture, with bright points.
    grid : Grid or None
        Points whose sharpness counts.
    trajectory : Dataset or None
        Assumed trajectory; None: the record's own.
    correlation : float [pings]
        Length over which sway is expected to be alike, at first; then each ping is free.
    rounds : int
        Number of times that images are made anew with the sway.
    say : callable(text) or None
        Called with a text in each round.
    **how
        Options of `synthetic_aperture.focusing.focus`: profile, windows, aperture; without a window over the aperture.

    Returns
    -------
    Sway

    Raises
    ------
    ValueError
        See `PingImages.of`; or if correlation or rounds are below 0 or 1.
    """
    if not (np.isfinite(correlation) and correlation >= 0):
        raise ValueError(f"correlation is {correlation} pings; give a number of at least 0")
    if rounds < 1:
        raise ValueError(f"{rounds} rounds are too few; give at least 1")
    how = {"window": None, **how}              # pings at the ends of an aperture count as well
    believed = raw if trajectory is None else trajectory
    first: PingImages | None = None
    pings: PingImages | None = None
    total = np.zeros(raw.sizes["ping"])
    for number in range(rounds):
        now = believed if number == 0 else moved(believed, _times(raw), total)
        pings = PingImages.of(raw, grid, now, **how)
        first, grid = first or pings, pings.grid
        total = total + _sharpest(pings, correlation if number == 0 else 0.0)
        # the same image, and a sway that changes less from ping to ping
        total = without_trend(np.unwrap(total, period=pings.period), pings.along)
        if say is not None:
            say(f"round {number + 1}: contrast {np.exp(-sharpness(first, total)[0]):.2f}")
    assert first is not None and pings is not None
    final = PingImages.of(raw, grid, moved(believed, _times(raw), total), **how)
    still = np.zeros(len(total))
    contrasts = [float(np.exp(-sharpness(images, still)[0])) for images in (first, final)]
    curvature, patterns = _curvature(final)
    return Sway(sway=without_trend(total, final.along), uncertainty=_doubt(final), curvature=curvature,
                contrast=(contrasts[0], contrasts[1]), patterns=patterns, half_wavelength=final.period,
                before=first.image(still), after=final.image(still), trajectory=moved(believed, _times(raw), total))


def sway_of_targets(pings: PingImages, targets: np.ndarray) -> np.ndarray:
    """Return the sway (P,) [m] from the phases of point targets, without mean and trend.

    Phases are unwrapped from ping to ping: sway must change by less than an eighth of a wavelength between them, level
    and abreast. A target off its pixel adds a trend, which is taken out, and a bend that is small where it is near.
    """
    # targets (K, 2)
    where = np.ravel_multi_index(tuple(np.asarray(targets, int).T), pings.grid.depth.shape)
    index = np.searchsorted(pings.points, where)
    index = np.minimum(index, len(pings.points) - 1)
    if not np.all(pings.points[index] == where):
        raise ValueError(f"target {int(np.argmax(pings.points[index] != where))} lies where no ping sees the grid; "
                         "give rows and columns of bright points")
    values, rates = pings.images[:, index], pings.rates[:, index].astype(float)
    phase = -np.unwrap(np.angle(values), axis=0)
    # each target has a phase of its own, and one that grows along the strip as it is off its pixel
    phase = without_trend(phase.T, pings.along).T
    weight = np.abs(values) ** 2
    told = np.sum(weight * rates ** 2, 1)
    if not np.all(told > 0):
        raise ValueError(f"ping {int(np.argmin(told))} sees none of the targets; leave such pings out, or give targets "
                         "that all of them see")
    return without_trend(np.sum(weight * rates * phase, 1) / told, pings.along)


def _times(raw: xr.Dataset) -> np.ndarray:
    return np.asarray(raw["ping_time"].values, float)


def _sharpest(pings: PingImages, correlation: float, start: np.ndarray | None = None) -> np.ndarray:
    """Return the sway of the least L: smooth over some pings first, then free; without mean and trend."""
    from scipy.optimize import minimize
    count = len(pings.time)
    sway = np.zeros(count) if start is None else start
    apart = np.arange(count)[:, None] - np.arange(count)
    bases = [np.exp(-0.5 * (apart / correlation) ** 2)] if correlation else []
    for base in (*bases, np.eye(count)):
        base = without_trend(base.T, pings.along).T

        def misfit(unknown: np.ndarray, begin: np.ndarray = sway, base: np.ndarray = base) -> tuple[float, np.ndarray]:
            value, gradient = sharpness(pings, begin + SCALE * base @ unknown)
            return value, SCALE * base.T @ gradient

        answer = minimize(misfit, np.zeros(count), jac=True, method="L-BFGS-B", options={"maxiter": ITERATIONS})
        sway = sway + SCALE * base @ answer.x
    return without_trend(sway, pings.along)


def _curvature(pings: PingImages) -> tuple[np.ndarray, np.ndarray]:
    """Return eigenvalues of L's second derivative, falling, and their sways, one a row."""
    steps = STEP * np.eye(len(pings.time))
    second = np.stack([(sharpness(pings, step)[1] - sharpness(pings, -step)[1]) / (2 * STEP) for step in steps])
    values, vectors = np.linalg.eigh(0.5 * (second + second.T))
    return values[::-1], vectors[:, ::-1].T


def _doubt(pings: PingImages) -> np.ndarray:
    """Return half the difference of the sways of two halves of the scene, in range, rms over neighbouring pings."""
    column = pings.points % pings.grid.depth.shape[1]
    power = np.abs(pings.images.sum(0)) ** 2
    order = np.argsort(column, kind="stable")
    shared = np.cumsum(power[order])
    middle = column[order][np.searchsorted(shared, 0.5 * shared[-1])]
    near, far = (pings.part(np.flatnonzero(chosen)) for chosen in (column < middle, column >= middle))
    if not (len(near.points) and len(far.points)):
        return np.full(len(pings.time), np.nan)
    half = 0.5 * (_sharpest(near, 0.0) - _sharpest(far, 0.0))
    kernel = np.ones(min(5, len(half)))
    return np.sqrt(np.convolve(half ** 2, kernel, "same") / np.convolve(np.ones(len(half)), kernel, "same"))
