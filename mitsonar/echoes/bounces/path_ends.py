"""Ends of paths: where rays of a bundle are after some bounces, as the sonar sees them.

Two ends connected make a path of more bounces (`connected_ends`). An end is a meeting of a ray with a surface, or a
point target.
"""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, TypeVar

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import picked
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Sources

from ..record import Leg

__all__ = ["Ends", "Origins", "TargetEnds", "computed", "image_of"]

Kept = TypeVar("Kept")             # the type of record that goes in comes out


@dataclass(frozen=True, kw_only=True)
class Origins:
    """Where each ray left from.

    Attributes
    ----------
    sources : Sources
    origin : Array3f64 (R,) [m]
    source : UInt32 (R,)
        Index into `sources`.
    speed : Float (R,) [m/s]
        Of sound there.
    """

    sources: Sources
    origin: dr.ArrayBase
    source: mi.UInt32
    speed: mi.Float


@dataclass(frozen=True, kw_only=True)
class Ends:
    """Where rays are after some bounces, and how they came there.

    Attributes
    ----------
    hits : Hits
        What they met last, without the way.
    solid_angle : Float (R,) [sr]
        ΔΩ, times the shares of power carried on.
    patch : Float (R,) [m²]
        What of the surface the ray stands for, at its first hit.
    between : Float64 (R,) [s]
        From the first hit on.
    loss_db : Float (R,)
        So far, one way.
    code : UInt32 (R,)
        See `paths`.
    leg : Leg
        To the first hit.
    first_label, first_smooth : UInt32 (R,), Bool (R,)
        Of what the ray met first; whether that was a smooth target.
    """

    hits: Hits
    solid_angle: mi.Float
    patch: mi.Float
    between: mi.Float64
    loss_db: mi.Float
    code: mi.UInt32
    leg: Leg
    first_label: mi.UInt32
    first_smooth: mi.Bool

    @property
    def valid(self) -> mi.Bool:
        """Whether the ray is on its way still."""
        return self.hits.valid

    @property
    def point(self) -> dr.ArrayBase:
        """Where it is, Array3f64 (R,) [m]."""
        return self.hits.point

    @property
    def label(self) -> mi.UInt32:
        """Of what it met last."""
        return self.hits.label

    def where(self, valid: mi.Bool) -> Ends:
        """The same, of the rays that are also `valid`."""
        return replace(self, hits=replace(self.hits, valid=self.hits.valid & valid))

    def chosen(self, index: mi.UInt32) -> Ends:
        """The ends with these numbers."""
        values: dict[str, Any] = {name: value.chosen(index) if isinstance(value, (Hits, Leg)) else picked(value, index)
                                  for name, value in vars(self).items()}
        return Ends(**values)


@dataclass(frozen=True, kw_only=True)
class TargetEnds:
    """Point targets, one a ray, as the sonar sees them: `worth` is T (c_j / c_0)² / A_j over the chance of the draw."""

    valid: mi.Bool
    point: dr.ArrayBase
    label: mi.UInt32
    leg: Leg
    worth: mi.Float
    loss_db: mi.Float
    code: mi.UInt32


def image_of(origin: dr.ArrayBase) -> dr.ArrayBase:
    """Give where the image of a point in the flat surface stands."""
    return type(origin)(origin.x, origin.y, -origin.z)


def computed(record: Kept) -> Kept:
    """Give the same record, its arrays evaluated."""
    dr.eval(record)
    return record
