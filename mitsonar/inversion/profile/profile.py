"""Sound-speed profile from the times of soundings, with unknown bed and unknown roll offset of the array.

    Φ = Σ_i ρ((t_i - T_i(c, b, ρ)) / σ) + (c - c_0)ᵀ C⁻¹ (c - c_0) + (c_h(z_h) - c_head)² / σ_h² + bᵀ B b + ρ² / σ_ρ²

c -> speeds at the profile's nodes; C and B -> priors (`profile_problem`); ρ(.) -> Huber's loss; T ->
`gradients.sounding_times`. A profile has few unknowns and a bed many, each of which affects few soundings. The bed is
therefore eliminated (S below), and steps of the other unknowns are those of SciPy's trust region (`steps`). With A and
D the blocks of the speeds and of the bed in the normal matrix, and E between them,

    S = A - E D⁻¹ Eᵀ,      covariance S⁻¹,      singular values² = eigenvalues of Lᵀ (S - C⁻¹) L,   C = L Lᵀ

A single beam does not determine the water, because an error of depth compensates an error of speed. The same bed must
be seen at several angles, from lines that overlap or cross.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.gradients.soundings.sounding_bed import BedGrid
from mitsonar.hydrography.detection.sounding_beams import SoundingBeams, beams_of, beams_of_lines
from mitsonar.hydrography.record import joined
from mitsonar.hydrography.reduction.legs import Starts
from mitsonar.hydrography.reduction.resounding import profile_of
from mitsonar.io import survey_lines
from mitsonar.water.profile import SoundSpeedProfile

from .profile_answer import ProfileFit
from .profile_problem import ProfilePrior, ProfileProblem, bed_precision

PER_NODE = 6                       # soundings to a node
MOST_ALONG, MOST_NODES = 60, 2500


def laid_bed(beams: SoundingBeams, profile: SoundSpeedProfile, prior: ProfilePrior, cell: float | None) -> BedGrid:
    """Lay a grid where the soundings are in the start's water, and the bed through them."""
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    if cell is not None and not (np.isfinite(cell) and cell > 0):
        raise ValueError(f"fit of a profile: cell is {cell:g} m; give a distance above zero.")
    starts = Starts(profile=profile, depth=beams.depth)
    depth = starts.depth_after(beams.slowness, beams.travel_time / 2)
    some = np.isfinite(depth) & (depth > beams.depth)
    if not some.all():
        raise ValueError(f"fit of a profile: {some.size - some.sum()} of {some.size} beams turn back in the start's "
                         "water before they reach the bed; start with other water, or leave those beams out.")
    leg = starts.to_depth(beams.slowness, depth)
    x, y = beams.x + beams.east * beams.slowness * leg.stretch, beams.y + beams.north * beams.slowness * leg.stretch
    width, height = np.ptp(x), np.ptp(y)
    if cell is not None:
        step = cell
    else:
        share = np.sqrt(max(width * height, width, height) * PER_NODE / len(x))
        step = float(max(share, max(width, height) / MOST_ALONG, np.sqrt(width * height / (0.8 * MOST_NODES)), 0.1))
    counts = [int(np.ceil(side / step)) + 1 for side in (width, height)]
    if np.prod(counts) > MOST_NODES:
        raise ValueError(f"fit of a profile: a bed of {counts[0]} by {counts[1]} nodes {step:g} m apart is more than "
                         f"{MOST_NODES}; take larger cells, or a part of the soundings.")
    nodes = [side.min() + step * (np.arange(count) - (count - 1) / 2) + np.ptp(side) / 2
             for side, count in ((x, counts[0]), (y, counts[1]))]
    bed = BedGrid(x=nodes[0], y=nodes[1], depth=np.full((counts[1], counts[0]), depth.mean()))
    shares = bed.shares(x, y)
    rows = sparse.csc_array((shares.share.ravel(), (np.repeat(np.arange(len(x)), 4), shares.node.ravel())),
                            shape=(len(x), bed.depth.size))
    fitted = spsolve((rows.T @ rows + bed_precision(bed, prior, False)).tocsc(), rows.T @ (depth - depth.mean()))
    return BedGrid(x=bed.x, y=bed.y, depth=depth.mean() + fitted.reshape(bed.depth.shape))


MOST_KNOWN = 250_000               # nodes of a given bed
RIVAL_STEPS = 10
RIVAL = 1.2                        # times the misfit of the answer, up to which another fits as well


