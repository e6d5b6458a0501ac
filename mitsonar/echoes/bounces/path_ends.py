"""Ends of paths: places of a bundle's rays after some bounces, as the sonar sees them.

Two connected ends make a path of more bounces (`connected_ends`). An end is a hit of a ray, or a point target.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import Kept, entries
from mitsonar.scene.tracing.hits import Hits
from mitsonar.scene.tracing.tracer import Sources

from ..record import EchoLeg


@dataclass(frozen=True, kw_only=True)
class Origins:
    """Sources of rays, one per ray."""

    sources: Sources
    origin: dr.ArrayBase  # (R,) [m]
    source: mi.UInt32  # (R,): index into `sources`
    speed: mi.Float  # (R,) [m/s]: sound speed at the source


@dataclass(frozen=True, kw_only=True)
class Ends:
    """Places of rays after some bounces, and their paths so far."""

    hits: Hits  # the last hits, without the way there
    solid_angle: mi.Float  # (R,) [sr]: ΔΩ, times the shares of power carried on
    patch: mi.Float  # (R,) [m²]: part of the surface that the ray stands for at its first hit
    between: mi.Float64  # (R,) [s]: time since the first hit
    loss_db: mi.Float  # (R,): absorption so far, one way
    code: mi.UInt32  # (R,): see `paths`
    leg: EchoLeg  # to the first hit
    first_label: mi.UInt32  # (R,): of the first hit
    first_smooth: mi.Bool  # (R,): True if the first hit was on a smooth target

    @property
    def valid(self) -> mi.Bool:
        """True for rays that are still on their way."""
        return self.hits.valid

    @property
    def point(self) -> dr.ArrayBase:
        """Place, Array3f64 (R,) [m]."""
        return self.hits.point

    @property
    def label(self) -> mi.UInt32:
        """Label of the last hit."""
        return self.hits.label

    def where(self, valid: mi.Bool) -> Ends:
        """Return the same ends, of which only those that are also `valid` count."""
        return replace(self, hits=replace(self.hits, valid=self.hits.valid & valid))

    def chosen(self, index: mi.UInt32) -> Ends:
        """Return the ends with these numbers."""
        return entries(self, index)


@dataclass(frozen=True, kw_only=True)
class TargetEnds:
    """Point targets, one per ray, as seen by the sonar."""

    valid: mi.Bool
    point: dr.ArrayBase
    label: mi.UInt32
    leg: EchoLeg
    worth: mi.Float  # T (c_j / c_0)² / A_j over the probability of the draw
    loss_db: mi.Float
    code: mi.UInt32


def image_of(origin: dr.ArrayBase) -> dr.ArrayBase:
    """Return the image of a point in the flat sea surface."""
    return type(origin)(origin.x, origin.y, -origin.z)


def computed(record: Kept) -> Kept:
    """Return the same record, evaluated."""
    dr.eval(record)
    return record
