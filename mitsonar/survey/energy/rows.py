"""What an energy record asks of its rows: which rays, which row, which weight, how a bin shows.

A row is what one beam of the sonar receives of a ping: a side of a sidescan (`sides`), a beam of an array (`beams`).
Both are classes of the protocol `Rows`; all else about an energy record is the same for them (`energy`).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import mitsuba as mi
import numpy as np

from mitsonar.device.types import Vector
from mitsonar.echoes.paths import Paths
from mitsonar.echoes.sums.energy_sums import EchoSums
from mitsonar.imaging.energy_record import CoherentSums
from mitsonar.scene.tracing.hits import Hits

from ..motion.places import Place
from ..motion.underway import Underway
from .energy_bins import EnergyBins
from .sound_paths import SoundPaths


@dataclass(frozen=True, kw_only=True)
class Rays:
    """Hold rays of a pass, on the device."""

    ping: mi.UInt32  # (R,): number within the block
    direction: mi.Vector3f  # (R,): unit, scene coordinates
    solid_angle: mi.Float  # (R,) [sr]: that each ray stands for


@dataclass(frozen=True, kw_only=True)
class RowResponse:
    """Hold the response of the rows of a record to echoes."""

    row: mi.UInt32  # (R,): row of the block that an echo belongs to
    pattern: mi.Float  # (R,) [-]: two-way intensity pattern
    in_beam: mi.Bool  # (R,): whether the echo comes through the main lobe
    active: mi.Bool  # (R,): whether any row receives the echo


RaysOf = TypeVar("RaysOf", bound=Rays)
_RaysIn = TypeVar("_RaysIn", bound=Rays, contravariant=True)


class EchoSource(Protocol[_RaysIn]):
    """Add echoes other than those of first hits."""

    def add(self, place: Place, rays: _RaysIn, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of a pass of rays to the sums."""
        ...


class CoherentSource(Protocol):
    """Sum echoes that have a phase of their own."""

    def sum(self, place: Place) -> CoherentSums:
        """Sum them over a block of pings."""
        ...


class Rows(Protocol[RaysOf]):
    """Hold the rows of an energy record.

    Attributes
    ----------
    per_ping, pings_per_block : int
        Rows of a ping; pings that are rendered together.
    labels : int
        Number of instances that are told apart.
    hidden_in_beam : bool
        Whether what objects hide is told in the main lobe alone: where the bed hides itself, what side lobes miss would
        be all there is.
    paths : Paths
        That are told apart.
    frequency : float [Hz]
    source_level_db : float [dB re 1 µPa @ 1 m]
    bins : EnergyBins
    underway : Underway
    """

    per_ping: int
    hidden_in_beam: bool
    pings_per_block: int
    labels: int
    paths: Paths
    frequency: float
    source_level_db: float
    bins: EnergyBins
    underway: Underway

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, RaysOf], tuple[mi.UInt32, mi.Bool]]) -> Iterator[RaysOf]:
        """Yield the rays of a block, pass by pass; `bins_of` returns the bins of their echoes, and which arrive."""
        ...

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> RaysOf:
        """Return rays of directions that somebody else chose, Vector3f (R,), of pings with these numbers in the block.
        """
        ...

    def response(self, place: Place, rays: RaysOf, towards: Vector) -> RowResponse:
        """Return how echoes are received that come back from `towards`, the way their rays went."""
        ...

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return what the picture makes of intensities (rows, ..., bins)."""
        ...

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[RaysOf]]:
        """Return the sources of the echoes that no first hit brings."""
        ...

    def coherent(self, sound: SoundPaths) -> CoherentSource | None:
        """Return the source of the echoes that have a phase of their own; None where the scene has none."""
        ...
