"""Echoes on their way: legs between a source and points of the scene, and what comes back along them.

Sound leaves the source along `out`, may go on from point to point for a time `between`, and comes back along `back`:

    p(t) = Re[e s(t - τ) e^(i2πf₀(t - τ))],     τ = out + between + back

e -> ``amplitude``: the echo's pressure 1 m from a source of pressure 1 at 1 m, without the patterns of the elements.
"""
from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr

from mitsonar.device.arrays import compressed
from mitsonar.device.types import Bool, Float, Float64, UInt32, Vector, Vector64
from mitsonar.scene.tracing.connection import Connection
from mitsonar.scene.tracing.hits import Hits


@dataclass(frozen=True, kw_only=True)
class EchoLeg:
    """Exact eigenrays from a source to points, on the device."""

    offset: Vector64  # (R,) [m]: point minus source, scene coordinates
    travel_time: Float64  # (R,) [s/m]
    ray_parameter: Float64  # (R,) [s/m]
    spreading_area: Float  # (R,) [m²/sr]: on the way from the source
    launch_direction: Vector  # (R,): unit, at the source
    folded: bool = False  # by way of the flat surface

    @classmethod
    def along(cls, way: Connection | Hits, origin: dr.ArrayBase, point: dr.ArrayBase, folded: bool = False) -> EchoLeg:
        """The legs of ways; `origin` is the image's where they are folded."""
        launch = way.launch_direction
        if folded:
            launch = type(launch)(launch.x, launch.y, -launch.z)
        return cls(offset=point - origin, travel_time=way.travel_time, ray_parameter=way.ray_parameter,
                   spreading_area=way.spreading_area, launch_direction=launch, folded=folded)

    @property
    def sent_towards(self) -> Vector:
        """Unit vectors at the source itself, folded or not."""
        launch = self.launch_direction
        return type(launch)(launch.x, launch.y, -launch.z) if self.folded else launch

    def chosen(self, index: UInt32) -> EchoLeg:
        """The legs with these numbers, UInt32."""
        return EchoLeg(folded=self.folded, **{name: dr.gather(type(value), value, index)
                                          for name, value in vars(self).items() if name != "folded"})


@dataclass(frozen=True, kw_only=True)
class Echoes:
    """Echoes of one block, on the device, as they leave their last scatterers."""

    out: EchoLeg  # to what sound met first, and to where it comes from last
    back: EchoLeg  # to what sound met first, and to where it comes from last
    between: Float64  # (R,) [s]: from the one to the other
    energy: Float  # (R,): |e|² [-], on the average over the cells' chance
    amplitude: tuple[Float, Float]  # (Float, Float): real and imaginary part of e [-]
    path: str = "b"  # the bounces, see `paths`

    @property
    def single(self) -> bool:
        """Return whether sound comes back from where it met something first."""
        return self.out is self.back

    @property
    def arrival(self) -> Float64:
        """When the last scatterer is reached [s], Float64."""
        return self.out.travel_time if self.single else self.out.travel_time + self.between

    @property
    def count(self) -> int:
        """How many."""
        return dr.width(self.energy)

    def evaluated(self) -> Echoes:
        """The same, computed."""
        dr.eval(self)
        return self

    def where(self, active: Bool) -> Iterator[Echoes]:
        """Yield the echoes that are `active`, in one block, computed; nothing where there are none."""
        dr.eval(self, active)                  # in one kernel: what hides echoes is not looked for twice
        index = compressed(active)
        if dr.width(index):
            yield self.chosen(index).evaluated()

    def chosen(self, index: UInt32) -> Echoes:
        """The echoes with these numbers, UInt32."""
        out, (real, imaginary) = self.out.chosen(index), self.amplitude
        return Echoes(out=out, back=out if self.single else self.back.chosen(index), path=self.path,
                      between=dr.gather(type(self.between), self.between, index),
                      energy=dr.gather(type(self.energy), self.energy, index),
                      amplitude=(dr.gather(type(real), real, index), dr.gather(type(imaginary), imaginary, index)))
