"""All echoes of a ping on a grid of sine and time."""
from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

from ...signal.beam_grid import BeamGrid
from .ping_echoes import PingEchoes
from .record import GridEchoes, TargetEchoes

__all__ = ["LaidPing", "lay"]


@dataclass(frozen=True, kw_only=True, eq=False)
class LaidPing:
    """What of a ping its truth is made from.

    Attributes
    ----------
    scatterers : GridEchoes or None
        None where there are none.
    targets : list of TargetEchoes
    """

    scatterers: GridEchoes | None
    targets: list[TargetEchoes]


def lay(echoes: PingEchoes, grid: BeamGrid, ping: int, seed: int) -> LaidPing:
    """Add a ping's echoes to a grid: scatterers, targets, ghosts, the water."""
    scatterers = echoes.of_scatterers(ping)
    if scatterers is not None:
        _add(grid, scatterers)
    targets = list(echoes.of_targets(ping))
    for target in targets:
        _add(grid, target.echoes)
    for some in chain(echoes.mirrored(ping), echoes.by_chance(ping, seed)):
        _add(grid, some)
    return LaidPing(scatterers=scatterers, targets=targets)


def _add(grid: BeamGrid, echoes: GridEchoes) -> None:
    grid.add(column=echoes.column, sine=echoes.sine, real=echoes.real, imaginary=echoes.imaginary)