def fit_profile(soundings: xr.Dataset | SoundingBeams, start: SoundSpeedProfile, *, noise: float = 20e-6,
                prior: ProfilePrior | None = None, bed: BedGrid | None = None, cell: float | None = None,
                under_way: bool = True, iterations: int = 30,
                progress: Callable[[int, float], object] | None = None) -> ProfileFit:
    """Fit a sound-speed profile to the times of soundings.

    Parameters
    ----------
    soundings : xarray.Dataset or SoundingBeams
        One line or several, simulated or read from a file.
    start : SoundSpeedProfile
        Profile whose nodes are the unknowns and whose speeds are their prior means.
    noise : float [s]
        Standard deviation of two-way times; replaced by the actual misfit if that is larger.
    prior : ProfilePrior or None
        Prior deviations.
    bed : BedGrid or None
        Known bed, to within ``prior.bed_deviation``; None: the bed is unknown.
    cell : float [m] or None
        Node distance of an unknown bed; None: as many nodes as the soundings allow.
    under_way : bool
        If True, the line's places include the motion of the platform during reception (`beams_of`).
    iterations : int
        Greatest number of iterations.
    progress : function of iteration and misfit [s], or None
        Called after each iteration.

    Returns
    -------
    ProfileFit
        Answer, whose ``verdict`` describes what was observable; its ``profile`` raises an error if nothing was.

    Raises
    ------
    ValueError
        If soundings, noise or cell are invalid, or beams do not reach the bed in the start's water.
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


MOST = 40_000                      # soundings that a fit takes
NEARLY_LEVEL = 0.99                # cosine of the grazing angle, where sound is fastest, that leaves a beam out


def fit_lines(paths: Sequence[FilePath], start: SoundSpeedProfile | None = None, *, nodes: int = 12,
              noise: float = 20e-6, deviation: float = 10.0, length: float | None = None, cell: float | None = None,
              under_way: bool = False, iterations: int = 30,
              progress: Callable[[int, float], object] | None = None) -> ProfileFit:
    """Fit a profile to lines of soundings in files.

    Parameters
    ----------
    paths : sequence of path
        Files .nc of mitsonar, .all, .kmall, .gsf, .s7k, .xtf or .hsx; lines that overlap or cross.
    start : SoundSpeedProfile or None
        Prior mean of the water; None: the cast of the first line.
    nodes : int
        Number of nodes, evenly spaced from the head down to the deepest sounding.
    noise, cell, iterations, progress
        Arguments as in `fit_profile`.
    deviation : float [m/s]
        Prior deviation of the speeds.
    length : float [m] or None
        Correlation length in depth; None: a sixth of the depth.
    under_way : bool
        As in `beams_of`: False for instruments that leave out the motion of the ship during reception.

    Returns
    -------
    ProfileFit

    Raises
    ------
    FileNotFoundError
        If a file does not exist.
    ValueError
        If a file is not a line of soundings, nodes are fewer than two, or as in `fit_profile`.

    Notes
    -----
    Of more than 40,000 soundings every second, third, ... is used. Beams that would be nearly level anywhere in the
    start's water are left out.
    """
    lines = [joined(survey_lines.read_blocks(path, column=False)) for path in paths]
    beams = beams_of_lines(lines, under_way)
    beams = beams[::-(-len(beams) // MOST)]
    deepest = max(float(line["depth"].where(line["valid"]).max()) for line in lines)
    begin = nodes_over(profile_of(lines[0]) if start is None else start, float(np.median(beams.depth)), deepest, nodes,
                       float(np.median(beams.head_speed)))
    beams = beams[beams.slowness * begin.sound_speed.max() < NEARLY_LEVEL]
    prior = ProfilePrior(deviation=deviation, length=max(deepest / 6, 0.1) if length is None else length)
    return fit_profile(beams, begin, noise=noise, prior=prior, cell=cell, iterations=iterations, progress=progress)


def nodes_over(profile: SoundSpeedProfile, head: float, deepest: float, nodes: int,
               head_speed: float) -> SoundSpeedProfile:
    """Return a profile of equal steps from the head down to the deepest sounding, the head's speed at its first node.
    """
    if nodes < 2 or not deepest > head:
        raise ValueError(f"fit of a profile: {nodes} nodes from the head at {head:.1f} m down to {deepest:.1f} m; at "
                         "least two are needed, and soundings below the head.")
    depth = np.linspace(head, deepest, nodes + 1)
    return SoundSpeedProfile(depth, np.r_[head_speed, profile.at(depth[1:])])
