"""Echoes back at the place of a sonar, before its beams receive them."""
from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi

from mitsonar.echoes.record import Echoes


@dataclass(frozen=True, kw_only=True, eq=False)
class PlacedEchoes:
    """Echoes back at the place of the sonar at the transmission, without its beams, on the device."""

    sent: mi.Vector3f  # (R,), unit vector of the way out, scene
    towards: mi.Vector3f  # (R,), unit vector along the way back, from the sonar, scene
    out_distance: mi.Float  # (R,) [m]
    back_distance: mi.Float  # (R,) [m]
    out_time: mi.Float64  # (R,) [s], until the last scatterer
    back_time: mi.Float64  # (R,) [s], from the last scatterer
    out_offset: dr.ArrayBase  # (R,) [m], of the first scatterer, from the sonar
    back_offset: dr.ArrayBase  # (R,) [m], of the last scatterer, from the sonar
    energy: mi.Float  # (R,), mean square of the amplitude for a source level of 0 dB, without shadows
    real: mi.Float  # (R,), amplitude over the root of the energy
    imaginary: mi.Float  # (R,), amplitude over the root of the energy
    state: mi.UInt32  # (R,), as of `GridEchoes`
    label: mi.UInt32  # (R,), as of `GridEchoes`
    shift: mi.Float | None = None  # (R,), Doppler factor of the scatterers' own motion minus 1; None: nothing moves
    folded: tuple[bool, bool] = (False, False)  # True if the way out, the way back is by way of the surface

    def chosen(self, index: mi.UInt32) -> PlacedEchoes:
        """Return the echoes at an index."""
        columns = {name: value for name, value in vars(self).items() if name != "folded" and value is not None}
        # columns that share an array also share the result
        taken = {id(value): dr.gather(type(value), value, index) if dr.width(value) > 1 else value
                 for value in columns.values()}
        return replace(self, **{name: taken[id(value)] for name, value in columns.items()})

    @classmethod
    def of(cls, echoes: Echoes) -> PlacedEchoes:
        """Return echoes of the ensonification, whose legs are exact, as `PlacedEchoes`."""
        out, back, nothing = echoes.out, echoes.back, dr.zeros(mi.UInt32, echoes.count)
        root = dr.rsqrt(dr.maximum(echoes.energy, 1e-38))
        real, imaginary = (part * root for part in echoes.amplitude)
        return cls(
            sent=mi.Vector3f(out.sent_towards), towards=mi.Vector3f(back.sent_towards),
            out_distance=mi.Float(dr.norm(out.offset)), back_distance=mi.Float(dr.norm(back.offset)),
            out_time=echoes.arrival, back_time=back.travel_time, out_offset=out.offset, back_offset=back.offset,
            energy=echoes.energy, real=real, imaginary=imaginary, state=nothing, label=nothing, shift=echoes.shift,
            folded=(out.folded, back.folded))
