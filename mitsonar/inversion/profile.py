"""The sound-speed profile from times of soundings: Gauss-Newton, the bed and the array's roll being unknown, too.

    Φ = Σ_i ρ((t_i - T_i(c, b, ρ)) / σ) + (c - c_0)ᵀ C⁻¹ (c - c_0) + (c_h(z_h) - c_head)² / σ_h² + bᵀ B b + ρ² / σ_ρ²

c -> speeds at the profile's nodes, C and B of `profile_priors`, ρ(.) -> Huber's, T -> `gradients.sounding_times`. A
profile has few unknowns and a bed many, each touched by few soundings: the bed is eliminated (S below), and the rest is
dense. With A and D the blocks of the speeds and of the bed in the normal matrix, E between them,

    S = A - E D⁻¹ Eᵀ,      covariance S⁻¹,      singular values² = eigenvalues of Lᵀ (S - C⁻¹) L,   C = L Lᵀ

A beam that comes down once tells nothing of the water: depth and speed trade places. The same bed is to be seen at
several angles: from lines that overlap, or cross.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import xarray as xr

from ..gradients.sounding_bed import BedGrid
from ..hydrography.sounding_beams import SoundingBeams, beams_of
from ..water import SoundSpeedProfile
from .profile_answer import ProfileFit
from .profile_bed import laid_bed
from .profile_priors import ProfilePrior
from .profile_problem import ProfileProblem

__all__ = ["fit_profile"]

MOST_KNOWN = 250_000               # nodes of a given bed
RIVAL_STEPS = 10
RIVAL = 1.2                        # times the misfit of the answer, up to which another fits as well


def fit_profile(soundings: xr.Dataset | SoundingBeams, start: SoundSpeedProfile, *, noise: float = 20e-6,
                prior: ProfilePrior | None = None, bed: BedGrid | None = None, cell: float | None = None,
                under_way: bool = True, iterations: int = 30,
                progress: Callable[[int, float], None] | None = None) -> ProfileFit:
    """Fit a sound-speed profile to the times of soundings.

    Parameters
    ----------
    soundings : xarray.Dataset or SoundingBeams
        A line or lines, simulated or read from a file.
    start : SoundSpeedProfile
        Its nodes are the unknowns; its speeds, what is believed before.
    noise : float [s]
        Standard deviation of two-way times. Where the times cannot be met to this, what they are met to takes its
        place.
    prior : ProfilePrior or None
    bed : BedGrid or None
        What is known of the bed, to ``prior.bed_deviation``; None: the bed is unknown.
    cell : float [m] or None
        Distance of the nodes of an unknown bed; None: as many nodes as the soundings allow.
    under_way : bool
        Whether the line's places count the way of the platform while an echo comes in (`beams_of`).
    iterations : int
        At most.
    progress : function of iteration and misfit [s], or None
        Called after each iteration.

    Returns
    -------
    ProfileFit
        Whose ``verdict`` says what could be seen, and whose ``profile`` refuses where that is no profile.

    Raises
    ------
    ValueError
        If the soundings, the noise or the cell are none, or beams do not reach the bed in the start's water.
    """
    if not (np.isfinite(noise) and noise > 0):
        raise ValueError(f"fit of a profile: noise is {noise:g} s; give the times' standard deviation, above zero.")
    if not iterations >= 1:
        raise ValueError(f"fit of a profile: iterations is {iterations}; at least one is needed.")
    if bed is not None and bed.depth.size > MOST_KNOWN:
        raise ValueError(f"fit of a profile: a bed of {bed.depth.size} nodes is more than {MOST_KNOWN}; thin it out.")
    beams = soundings if isinstance(soundings, SoundingBeams) else beams_of(soundings, under_way)
    prior = ProfilePrior() if prior is None else prior
    known = bed is not None
    bed = laid_bed(beams, start, prior, cell) if bed is None else bed
    problem = ProfileProblem(beams, start, bed, prior, known)
    fit = problem.fitted(noise, iterations, progress)
    return fit if fit.is_profile or not fit.is_overlapping else _with_rival(fit, beams, bed, prior, known, iterations)


def _with_rival(fit: ProfileFit, beams: SoundingBeams, bed: BedGrid, prior: ProfilePrior, known: bool,
                iterations: int) -> ProfileFit:
    """Fit once more, about the same layers upside down: where the order leaves no trace, that fits as well."""
    top, bottom = fit.head_depth, fit.bed_depths[-1]
    inside = (fit.depth > top) & (fit.depth < bottom)
    over = np.interp(top + bottom - fit.depth, fit.depth, fit.speed)
    mirrored = SoundSpeedProfile(fit.depth, np.where(inside, over, fit.speed))
    try:
        rival = ProfileProblem(beams, mirrored, bed, prior, known).fitted(fit.noise, min(iterations, RIVAL_STEPS), None)
    except ValueError:                                 # beams that do not come down through such water
        return fit
    apart = abs(rival.column_mean - fit.column_mean) if rival.misfit[-1] < RIVAL * fit.misfit[-1] else 0.0
    return replace(fit, rival=rival.speed, rival_misfit=float(rival.misfit[-1]),
                   column_mean_deviation=float(np.hypot(fit.column_mean_deviation, apart)))
