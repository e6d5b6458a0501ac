"""Ghosts: echoes of several bounces, or by way of the sea surface."""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from ..record import EchoLeg
from .path_ends import Ends, TargetEnds


@dataclass(frozen=True, kw_only=True)
class Ghosts:
    """Echoes of several bounces, or by way of the sea surface, one per entry."""

    energy: mi.Float  # (R,): e² without absorption and patterns [-]
    loss_db: mi.Float  # (R,): absorption along the whole path
    out: EchoLeg
    back: EchoLeg
    between: mi.Float64  # (R,) [s]
    code: mi.UInt32  # (R,): see `paths`
    label: mi.UInt32  # (R,): of the last thing that the sound met
    depth: mi.Float  # (R,) [m]: of that place
    active: mi.Bool  # (R,)
    ray: mi.UInt32  # (R,): numbers of the rays that they come from
    first_label: mi.UInt32  # (R,): of the first thing that the sound met
    first_smooth: mi.Bool  # (R,): True if that is a smooth target

    @classmethod
    def of(cls, energy: mi.Float, out: Ends, back: Ends | TargetEnds, between: mi.Float64, code: mi.UInt32,
           active: mi.Bool, loss_db: mi.Float | float = 0.0) -> Ghosts:
        """Return the ghosts that leave by one end and return by another; `loss_db` is the loss in between."""
        active = active & (energy > 0) & dr.isfinite(energy)
        return cls(energy=energy, loss_db=out.loss_db + back.loss_db + loss_db, out=out.leg, back=back.leg,
                   between=between, code=code, label=back.label, depth=mi.Float(-back.point.z), active=active,
                   ray=out.ray, first_label=out.first_label, first_smooth=out.first_smooth)

    def turned(self, origin: dr.ArrayBase) -> Ghosts:
        """Return the same paths in reverse; `origin` (R,) [m] is the place of the sonar."""
        z = self.out.offset.z + (-origin.z if self.out.folded else origin.z)
        return replace(self, out=self.back, back=self.out, label=self.first_label, depth=mi.Float(-z))

    def reversed(self, origin: dr.ArrayBase) -> Ghosts:
        """Return the paths that begin at a smooth target, in reverse."""
        return replace(self.turned(origin), active=self.active & self.first_smooth)


def joined(code: mi.UInt32, last: mi.UInt32) -> mi.UInt32:
    """Return the codes of paths that continue with the bounces of `last`, a path from the sonar, in reverse."""
    # the last bounce of `last` comes first on the way back
    for _ in range(2):
        more = last > 1
        code = dr.select(more, 2 * code + (last & 1), code)
        last = dr.select(more, last >> 1, last)
    return code
