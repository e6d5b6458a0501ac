"""Point targets: scatterers with a target strength instead of an area, and with a phase that is not random.

A target echoes with the pressure f = 10^(TS/20) along every leg: straight, by way of a flat sea surface or of the
bed (`sights`). It may lie on a surface, which then does not hide it.

A target with a scattering function is a row of such targets at one place, the taps of `scattering.bodies.echo_taps`.
Their pressures are complex and depend on the directions that sound comes from and goes to; each tap has its own delay.
"""
from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scattering.bodies.echo_taps import EchoTaps, ReceivedBand
from mitsonar.scene.geometry import Geometry, Target
from mitsonar.scene.tracing.connection import Connection
from mitsonar.scene.tracing.tracer import Sources
from mitsonar.water.profile import SoundSpeedProfile

from .body_motion import BodyMotion
from .record import Echoes
from .sights.sight import complex_product, path_of, product
from .sights.sights import Sights
from .sonar_equation import pressure_along_legs

TARGET_RADIUS = 0.02               # [m] around a point target within which nothing hides it


@dataclass(frozen=True, kw_only=True)
class _TargetRow:
    """The taps of a target, from number `first` on, and the target's axes in the scene (3, 3)."""

    first: int
    taps: EchoTaps
    rotation: np.ndarray


