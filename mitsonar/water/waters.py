"""Water of a survey: its column at every ping, and what holds for all pings.

Nothing but this module knows which pings share a water. Rays, echoes and reductions ask for the water of their ping;
windows, ranges and units, which all pings share, ask for the extremes of all columns.
"""
from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from .column import AbsorptionColumn
from .fields import SoundSpeedField
from .profile import SoundSpeedProfile
from .volume import VolumeScattering

TIDE_STEP = 0.02                   # [m]: profiles ride on the tide in steps, as every new water takes time to prepare


@dataclass(frozen=True, kw_only=True, eq=False)
class WaterColumn:
    """Water between surface and bed, at the frequency of a sonar."""

    profile: SoundSpeedProfile
    absorption: AbsorptionColumn
    volume: VolumeScattering | None = None  # None: the water itself scatters nothing back
    #: absorption [dB/m] against frequency [Hz], mean from the sonar to the lowest bed; None where it is constant
    mean_absorption_db: Callable[[np.ndarray], np.ndarray] | None = None
    field: SoundSpeedField | None = None  # sound speed that changes across, beside the profile
    level: float = 0.0  # [m]: of the water's surface above depth 0, from which depths of all above count

    def lifted(self, height: float) -> WaterColumn:
        """Return the column on a tide of a height [m]; itself if nothing changes."""
        parts = {name: None if (own := getattr(self, name)) is None else own.lifted(height)
                 for name in ("profile", "absorption", "volume", "field")}
        if all(part is getattr(self, name) for name, part in parts.items()):
            return self
        return replace(self, **parts, level=self.level + height)

    def mixed(self, other: WaterColumn, share: float) -> WaterColumn:
        """Return the column between this one, share 0, and another, share 1; volume scattering is this one's."""
        if share in (0.0, 1.0):
            return other if share else self
        means = self.mean_absorption_db, other.mean_absorption_db
        return replace(self, profile=self.profile.mixed(other.profile, share),
                       absorption=self.absorption.mixed(other.absorption, share),
                       mean_absorption_db=None if None in means else partial(_mixed_means, means, share))


def _mixed_means(means, share, frequency):
    """Return mean absorptions [dB/m] of two columns, mixed."""
    return (1 - share) * means[0](frequency) + share * means[1](frequency)


class PingElsewhere(Protocol):
    """Ping of a sonar that is stepped."""

    @property
    def row(self) -> int | None:
        """Return the number of the planned ping with this pose."""
        ...

    @property
    def time(self) -> float:
        """Return the time of the transmission [s]."""
        ...

    @property
    def place(self) -> np.ndarray:
        """Return east and north (2,) [m]."""
        ...


class FoundWater(NamedTuple):
    """Water of a time and place; equal keys have equal water."""

    key: tuple[Hashable, ...]
    make: Callable[[], WaterColumn]
    stated: Mapping[str, object]  # what a record states about it, as `Waters.attributes`


class StepWater(NamedTuple):
    """Water of a ping of a sonar that is stepped."""

    number: int  # pings in a row with equal numbers share their water
    column: WaterColumn
    stated: Mapping[str, object]


