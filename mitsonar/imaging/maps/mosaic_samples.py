"""Samples of the ground that a sidescan's record makes of a mosaic: where they lie, and what they show.

The strip between two pings is sampled in even steps, each half showing its own ping. Where pings are farther apart than
``fill``, each shows its own place alone.
"""
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mitsonar.units import power_from_db

from ..gain import AngleGain, display_gain
from .mosaic_swath import Ground, Swath

__all__ = ["FINEST", "Gain", "LEVELS", "Line", "samples"]

Gain = Literal["seabed", "target", "angle"] | None
LEVELS = ("level", "mean_level")   # whose values are powers
LOUDEST_DB = 300.0                 # [dB re 1 µPa]
WORK = 1 << 19                     # samples at a time
FINEST = 0.6                       # cells between samples: below 1/√2 none is missed


@dataclass(frozen=True, kw_only=True, eq=False)
class Line:
    """Say what of a record is laid out, and what is added to its levels.

    Attributes
    ----------
    swath : Swath
    quantity : str
    gain : {'seabed', 'target', 'angle', None}
        Of levels.
    angles : AngleGain or None
        Of the whole record, for the gain by angle.
    """

    swath: Swath
    quantity: str
    gain: Gain
    angles: AngleGain | None

    @classmethod
    def of(cls, swath: Swath, quantity: str, gain: Gain) -> "Line":
        """Lay out a quantity of a record."""
        by_angle = gain == "angle" and quantity in LEVELS
        return cls(swath=swath, quantity=quantity, gain=gain, angles=AngleGain.of(swath.record) if by_angle else None)

    def values(self, some: slice) -> np.ndarray:
        """Values (K, 2, N) of pings: powers of levels."""
        record = self.swath.record.isel(ping=some)
        values = record[self.quantity].transpose("ping", "side", "range").values
        if self.quantity not in LEVELS:
            return values
        if values.max() > LOUDEST_DB:
            raise ValueError(f"the record has levels of {values.max():.4g} dB, beyond any sound; render it anew.")
        if self.angles is not None:
            return power_from_db(values + self.angles.gain(record))
        gain = None if self.gain == "angle" else self.gain
        return power_from_db(values + display_gain(record, gain)[0][:, None])


def samples(line: Line, cell: float, fill: float, *,
            with_values: bool) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray | None]]:
    """Sample a record's ground, dense enough for cells [m]; pings farther apart than ``fill`` [m] leave a hole.

    Yields
    ------
    place : (N, 2) [m]
    ground_range : (N,) [m]
    values : (N,) or None
        Where they are asked for.

    Raises
    ------
    ValueError
        If levels are beyond any sound.
    """
    swath, step = line.swath, min(FINEST * cell, line.swath.bin_width)
    pings = swath.record.sizes["ping"]
    block = max(1, int(WORK * step / swath.reach))
    for start in range(0, max(pings - 1, 1), block):
        some = slice(start, min(start + block + 1, pings))          # the next block begins with the last ping
        values = line.values(some) if with_values else None
        for side, ground in swath.ground(some, step):
            shown = None if values is None else np.take_along_axis(values[:, side], ground.bin, 1)
            for place, from_first in _between(ground, cell, fill):
                there = np.isfinite(place).all(-1)
                ranges = np.broadcast_to(ground.ground_range, there.shape)[there]
                if shown is None:
                    yield place[there], ranges, None
                    continue
                own = (shown[:-1] if from_first and len(shown) > 1 else shown[-len(place):])[there]
                real = np.isfinite(own) if own.dtype.kind == "f" else slice(None)
                yield place[there][real], ranges[real], own[real]


def _between(ground: Ground, cell: float, fill: float) -> Iterator[tuple[np.ndarray, bool]]:
    """Places between each ping and the next, (K - 1, G, 2), and whether they show the former of the two."""
    if len(ground.place) == 1:
        yield ground.place, True
        return
    first, way = ground.place[:-1], np.diff(ground.place, axis=0)
    apart = np.hypot(way[..., 0], way[..., 1])
    hole = apart > fill
    widest = float(np.max(apart, where=~hole & np.isfinite(apart), initial=0.0))
    count = max(2, int(np.ceil(widest / (FINEST * cell))))
    count += count % 2                                              # as many of either ping
    for number in range(count):
        share = (number + 0.5) / count
        former = share < 0.5
        # beside a hole a ping shows its own place alone
        shares = np.where(hole, 0.0 if former else 1.0, share)
        own = first if former else ground.place[1:]
        # a ping beside one that has no place there shows its own place too
        yield np.where(np.isfinite(way), first + shares[..., None] * way, own), former