class PointTargets:
    """The point targets of a scene, on the device."""

    def __init__(self, targets: Sequence[tuple], band: ReceivedBand | None = None,
                 profile: SoundSpeedProfile | None = None, *, resolved: bool = True):
        self.lib, self._rows = arrays_of(mi.Float), []
        self._geometry: Geometry | None = None
        self._motion: BodyMotion | None = None
        self._taps_of: list[int] = []
        position, pressure, label, count = [], [], [], 0
        for target in (Target(*fields) for fields in targets):
            own = np.array([10 ** (target.strength_db / 20)])
            if target.scattering is not None:
                if band is None or profile is None:
                    raise ValueError("A target with a scattering function needs a band and a sound speed profile.")
                speed = float(profile.at(-target.position[2]))
                if resolved:
                    taps = EchoTaps.of(target.scattering, band, speed)
                    own = np.sqrt(taps.share * taps.strength)
                    turn = np.eye(3) if target.rotation is None else target.rotation
                    self._rows.append(_TargetRow(first=count, taps=taps, rotation=turn))
                else:
                    own = 10 ** (np.array([target.strength_at(band.frequency, speed)]) / 20)
            count += len(own)
            self._taps_of.append(len(own))
            position.append(np.broadcast_to(target.position, (len(own), 3)))
            pressure.append(own)
            label.append(np.full(len(own), target.label, np.uint32))
        self.count = count
        if not count:
            return
        self._place(np.concatenate(position))
        self._pressure = upload(mi.Float, np.concatenate(pressure).astype(np.float32))
        self._label = upload(mi.UInt32, np.concatenate(label))

    @classmethod
    def of(cls, geometry: Geometry, band: ReceivedBand, profile: SoundSpeedProfile, *,
           resolved: bool = True) -> PointTargets:
        """Return the targets of a geometry, which stay where its moving objects stand."""
        targets = cls(geometry.targets(), band, profile, resolved=resolved)
        targets._geometry, targets._motion = geometry, BodyMotion.of(geometry)
        geometry.follow(targets._moved)
        return targets

    def _place(self, position: np.ndarray) -> None:
        """Keep the positions (N, 3) [m] of all taps on the device."""
        self._position = [upload(mi.Float64, np.ascontiguousarray(axis, float)) for axis in position.T]

    def _moved(self) -> None:
        """Move targets to where they stand."""
        if self._geometry is None or not self.count:
            return
        targets = self._geometry.targets()
        self._place(np.repeat(np.array([target.position for target in targets]), self._taps_of, axis=0))
        turned = [target.rotation for target in targets if target.scattering is not None]
        self._rows = [row if turn is None else replace(row, rotation=turn) for row, turn in zip(self._rows, turned)]

    def __len__(self) -> int:
        return self.count

    def position(self, which: mi.UInt32) -> dr.ArrayBase:
        """Return the positions of targets, Array3f64 (R,) [m]."""
        return self.lib.Array3f64(*(dr.gather(mi.Float64, axis, which) for axis in self._position))

    def pressure(self, which: mi.UInt32) -> mi.Float:
        """Return f, Float (R,) [m]."""
        return dr.gather(mi.Float, self._pressure, which)

    def label(self, which: mi.UInt32) -> mi.UInt32:
        """Return the labels of the targets' shapes, UInt32 (R,)."""
        return dr.gather(mi.UInt32, self._label, which)

    def drawn(self, share: mi.Float) -> tuple[mi.UInt32, mi.Float]:
        """Draw targets evenly from numbers in [0, 1): their indices, and their f² over the chance of the draw [m²]."""
        count = dr.opaque(mi.UInt32, self.count)
        which = dr.minimum(mi.UInt32(share * mi.Float(count)), count - 1)
        return which, mi.Float(count) * dr.square(self.pressure(which))

    def echoes(self, sights: Sights, sources: Sources, origin: dr.ArrayBase, source: mi.UInt32, which: mi.UInt32, *,
               mirrored: bool = True) -> Iterator[tuple[Echoes, mi.Bool]]:
        """Yield the echoes of targets `which` (R,) seen from sources, and where they are visible, path by path."""
        point, strength = self.position(which), self.pressure(which)
        nothing, at_once = dr.zeros(mi.Float, dr.width(strength)), dr.zeros(mi.Float64, dr.width(strength))
        ways = [(False, False, 1.0), *(sights.ways() if mirrored else ())]
        ends = {folded: sights.see(sources, origin, source, point, mi.Vector3f(0, 0, 0), folded=folded,
                                   short=TARGET_RADIUS) for folded in {back for _, back, _ in ways}}
        for there, back, sign in ways:
            out, home = ends[there], ends[back]
            (real, imaginary), delay = (strength, nothing), at_once
            if self._rows:
                (real, imaginary), delay = self._taps(which, out.way, home.way)
            unit = pressure_along_legs(sign, out.gain, home.gain)
            free = out.way.free & home.way.free & dr.isfinite(unit)
            real, imaginary = (dr.select(free, unit * part, 0) for part in (real, imaginary))
            shift, later = self._moving(which, point, out.way, home.way)
            delay = delay + later
            # a copy is not `single`: there is a time between the legs
            back_leg = replace(home.leg) if self._rows or shift is not None else home.leg
            yield Echoes(out=out.leg, back=back_leg, between=delay, shift=shift,
                         energy=dr.fma(real, real, dr.square(imaginary)), amplitude=(real, imaginary),
                         path=("b", "bs", "sbs")[there + back]), free
        if mirrored and sights.bed is not None:
            yield from self._by_the_bed(sights, sources, origin, source, which, point, strength)

    def _by_the_bed(self, sights, sources, origin, source, which, point, strength):
        """Yield the echoes by way of the bed: out, back or both."""
        nothing, seen = mi.Vector3f(0, 0, 0), {}
        for there, back in sights.bed_ways():
            for by in (there, back):
                if by == "b" and by not in seen:
                    seen[by] = sights.bed.see(sources, origin, source, point, nothing, self.label(which),
                                              short=TARGET_RADIUS)
                elif by not in seen:
                    seen[by] = sights.see(sources, origin, source, point, nothing, folded=by == "s",
                                          short=TARGET_RADIUS)
            out, home = seen[there], seen[back]
            (real, imaginary), later = product(out, home)
            if self._rows:
                strength = mi.Float(1)
                answer, delay = self._taps(which, out.way, home.way)
                (real, imaginary), later = complex_product((real, imaginary), answer), later + delay
            pressure = pressure_along_legs(strength, out.gain, home.gain) * (-1.0 if "s" in there + back else 1.0)
            free = out.way.free & home.way.free & dr.isfinite(pressure)
            amplitude = dr.select(free, pressure * real, 0), dr.select(free, pressure * imaginary, 0)
            shift, delay = self._moving(which, point, out.way, home.way)
            later = later + delay
            # a copy is not `single`: the time between the legs counts
            leg = home.leg if there != back and not self._rows else replace(home.leg)
            energy = dr.square(amplitude[0]) + dr.square(amplitude[1])
            yield Echoes(out=out.leg, back=leg, between=later, energy=energy, amplitude=amplitude, shift=shift,
                         path=path_of(there, back)), free

    def _moving(self, which: mi.UInt32, point: dr.ArrayBase, out: Connection,
                home: Connection) -> tuple[mi.Float | None, mi.Float64 | float]:
        """Return the Doppler shift of moving targets, and their change of the delay [s]; None and 0 if none moves."""
        if self._motion is None:
            return None, 0.0
        label = self.label(which)
        shift = self._motion.shift(label, point, out.arrival_direction, home.arrival_direction,
                                   mi.Float(out.sound_speed))
        return shift, self._motion.later(label, shift, out.travel_time)

    def _taps(self, which: mi.UInt32, out: Connection,
              home: Connection) -> tuple[tuple[mi.Float, mi.Float], mi.Float64]:
        """Return f [m] of taps along ways out and home, as real and imaginary part, and their delays [s]."""
        incident, scattered = out.arrival_direction, -home.arrival_direction
        pressure = self.pressure(which)
        dr.eval(which, incident, scattered, pressure)
        number, answer = which.numpy(), pressure.numpy().astype(complex)
        delay, size = np.zeros(len(number)), len(number)
        ways = np.stack([np.broadcast_to(axis.numpy(), size) for axis in (*incident, *scattered)], 1).astype(float)
        ways[~np.isfinite(ways).all(1)] = (1, 0, 0, -1, 0, 0)      # no ray: any direction, as its gain is 0
        for row in self._rows:
            tap = number.astype(int) - row.first
            own = np.flatnonzero((tap >= 0) & (tap < len(row.taps.delay)))
            # the taps of a target share a way, which is evaluated once
            distinct, same = np.unique(ways[own], axis=0, return_inverse=True)
            weight = row.taps.weights(distinct[:, :3] @ row.rotation, distinct[:, 3:] @ row.rotation)
            answer[own], delay[own] = weight[same.ravel(), tap[own]], row.taps.delay[tap[own]]
        real, imaginary = (upload(mi.Float, part(answer).astype(np.float32)) for part in (np.real, np.imag))
        return (real, imaginary), upload(mi.Float64, delay)
