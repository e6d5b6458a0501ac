"""Sound speed that changes across the water, beside the profile: c(x, y, z, t) = c_0(z) + dc(x, y, z, t).

    front            dc = A/2 (1 + tanh(2 s / L))                  A m/s over the width L, along the heading
    gradient         dc = G s                                       G m/s per metre
    grid             c itself, linear between the nodes of a grid
    internal_wave    dc = c_0(z - η) - c_0(z),  η = a sech²(s/L)    a solitary wave: η displaces the water, + down

with s = (x - x_0) sin h + (y - y_0) cos h - v t along the heading h, from a place that moves with the speed v. The form
of the wave is that of Korteweg and de Vries (1895). It displaces the water of all depths alike, so a profile that
changes with depth only in its thermocline changes there alone. Everything is written once for NumPy and Dr.Jit
numbers.
"""
from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import ClassVar, NamedTuple, Protocol, TypeVar

import drjit as dr
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.earth import Frame
from mitsonar.device.types import Numbers

SpeedAt = Callable[[Numbers], tuple[Numbers, Numbers]]     # of the profile: sound speed [m/s] and dc/dz [1/s] by depth
FieldOf = TypeVar("FieldOf", bound="Along")


class SpeedChange(NamedTuple):
    """Change of sound speed [m/s] at places, and its derivatives [1/s]."""

    value: Numbers
    east: Numbers
    north: Numbers
    down: Numbers


class UnplacedField(Protocol):
    """Sound speed beside a profile, which may still have to be placed in the scene."""

    def placed(self, frame: Frame | None, track: np.ndarray, start: float) -> SoundSpeedField:
        """Return the field around a track (P, 2) [m] that begins at `start` [s]."""
        ...


class SoundSpeedField(UnplacedField, Protocol):
    """Sound speed beside a profile."""

    @property
    def moves(self) -> bool:
        """Return True if the field changes with time."""
        ...

    def at(self, time: float, start: float) -> SoundSpeedField:
        """Return the field as it is at a time [s] of the track's clock; its first ping is at `start` [s]."""
        ...

    def lifted(self, height: float) -> SoundSpeedField:
        """Return the field of water whose surface lies `height` [m] above depth 0; itself if nothing changes."""
        ...

    def on_device(self, kind: type) -> SoundSpeedField:
        """Return the field with opaque numbers, which may change without a new kernel."""
        ...

    def change(self, x: Numbers, y: Numbers, depth: Numbers, speed_at: SpeedAt) -> SpeedChange:
        """Return the change of sound speed at places [m]."""
        ...


@dataclass(frozen=True, kw_only=True)
class Along:
    """A field that changes along a heading."""

    x: float  # [m]: place at the first ping
    y: float
    sine: float  # of the heading, clockwise from north
    cosine: float
    speed: float = 0.0  # [m/s]: along the heading
    NAME: ClassVar[str]

    @property
    def moves(self) -> bool:
        """Return True if the field changes with time."""
        return self.speed != 0

    def at(self: FieldOf, time: float, start: float) -> FieldOf:
        """Return the field as it is at a time [s] of a track that begins at `start` [s]."""
        way = self.speed * (time - start)
        return replace(self, x=self.x + way * self.sine, y=self.y + way * self.cosine, speed=0.0)

    def placed(self: FieldOf, frame: Frame | None, track: np.ndarray, start: float) -> FieldOf:
        """Return the field itself, which has its place."""
        return self

    def lifted(self: FieldOf, height: float) -> FieldOf:
        """Return the field itself, which follows from place and profile."""
        return self

    def on_device(self: FieldOf, kind: type) -> FieldOf:
        """Return the field with opaque numbers."""
        return replace(self, **{one.name: dr.opaque(kind, getattr(self, one.name)) for one in fields(self)})

    def _way(self, x: Numbers, y: Numbers) -> Numbers:
        return (x - self.x) * self.sine + (y - self.y) * self.cosine

    def _change(self, value: Numbers, slope: Numbers, down: Numbers) -> SpeedChange:
        return SpeedChange(value, slope * self.sine, slope * self.cosine, down)


@dataclass(frozen=True, kw_only=True)
class Front(Along):
    """A front between two waters."""

    change_of_speed: float  # [m/s]: from behind the place to ahead of it
    width: float  # [m]
    NAME = "front"

    def change(self, x: Numbers, y: Numbers, depth: Numbers, speed_at: SpeedAt) -> SpeedChange:
        """Return the change of sound speed at places [m]."""
        step = _library(x).tanh(2 * self._way(x, y) / self.width)
        half = 0.5 * self.change_of_speed
        return self._change(half * (1 + step), half * (1 - step * step) * 2 / self.width, 0 * x)


@dataclass(frozen=True, kw_only=True)
class Gradient(Along):
    """A sound speed that changes evenly along a heading."""

    gradient: float  # [1/s]
    NAME = "gradient"

    def change(self, x: Numbers, y: Numbers, depth: Numbers, speed_at: SpeedAt) -> SpeedChange:
        """Return the change of sound speed at places [m]."""
        return self._change(self.gradient * self._way(x, y), self.gradient + 0 * x, 0 * x)


