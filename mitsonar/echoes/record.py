"""Records of echoes: legs between a source and points of the scene, and the echoes along them.

Sound leaves the source along `out`, may travel from point to point for a time `between`, and returns along `back`:

    p(t) = Re[e s(t - τ) e^(i2πf₀(t - τ))],     τ = out + between + back

e -> ``amplitude``: the echo's pressure 1 m from a source of pressure 1 at 1 m, without the patterns of the elements.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import drjit as dr

from mitsonar.device.arrays import compressed, entries, filled
from mitsonar.device.types import Bool, Float, Float64, UInt32, Vector, Vector64
from mitsonar.scene.tracing.connection import Connection
from mitsonar.scene.tracing.hits import Hits


@dataclass(frozen=True, kw_only=True)
class EchoLeg:
    """Exact eigenrays from a source to points, on the device."""

    offset: Vector64  # (R,) [m]: point minus source, scene coordinates
    travel_time: Float64  # (R,) [s]
    ray_parameter: Float64  # (R,) [s/m]
    spreading_area: Float  # (R,) [m²/sr]: on the way from the source
    launch_direction: Vector  # (R,): unit, at the source
    folded: bool = False  # by way of the flat sea surface: the source is its image
    later: Float64 | None = None  # (R,) [s]: share of the time that the field of the water adds
    slope: Vector64 | None = None  # (R,) [s/m]: its change with the place of the source

    @classmethod
    def along(cls, way: Connection | Hits, origin: dr.ArrayBase, point: dr.ArrayBase, folded: bool = False) -> EchoLeg:
        """Return the legs of ways; `origin` is the image of the source if they are folded."""
        launch = way.launch_direction
        if folded:
            launch = type(launch)(launch.x, launch.y, -launch.z)
        return cls(offset=point - origin, travel_time=way.travel_time, ray_parameter=way.ray_parameter,
                   spreading_area=way.spreading_area, launch_direction=launch, folded=folded,
                   later=getattr(way, "later", None), slope=getattr(way, "slope", None))

    @property
    def sent_towards(self) -> Vector:
        """Unit vectors at the source itself, folded or not."""
        launch = self.launch_direction
        return type(launch)(launch.x, launch.y, -launch.z) if self.folded else launch

    @cached_property
    def soonest(self) -> float:
        """Return the shortest travel time [s]."""
        return float(cast(Float64, dr.min(self.travel_time))[0])

    def chosen(self, index: UInt32) -> EchoLeg:
        """Return the legs with these numbers."""
        return entries(self, index)


@dataclass(frozen=True, kw_only=True)
class Echoes:
    """Echoes of one block, on the device, as they leave their last scatterers."""

    out: EchoLeg  # to the first point that scatters
    back: EchoLeg  # to the last point that scatters
    between: Float64  # (R,) [s]: from the first to the last
    energy: Float  # (R,): |e|² [-], averaged over the random amplitudes of cells
    amplitude: tuple[Float, Float]  # (Float, Float): real and imaginary part of e [-]
    path: str = "b"  # the bounces, see `paths`
    shift: Float | None = None  # (R,): Doppler factor of the scatterers' own motion minus 1; None: nothing moves

    @property
    def single(self) -> bool:
        """Return True if sound returns from its first point along the same leg."""
        return self.out is self.back

    @property
    def arrival(self) -> Float64:
        """Time at which sound leaves the last scatterer [s], Float64."""
        return self.out.travel_time if self.single else self.out.travel_time + self.between

    @property
    def count(self) -> int:
        """Number of echoes."""
        return dr.width(self.energy)

    def evaluated(self) -> Echoes:
        """Return the same echoes, evaluated."""
        dr.eval(self)
        return self

    def where(self, active: Bool) -> Iterator[Echoes]:
        """Yield the `active` echoes in one evaluated block; nothing if there are none."""
        dr.eval(self, active)                  # in one kernel, so that obstacles are not searched for twice
        index = compressed(active)
        if dr.width(index) == dr.width(active) and filled(self, dr.width(active)):
            yield self                         # most often all are: no copy
        elif dr.width(index):
            yield self.chosen(index).evaluated()

    def chosen(self, index: UInt32) -> Echoes:
        """Return the echoes with these numbers."""
        echoes = entries(self, index)
        return replace(echoes, back=echoes.out) if self.single else echoes
