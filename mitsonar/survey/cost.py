"""How much there is to do for an array's pings, and how long it will take: a sentence to be said before it starts.

    t = pings x (sources c N + pairs (e + r R) E) / threads

N cells within reach of a ping (or rays of a source, where rays light them), E echoes of them, R receive elements; a
pair is a transmit element and a source that stands for it. c, e and r are CPU seconds measured with the scene
forward_looking and 4 to 64 elements; other machines and scenes take half or twice as long.
"""
from dataclasses import dataclass, replace

import numpy as np

from .pressure import KEPT_ECHOES

__all__ = ["Cost", "cost", "sentence"]

CONNECTED, RETURNED, CARRIED = 1.8e-7, 3e-7, 1.15e-8     # [s] of CPU: a cell; an echo; an echo to an element,
SOLVED = 6e-7                      # the same by an eigenray
LIT_SHARE = 0.6                    # of the cells within reach that echo
PINGS_LOOKED_AT = 3
COARSER = 2.0                      # times as long cells, to say what they would save
WORTH_SAYING = 2.0                 # [s] of CPU; less is a moment


@dataclass(frozen=True, kw_only=True)
class Cost:
    """What pings of an array take.

    Attributes
    ----------
    pings, elements : int
        How many; receivers.
    cells : float
        That each source of a ping lights: cells within reach, or where rays light them, rays.
    lightings, pairs : int
        How often that is done for a ping, and how often echoes are carried to all elements.
    threads : int
    carried : float [s]
        CPU time from an echo to an element.
    """

    pings: int
    elements: int
    cells: float
    lightings: int
    pairs: int
    threads: int
    carried: float = CARRIED

    @property
    def seconds(self):
        """About so long, without loading and compiling."""
        echoes = LIT_SHARE * self.cells
        each = self.lightings * CONNECTED * self.cells + self.pairs * (RETURNED + self.carried * self.elements) * echoes
        return self.pings * each / self.threads


def cost(survey, pings, *, threads, return_path="vector", all_transmit=False):
    """Count what some pings of a survey take.

    Parameters
    ----------
    survey : ArraySurvey
    pings : sequence of int
    threads : int
    return_path : str
        As of `mitsonar.element_signals`.
    all_transmit : bool
        Every transmit element, not only those that send.

    Returns
    -------
    Cost
    """
    share = survey.fans.share[:, (survey.transmit.weight != 0) | all_transmit]
    some = [pings[k] for k in sorted({round(k) for k in np.linspace(0, len(pings) - 1, PINGS_LOOKED_AT)})]
    by_rays = survey.lighting == "rays"
    cells = float(survey.rays) if by_rays else float(np.mean([survey.cells_within_reach(ping) for ping in some]))
    pairs, sources = np.count_nonzero(share), np.count_nonzero(share.any(1))
    kept = LIT_SHARE * cells * sources <= KEPT_ECHOES
    return Cost(pings=len(pings), elements=survey.receive.elements, cells=cells, pairs=int(pairs),
                lightings=int(sources if kept else pairs), threads=threads,
                carried=SOLVED if return_path == "eigenray" else CARRIED)


def sentence(survey, pings, **how):
    """Say what `cost` counts, how long it will take, and what would be faster; empty for what takes a moment."""
    now = cost(survey, pings, **how)
    if now.seconds * now.threads < WORTH_SAYING:
        return ""
    many = f"{now.pings} ping{'s' * (now.pings != 1)} to {now.elements} element{'s' * (now.elements != 1)}"
    if survey.lighting == "rays":
        return f"{many}, cells lit by {now.cells:.3g} rays: {_lasting(now.seconds)}; fewer rays are faster"
    coarser = replace(now, cells=now.cells / COARSER ** 2)
    by_rays = replace(now, cells=min(float(survey.rays), now.cells))
    cells = f"{_count(now.cells)} cells of {100 * survey.cell_size:.3g} cm within reach"
    return (f"{many}, {cells}: {_lasting(now.seconds)}; faster: a shorter range, or coarser with cell "
            f"{COARSER * survey.cell_size:.3g} ({_lasting(coarser.seconds)}) or lighting rays "
            f"({_lasting(by_rays.seconds)})")


def _count(number):
    for size, word in ((1e9, "billion"), (1e6, "million")):
        if number >= size:
            return f"{number / size:.2g} {word}" if number < 100 * size else f"{number / size:.0f} {word}"
    return f"{number:.0f}"


def _lasting(seconds):
    """A duration in words, about."""
    if seconds < 1:
        return "under 1 s"
    for length, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * length:
            return f"about {seconds / length:.2g} {unit}" if seconds < 100 * length else (
                f"about {seconds / length:.0f} {unit}")
    return f"about {seconds:.0f} s"
