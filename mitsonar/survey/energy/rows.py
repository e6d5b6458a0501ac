"""Interface of the rows of an energy record: their rays, response and display.

A row is the echo of a ping as one beam of the sonar receives it: a side of a sidescan (`sides`), a beam of an array
(`beams`). Both follow the protocol `Rows`; everything else in an energy record is the same for them (`energy`).
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

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
    """Rays of a pass, on the device."""

    ping: mi.UInt32  # (R,): number within the block
    direction: mi.Vector3f  # (R,): unit, scene coordinates
    solid_angle: mi.Float  # (R,) [sr]: share of each ray


@dataclass(frozen=True, kw_only=True)
class RowResponse:
    """Response of the rows of a record to echoes."""

    row: mi.UInt32  # (R,): row of the block that an echo belongs to
    pattern: mi.Float  # (R,) [-]: two-way intensity pattern
    in_beam: mi.Bool  # (R,): True if the echo comes through the main lobe
    active: mi.Bool  # (R,): True if a row receives the echo


RaysOf = TypeVar("RaysOf", bound=Rays)
_RaysIn = TypeVar("_RaysIn", bound=Rays, contravariant=True)


class EchoSource(Protocol[_RaysIn]):
    """Source of echoes other than those of first hits."""

    def add(self, place: Place, rays: _RaysIn, hits: Hits, sums: EchoSums) -> None:
        """Add the echoes of a pass of rays to the sums."""
        ...


class CoherentSource(Protocol):
    """Source of coherent echoes, which have a phase."""

    def sum(self, place: Place) -> CoherentSums:
        """Return the sums of coherent echoes over a block of pings."""
        ...


class Rows(Protocol[RaysOf]):
    """Rows of an energy record."""

    per_ping: int  # rows of a ping
    # True if only the main lobe counts for seabed that objects hide: where the bed hides itself, the hidden echoes of
    # side lobes would be the only ones
    hidden_in_beam: bool
    pings_per_block: int  # pings that are rendered together
    labels: int  # number of instances with sums of their own
    paths: Paths  # paths with sums of their own
    frequency: float  # [Hz]
    source_level_db: float  # [dB re 1 µPa @ 1 m]
    bins: EnergyBins
    underway: Underway

    def within(self, survey: Any) -> Rows[RaysOf]:
        """Return the rows of a part of the survey that shares its surroundings; the same rows if all pings do."""
        ...

    def passes(self, place: Place, seed: int,
               bins_of: Callable[[Place, RaysOf], tuple[mi.UInt32, mi.Bool]]) -> Iterator[RaysOf]:
        """Yield the rays of a block, pass by pass; `bins_of` returns the bins of their echoes, and which count."""
        ...

    def aimed(self, place: Place, ping: mi.UInt32, direction: mi.Vector3f, solid_angle: mi.Float) -> RaysOf:
        """Return rays in given directions, Vector3f (R,), of the pings with given numbers in the block."""
        ...

    def response(self, place: Place, rays: RaysOf, towards: Vector) -> RowResponse:
        """Return the response to the echoes of rays that come back from `towards`."""
        ...

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return intensities (rows, ..., bins) as the picture shows them."""
        ...

    def other_sources(self, sound: SoundPaths, seed: int) -> Sequence[EchoSource[RaysOf]]:
        """Return the sources of the echoes other than those of first hits."""
        ...

    def coherent(self, sound: SoundPaths) -> CoherentSource | None:
        """Return the source of coherent echoes, None where the scene has none."""
        ...