@dataclass(frozen=True, kw_only=True, eq=False)
class Waters:
    """Water of a survey's pings."""

    columns: Sequence[WaterColumn]  # the different columns
    numbers: np.ndarray | None = None  # (P,) int: columns of the pings; None: the first one for all
    #: what a record states about the pings' columns
    attributes: Mapping[str, object] = dataclasses.field(default_factory=dict)
    #: the water of any time [s] and place (2,) [m], for a sonar that is stepped; None: the same everywhere
    elsewhere: Callable[[float, np.ndarray], FoundWater] | None = None
    _latest: dict[tuple[Hashable, ...], StepWater] = dataclasses.field(default_factory=dict)   # the latest step's
    _numbers: Iterator[int] = dataclasses.field(default_factory=itertools.count)               # of other steps' waters

    @classmethod
    def constant(cls, column: WaterColumn) -> Waters:
        """Return one column for all pings."""
        return cls(columns=[column])

    def with_field(self, field: SoundSpeedField, time: np.ndarray) -> Waters:
        """Return the waters with a field beside their profiles, as it is at the pings' times (P,) [s]."""
        start = float(time[0])
        if not field.moves:
            placed = field.at(start, start)
            return replace(self, columns=[replace(one, field=placed) for one in self.columns], elsewhere=(
                None if self.elsewhere is None else self._beyond(lambda _: (0, partial(replace, field=placed), {}))))
        columns = [replace(self.at(ping), field=field.at(float(now), start)) for ping, now in enumerate(time)]
        return replace(self, columns=columns, numbers=np.arange(len(time)), elsewhere=self._beyond(
            lambda now: (now, partial(replace, field=field.at(now, start)), {})))

    def lifted(self, level: Callable[[np.ndarray], np.ndarray], time: np.ndarray) -> Waters:
        """Return the waters on a tide, whose heights [m] at the pings' times (P,) are rounded to `TIDE_STEP`."""
        def at(now: float) -> tuple[Hashable, Callable[[WaterColumn], WaterColumn], Mapping[str, object]]:
            height = float(level(np.array(now)))
            step = round(height / TIDE_STEP)
            return step, lambda column: column.lifted(step * TIDE_STEP), {"tide_of_ping": [round(height, 4)]}

        tide, elsewhere = level(time), self._beyond(at)
        pairs = np.stack([self.number(np.arange(len(tide))), np.round(tide / TIDE_STEP).astype(int)])
        pairs, numbers = np.unique(pairs, axis=1, return_inverse=True)
        columns = [self.columns[number].lifted(step * TIDE_STEP) for number, step in pairs.T]
        stated = {**self.attributes, "tide_of_ping": [round(float(height), 4) for height in tide]}
        if all(column is self.columns[number] for column, number in zip(columns, pairs[0])):
            return replace(self, attributes=stated, elsewhere=elsewhere)
        return replace(self, columns=columns, numbers=numbers.reshape(-1), attributes=stated, elsewhere=elsewhere)

    def _beyond(self, more: Callable[[float], tuple[Hashable, Callable[[WaterColumn], WaterColumn],
                                                    Mapping[str, object]]]) -> Callable[..., FoundWater]:
        """Return `elsewhere` with another change of columns by time: its key, the change, and what is stated."""
        def found(time: float, place: np.ndarray) -> FoundWater:
            base = self.elsewhere(time, place) if self.elsewhere else FoundWater((), lambda: self.columns[0], {})
            key, change, stated = more(time)
            return FoundWater((*base.key, key), lambda: change(base.make()), {**base.stated, **stated})

        return found

    def of_step(self, ping: PingElsewhere) -> StepWater:
        """Return the water of a ping of a sonar that is stepped; that of the latest one is kept."""
        if self.elsewhere is None or ping.row is not None:
            row = ping.row or 0
            return StepWater(int(self.number(row)), self.at(row), {})
        key, make, stated = self.elsewhere(ping.time, ping.place)
        if key not in self._latest:
            column = make()
            planned = next((number for number, own in enumerate(self.columns) if own is column), None)
            number = len(self.columns) + next(self._numbers) if planned is None else planned
            self._latest.clear()
            self._latest[key] = StepWater(number, column, stated)
        return self._latest[key]

    def number(self, ping: ArrayLike) -> np.ndarray:
        """Return the numbers of the columns of pings, of any shape."""
        return np.zeros(np.shape(ping), int) if self.numbers is None else self.numbers[np.asarray(ping)]

    def at(self, ping: int) -> WaterColumn:
        """Return the water of a ping."""
        return self.columns[int(self.number(ping))]

    def sound_speed(self, ping: int, depth: float) -> float:
        """Return the sound speed [m/s] of a ping at a depth [m]."""
        return float(self.at(ping).profile.at(depth))

    def within(self, ping: int) -> Waters:
        """Return the water of a ping as that of all pings."""
        return self if len(self.columns) == 1 else Waters.constant(self.at(ping))

    @property
    def only(self) -> WaterColumn:
        """Return the column that all pings share; raise `ValueError` if they differ."""
        if len(self.columns) > 1:
            raise ValueError(f"one water was asked for, but the survey's pings have {len(self.columns)}; write `cast` "
                             "in place of `casts`, leave out `tide`, or give pings that share a cast")
        return self.columns[0]

    @property
    def first(self) -> WaterColumn:
        """Return the water of the first ping, for what a record states once, such as its cast."""
        return self.at(0)

    @property
    def slowest(self) -> float:
        """Return the lowest sound speed of all pings [m/s]."""
        return min(float(np.min(column.profile.sound_speed)) for column in self.columns)

    @property
    def fastest(self) -> float:
        """Return the highest sound speed of all pings [m/s]."""
        return max(float(np.max(column.profile.sound_speed)) for column in self.columns)

    @property
    def least_absorption_db(self) -> float:
        """Return the lowest absorption of all pings [dB/m]."""
        return min(float(np.min(column.absorption.absorption_db)) for column in self.columns)

    @property
    def scatter(self) -> bool:
        """Return True if the water itself scatters sound back at any ping."""
        return any(column.volume is not None for column in self.columns)
