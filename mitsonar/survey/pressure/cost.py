"""Estimated computing time for an array's pings, and a sentence that states it before the work starts.

    t = pings x (ensonifications c N + pairs (e + r R) E) / threads

N -> cells within reach of a ping, or the rays of a source if rays find the cells; E -> their echoes; R -> receive
elements. A pair is a transmit element and a source of rays that represents it. c, e and r are CPU seconds measured
with the scene forward_looking and 4 to 64 elements; other machines and scenes take half or twice as long.
"""
from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .ensonified_ping import KEPT_ECHOES
from .pressure import PressureRecord

CONNECTED = 1e-7                   # [s] CPU time c to connect a cell
RETURNED = 1e-7                    # [s] CPU time e to carry an echo back to the array's centre
CARRIED, SOLVED = 3.5e-9, 6e-7     # [s] CPU time r on to an element: by the vector approximation, by an eigenray
ECHOING_SHARE = 0.6                # share of the cells within reach that give an echo
PINGS_LOOKED_AT = 3
COARSER = 2.0                      # factor on the cell size for which the sentence states the time saved
WORTH_SAYING = 2.0                 # [s] CPU time below which the sentence is empty


@dataclass(frozen=True, kw_only=True)
class RunCost:
    """Work for the pings of an array."""

    pings: int
    elements: int  # receive elements
    cells: float  # cells that each source of a ping ensonifies
    ensonifications: int  # of a ping
    pairs: int  # of a ping; each carries the echoes to all elements
    threads: int
    carried: float = CARRIED  # [s], CPU time from an echo to an element

    @property
    def seconds(self) -> float:
        """Return the estimated wall time [s], without loading and compiling."""
        connecting = self.ensonifications * CONNECTED * self.cells
        carrying = self.pairs * (RETURNED + self.carried * self.elements) * ECHOING_SHARE * self.cells
        return self.pings * (connecting + carrying) / self.threads


def cells_within_reach(record: PressureRecord, ping: int) -> int:
    """Return the number of cells within reach of a ping."""
    return sum(int(pieces.cells.sum())
               for _, pieces in record.ensonification(ping).pieces(record.survey.track.position[ping]))


def cost(record: PressureRecord, pings: Sequence[int], *, threads: int, all_transmit: bool = False) -> RunCost:
    """Return the work for some pings."""
    survey = record.survey
    share = survey.sources.share[:, (survey.transmit.weight != 0) | all_transmit]
    sample = [pings[k] for k in sorted({round(k) for k in np.linspace(0, len(pings) - 1, PINGS_LOOKED_AT)})]
    by_rays = survey.ensonification == "rays"
    cells = float(survey.rays) if by_rays else float(np.mean([cells_within_reach(record, ping) for ping in sample]))
    pairs, sources = np.count_nonzero(share), np.count_nonzero(share.any(1))
    kept = ECHOING_SHARE * cells * sources <= KEPT_ECHOES
    return RunCost(pings=len(pings), elements=survey.receive.elements, cells=cells, pairs=int(pairs),
                   ensonifications=int(sources if kept else pairs), threads=threads,
                   carried=SOLVED if record.return_path == "eigenray" else CARRIED)


def sentence(record: PressureRecord, pings: Sequence[int], *, threads: int, all_transmit: bool = False) -> str:
    """Return a sentence with the work, its time and faster choices; empty if the work takes only a moment."""
    survey, now = record.survey, cost(record, pings, threads=threads, all_transmit=all_transmit)
    if now.seconds * now.threads < WORTH_SAYING:
        return ""
    many = f"{now.pings} ping{'s' * (now.pings != 1)} to {now.elements} element{'s' * (now.elements != 1)}"
    if survey.ensonification == "rays":
        return f"{many}, cells found by {now.cells:.3g} rays: {_duration(now.seconds)}; fewer rays are faster"
    coarser = replace(now, cells=now.cells / COARSER ** 2)
    by_rays = replace(now, cells=min(float(survey.rays), now.cells))
    cells = f"{_number(now.cells)} cells of {100 * survey.cell_size:.3g} cm within reach"
    return (f"{many}, {cells}: {_duration(now.seconds)}; faster: a shorter range, or coarser with cell "
            f"{COARSER * survey.cell_size:.3g} ({_duration(coarser.seconds)}) or ensonification rays "
            f"({_duration(by_rays.seconds)})")


def _number(number: float) -> str:
    """Return a large number in words, rounded."""
    for size, word in ((1e9, "billion"), (1e6, "million")):
        if number >= size:
            return f"{number / size:.2g} {word}" if number < 100 * size else f"{number / size:.0f} {word}"
    return f"{number:.0f}"


def _duration(seconds: float) -> str:
    """Return a duration in words, rounded."""
    if seconds < 1:
        return "under 1 s"
    for length, unit in ((3600, "h"), (60, "min")):
        if seconds >= 2 * length:
            return f"about {seconds / length:.2g} {unit}" if seconds < 100 * length else (
                f"about {seconds / length:.0f} {unit}")
    return f"about {seconds:.0f} s"