@dataclass(frozen=True, kw_only=True)
class InternalWave(Along):
    """A solitary internal wave on the profile's own thermocline."""

    height: float  # [m]: of the displacement, positive down
    length: float  # [m]
    NAME = "internal_wave"

    def change(self, x: Numbers, y: Numbers, depth: Numbers, speed_at: SpeedAt) -> SpeedChange:
        """Return the change of sound speed at places [m]."""
        step = _library(x).tanh(self._way(x, y) / self.length)
        displaced = self.height * (1 - step * step)
        (there, slope), (here, own) = speed_at(depth - displaced), speed_at(depth)
        return self._change(there - here, slope * displaced * 2 * step / self.length, slope - own)


@dataclass(frozen=True, kw_only=True, eq=False)
class GridField:
    """Sound speed on an even grid, linear between its nodes; beyond them its difference from the profile is held."""

    corner: tuple[Numbers, ...]  # x, y and depth of the first node [m]
    step: tuple[Numbers, ...]  # [m]
    speed: np.ndarray  # (T, X, Y, Z) [m/s], two or more nodes along each
    time: np.ndarray | None = None  # (T,) [s]: since 1970; None for one time
    table: Numbers | None = None  # on the device: (X Y Z,)

    @property
    def moves(self) -> bool:
        """Return True if the field changes with time."""
        return len(self.speed) > 1

    def at(self, time: float, start: float) -> GridField:
        """Return the field as it is at a time [s]."""
        if not self.moves or self.time is None:
            return self
        place = float(np.interp(time, self.time, np.arange(len(self.time))))
        first = min(int(place), len(self.time) - 2)
        share = place - first
        speed = (1 - share) * self.speed[first] + share * self.speed[first + 1]
        return replace(self, speed=speed[None], time=None)

    def placed(self, frame: Frame | None, track: np.ndarray, start: float) -> GridField:
        """Return the field itself, which has its place."""
        return self

    def lifted(self, height: float) -> GridField:
        """Return the field of water whose surface lies `height` [m] above depth 0."""
        return self if height == 0 else replace(self, corner=(*self.corner[:2], self.corner[2] - height))

    def on_device(self, kind: type) -> GridField:
        """Return the field with its numbers on the device."""
        corner, step = (tuple(dr.opaque(kind, one) for one in part) for part in (self.corner, self.step))
        return replace(self, corner=corner, step=step, table=upload(kind, self.speed[0].ravel()))

    def change(self, x: Numbers, y: Numbers, depth: Numbers, speed_at: SpeedAt) -> SpeedChange:
        """Return the change of sound speed at places [m]."""
        xp, sizes = _library(x), self.speed.shape[1:]
        index, shares, inside, held = 0, [], [], depth
        for k, (place, size) in enumerate(zip((x, y, depth), sizes)):
            at = (place - self.corner[k]) / self.step[k]
            kept = xp.minimum(xp.maximum(at, 0.0), size - 1.0)
            node = xp.minimum(xp.floor(kept), size - 2.0)
            index = index * size + node
            shares.append(kept - node)
            inside.append(select(kept == at, 1 / self.step[k] + 0 * at, 0 * at))
            held = self.corner[k] + kept * self.step[k]
        cells = [self._node(index + (i * sizes[1] + j) * sizes[2] + k) for i in (0, 1) for j in (0, 1) for k in (0, 1)]
        u, v, w = shares
        along = [low + (high - low) * w for low, high in zip(cells[::2], cells[1::2])]
        down = [high - low for low, high in zip(cells[::2], cells[1::2])]
        west, east = (low + (high - low) * v for low, high in (along[:2], along[2:]))
        fall = [low + (high - low) * v for low, high in (down[:2], down[2:])]
        north = [high - low for low, high in (along[:2], along[2:])]
        here, own = speed_at(held)
        below = inside[2] * (fall[0] + (fall[1] - fall[0]) * u)
        return SpeedChange(west + (east - west) * u - here, inside[0] * (east - west),
                           inside[1] * (north[0] + (north[1] - north[0]) * u),
                           select(inside[2] > 0, below - own, 0 * below))

    def _node(self, number: Numbers) -> Numbers:
        if self.table is None:
            return self.speed[0].ravel()[np.asarray(number, int)]
        return dr.gather(type(number), self.table, dr.uint32_array_t(type(number))(number))


FIELDS = {one.NAME: one for one in (Front, Gradient, InternalWave)}


def _library(array: Numbers):
    return np if isinstance(array, (np.ndarray, float)) else dr


def select(condition: Numbers, yes: Numbers, no: Numbers) -> Numbers:
    """Return yes where the condition holds, else no."""
    return np.where(condition, yes, no) if isinstance(condition, np.ndarray) else dr.select(condition, yes, no)
