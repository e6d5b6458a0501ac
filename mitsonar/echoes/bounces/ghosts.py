"""Ghosts: echoes that have bounced more than once, or by way of the surface."""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from ..record import EchoLeg
from .path_ends import Ends, TargetEnds


@dataclass(frozen=True, kw_only=True)
class Ghosts:
    """Echoes that have bounced more than once, or by way of the surface, one an entry."""

    energy: mi.Float  # (R,): e² but for absorption and patterns [-]
    loss_db: mi.Float  # (R,): absorption over the whole path
    out: EchoLeg
    back: EchoLeg
    between: mi.Float64  # (R,) [s]
    code: mi.UInt32  # (R,): see `paths`
    label: mi.UInt32  # (R,): of what the echo comes back from last
    depth: mi.Float  # (R,) [m]: where it does
    active: mi.Bool  # (R,)

    @classmethod
    def of(cls, energy: mi.Float, out: Ends, back: Ends | TargetEnds, between: mi.Float64, code: mi.UInt32,
           active: mi.Bool, loss_db: mi.Float | float = 0.0) -> Ghosts:
        """Return the ghosts that leave by way of one end and come back by way of another; `loss_db` is that between."""
        active = active & (energy > 0) & dr.isfinite(energy)
        return cls(energy=energy, loss_db=out.loss_db + back.loss_db + loss_db, out=out.leg, back=back.leg,
                   between=between, code=code, label=back.label, depth=mi.Float(-back.point.z), active=active)

    def turned(self, ends: Ends, origin: dr.ArrayBase) -> Ghosts:
        """The same paths the other way round; `ends` are those they left by, `origin` where the sonar is."""
        z = self.out.offset.z + (-origin.z if self.out.folded else origin.z)
        return replace(self, out=self.back, back=self.out, label=ends.first_label, depth=mi.Float(-z))

    def reversed(self, ends: Ends, origin: dr.ArrayBase) -> Ghosts:
        """The same as `turned`, of those that began at a smooth target."""
        return replace(self.turned(ends, origin), active=self.active & ends.first_smooth)


def joined(code: mi.UInt32, last: mi.UInt32) -> mi.UInt32:
    """Return codes of paths that go on with the bounces of `last` in reverse: it came from the other end."""
    # the last bounce of `last` comes first on the way back; all its bounces but the final lie nearer the sonar
    for _ in range(2):
        more = last > 1
        code = dr.select(more, 2 * code + (last & 1), code)
        last = dr.select(more, last >> 1, last)
    return code
