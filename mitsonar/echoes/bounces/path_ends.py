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

from ..record import EchoLeg

Kept = TypeVar("Kept")             # the type of record that goes in comes out


@dataclass(frozen=True, kw_only=True)
class Origins:
    """Where each ray left from."""

    sources: Sources
    origin: dr.ArrayBase  # (R,) [m]
    source: mi.UInt32  # (R,): index into `sources`
    speed: mi.Float  # (R,) [m/s]: of sound there


@dataclass(frozen=True, kw_only=True)
class Ends:
    """Where rays are after some bounces, and how they came there."""

    hits: Hits  # what they met last, without the way
    solid_angle: mi.Float  # (R,) [sr]: ΔΩ, times the shares of power carried on
    patch: mi.Float  # (R,) [m²]: what of the surface the ray stands for, at its first hit
    between: mi.Float64  # (R,) [s]: from the first hit on
    loss_db: mi.Float  # (R,): so far, one way
    code: mi.UInt32  # (R,): see `paths`
    leg: EchoLeg  # to the first hit
    first_label: mi.UInt32  # (R,): of what the ray met first
    first_smooth: mi.Bool  # (R,): of what the ray met first

    @property
    def valid(self) -> mi.Bool:
        """Return whether the ray is on its way still."""
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
        values: dict[str, Any] = {name: value.chosen(index) if isinstance(value, (Hits, EchoLeg)) else picked(value,
                                                                                                              index)
                                  for name, value in vars(self).items()}
        return Ends(**values)


@dataclass(frozen=True, kw_only=True)
class TargetEnds:
    """Point targets, one a ray, as the sonar sees them: `worth` is T (c_j / c_0)² / A_j over the chance of the draw."""

    valid: mi.Bool
    point: dr.ArrayBase
    label: mi.UInt32
    leg: EchoLeg
    worth: mi.Float
    loss_db: mi.Float
    code: mi.UInt32


def image_of(origin: dr.ArrayBase) -> dr.ArrayBase:
    """Return where the image of a point in the flat surface stands."""
    return type(origin)(origin.x, origin.y, -origin.z)


def computed(record: Kept) -> Kept:
    """Return the same record, its arrays evaluated."""
    dr.eval(record)
    return record
