"""The sound-speed profile from lines of soundings in files."""
from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..hydrography.record import joined
from ..hydrography.resounding import profile_of
from ..hydrography.sounding_beams import beams_of_lines
from ..io import survey_lines
from ..io.files import FilePath
from ..water import SoundSpeedProfile
from .profile import fit_profile
from .profile_answer import ProfileFit
from .profile_priors import ProfilePrior

__all__ = ["fit_lines", "nodes_over"]

MOST = 40_000                      # soundings that a fit takes
NEARLY_LEVEL = 0.99                # cosine of the grazing angle, where sound is fastest, that leaves a beam out


def fit_lines(paths: Sequence[FilePath], start: SoundSpeedProfile | None = None, *, nodes: int = 12,
              noise: float = 20e-6, deviation: float = 10.0, length: float | None = None, cell: float | None = None,
              under_way: bool = False, iterations: int = 30,
              progress: Callable[[int, float], None] | None = None) -> ProfileFit:
    """Fit a profile to lines of soundings in files.

    Parameters
    ----------
    paths : sequence of path
        .nc as mitsonar writes it, .all, .kmall or .gsf; lines that overlap or cross.
    start : SoundSpeedProfile or None
        What is believed of the water; None: the cast of the first line.
    nodes : int
        From the head down to the deepest sounding, as many steps.
    noise, cell, iterations, progress
        As of `fit_profile`.
    deviation : float [m/s]
        Of what is believed.
    length : float [m] or None
        In depth, over which speeds belong together; None: a sixth of the depth.
    under_way : bool
        As of `beams_of`: instruments leave the way of the ship while echoes come in out.

    Returns
    -------
    ProfileFit

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a file is no line of soundings, nodes are fewer than two, or as of `fit_profile`.

    Notes
    -----
    Of more than 40,000 soundings every second, third, ... is taken. Beams that would be nearly level somewhere in the
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
    """Give a profile of equal steps from the head down to the deepest sounding, the head's speed at its first node.

    Raises
    ------
    ValueError
        If there are fewer than two steps, or no sounding lies below the head.
    """
    if nodes < 2 or not deepest > head:
        raise ValueError(f"fit of a profile: {nodes} nodes from the head at {head:.1f} m down to {deepest:.1f} m; at "
                         "least two are needed, and soundings below the head.")
    depth = np.linspace(head, deepest, nodes + 1)
    return SoundSpeedProfile(depth, np.r_[head_speed, profile.at(depth[1:])])
