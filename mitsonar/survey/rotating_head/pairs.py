"""Which echoes which pings of a rotating head hear: those about the bearing it looks in.

The envelope of a sinc's side lobes is 1 / (πx), x = u L / λ, so that of the two-way intensity is 1 / (πx)⁴; what lies
at larger cosines u to the beam's side than `StepBeam.reach` is left out. A cosine is u = cos ε sin Δ, ε the elevation
off the plane that the head turns in and Δ the bearing from its own, so echoes are sorted by bearing in classes of ε.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import upload
from .echoes import HeadEchoes

__all__ = ["Pairs", "SortedEchoes"]

STEEPEST = (25.0, 50.0, 90.0)      # [degrees] elevations that the classes end at
AT_ONCE = 1 << 22                  # pairs of ping and echo


@dataclass(frozen=True, kw_only=True, eq=False)
class Pairs:
    """Echoes and the pings of a block that hear them.

    Attributes
    ----------
    echoes : HeadEchoes
    row : UInt32 (N,)
        Number of the ping in the block.
    index : UInt32 (N,)
        Of the echo.
    active : Bool (N,)
    """

    echoes: HeadEchoes
    row: mi.UInt32
    index: mi.UInt32
    active: mi.Bool

    @classmethod
    def all_of(cls, echoes: HeadEchoes, row: int) -> Pairs:
        """Let one ping hear all echoes."""
        count = echoes.count
        return cls(echoes=echoes, row=dr.full(mi.UInt32, row, count), index=dr.arange(mi.UInt32, count),
                   active=dr.full(mi.Bool, True, count))


class SortedEchoes:
    """Echoes around a head that stands still, sorted by bearing.

    Parameters
    ----------
    frame : (3, 3)
        Columns: bearing 0, aside, and the axis that the head turns about; scene coordinates.
    echoes : sequence of HeadEchoes
    reach : float [-]
        Cosine to the beam's side beyond which echoes are left out.
    """

    def __init__(self, frame: np.ndarray, echoes: Sequence[HeadEchoes], reach: float):
        self._frame, self._parts = frame, []
        for some in echoes:
            towards = np.stack([column.numpy() for column in some.sent], -1) @ frame
            bearing = np.arctan2(towards[:, 1], towards[:, 0])
            steepness = np.rad2deg(np.arcsin(np.minimum(np.abs(towards[:, 2]), 1)))
            low = -1.0
            for high in STEEPEST:
                mine = np.flatnonzero((steepness > low) & (steepness <= high)).astype(np.uint32)
                low, cosine = high, np.cos(np.deg2rad(high))
                if len(mine):
                    mine = mine[np.argsort(bearing[mine], kind="stable")]
                    half = np.arcsin(reach / cosine) if reach < cosine else np.pi
                    self._parts.append((some, upload(mi.UInt32, mine), bearing[mine], half))

    def heard(self, looks: np.ndarray) -> Iterator[Pairs]:
        """Yield what pings hear that look along unit vectors (P, 3)."""
        towards = looks @ self._frame
        bearing = np.arctan2(towards[:, 1], towards[:, 0])
        for echoes, order, sorted_bearing, half in self._parts:
            total = len(sorted_bearing)
            first, count = np.zeros(len(bearing), np.int64), np.full(len(bearing), total)
            if half < np.pi:
                three = np.concatenate([sorted_bearing - 2 * np.pi, sorted_bearing, sorted_bearing + 2 * np.pi])
                first = np.searchsorted(three, bearing - half)
                count = np.minimum(np.searchsorted(three, bearing + half) - first, total)
            width = int(count.max())
            if not width:
                continue
            rows = max(1, AT_ONCE // width)
            for start in range(0, len(bearing), rows):
                some = slice(start, start + rows)
                yield self._chosen(echoes, order, start, first[some] % total, count[some], width, total)

    def _chosen(self, echoes: HeadEchoes, order: mi.UInt32, start: int, first: np.ndarray, count: np.ndarray,
                width: int, total: int) -> Pairs:
        """Pairs of some pings, each with as many lanes as the one with the most echoes."""
        lane, wide = dr.arange(mi.UInt32, len(first) * width), dr.opaque(mi.UInt32, width)
        row = lane // wide
        place = lane - row * wide
        begin, end = (dr.gather(mi.UInt32, upload(mi.UInt32, part.astype(np.uint32)), row) for part in (first, count))
        active, place = place < end, begin + place
        all_of_them = dr.opaque(mi.UInt32, total)
        place = dr.select(place >= all_of_them, place - all_of_them, place)
        return Pairs(echoes=echoes, row=row + dr.opaque(mi.UInt32, start), index=dr.gather(mi.UInt32, order, place),
                     active=active)
