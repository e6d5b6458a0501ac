"""Ends of paths: places of a bundle's rays after some bounces, as the sonar sees them.

Two connected ends make a path of more bounces (`connected_ends`). An end is a hit of a ray, or a point target.
"""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from mitsonar.device.arrays import Kept, compressed, entries, mapped, picked
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

    def of(self, ray: mi.UInt32) -> Origins:
        """Return the sources of the rays with these numbers."""
        return replace(self, origin=picked(self.origin, ray), source=picked(self.source, ray),
                       speed=picked(self.speed, ray))


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
    ray: mi.UInt32  # (R,): numbers of the rays in their bundle

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

    def only(self, active: mi.Bool) -> tuple[mi.UInt32, Ends]:
        """Return the numbers of the ends that are valid and `active`, and these ends; see `going`."""
        index, valid = going(self.valid & active)
        ends = self.chosen(index)
        return index, replace(ends, hits=replace(ends.hits, valid=valid))

    def chosen(self, index: mi.UInt32) -> Ends:
        """Return the ends with these numbers."""
        return entries(self, index)

    def and_those(self, others: Ends) -> Ends:
        """Return these ends and others behind them."""
        count, index = dr.width(self.ray), dr.arange(mi.UInt32, dr.width(self.ray) + dr.width(others.ray))
        here, behind = index < dr.opaque(mi.UInt32, count), index - dr.opaque(mi.UInt32, count)
        return mapped(lambda own, other: dr.select(here, dr.gather(type(own), own, index, here),
                                                   dr.gather(type(own), other, behind, ~here)), self, others)


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


def going(active: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
    """Return the numbers of the active entries, at least two numbers, and True for those that are active.

    Arrays of one entry would be broadcast, by kernels of their own.
    """
    index = compressed(active)
    count = dr.width(index)
    if count < 2:
        index = mi.UInt32(index.numpy().tolist() + [0] * (2 - count))
    return index, dr.arange(mi.UInt32, max(count, 2)) < dr.opaque(mi.UInt32, count)


def computed(record: Kept) -> Kept:
    """Return the same record, evaluated."""
    dr.eval(record)
    return record
