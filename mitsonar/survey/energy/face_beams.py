"""Beams of a sidescan's faces on the device.

    b(u, v) = b_along(u) b_across(v)

u is the cosine of a direction along the platform, v the sine of its angle to the face's normal, positive downwards, as
in `sonar.sidescan`; the two factors are `sonar.beam_shapes`. Directions are in the body's frame, and the body may move
and turn between transmission and reception.
"""
from __future__ import annotations

from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import held, upload
from mitsonar.device.types import DrJitArray, Float
from mitsonar.sonar.faces.beam_shapes import BeamShape
from mitsonar.sonar.faces.directivity import Aperture, sinc
from mitsonar.sonar.faces.sidescan import Sidescan

BEAM_EDGE = 0.25                   # two-way intensity at the edge of the main lobe (-6 dB)


class Lobes:
    """Lobes of a `BeamShape` on the device."""

    def __init__(self, shape: BeamShape, size: float):
        # size [wavelengths]
        self._floor = dr.opaque(mi.Float, shape.floor) if shape.floor else None
        self._shielded = shape.shielded
        self._size, self._table = dr.opaque(mi.Float, size), None
        if shape.table is not None:
            last = len(shape.table) - 1
            self._table = upload(mi.Float, shape.table.astype(np.float32))
            self._end, self._last = dr.opaque(mi.Float, last), dr.opaque(mi.UInt32, last - 1)
            self._per_sine = dr.opaque(mi.Float, 0.5 * last)
            dr.eval(self._table)

    def intensity(self, s: DrJitArray) -> DrJitArray:
        """Return b² at sines s."""
        return self._filled(s, dr.square(self._lobes(s)))

    def pressure(self, s: DrJitArray) -> DrJitArray:
        """Return b at sines s, with the sign of the pattern p without floor."""
        lobes = self._lobes(s)
        if self._floor is None:
            return lobes
        return dr.copysign(dr.sqrt(self._filled(s, dr.square(lobes))), lobes)

    def _filled(self, s, lobes):
        """Return the intensities of lobes at sines s, raised to the floor."""
        if self._floor is None:
            return lobes
        floor = self._floor * dr.clip(1 + s, 0, 1) if self._shielded else self._floor
        return dr.fma(lobes, 1 - floor, floor)

    def _lobes(self, s):
        """Return p at sines s."""
        if self._table is None:
            return sinc(s * self._size)
        place = cast(DrJitArray, held(cast(Float, (s + 1) * self._per_sine), 0.0, cast(Float, self._end)))
        below = dr.minimum(mi.UInt32(place), self._last)
        low, high = (dr.gather(mi.Float, self._table, below + end) for end in (0, 1))
        return dr.fma(place - mi.Float(below), high - low, low)


class SideFace:
    """Beam of a face on the device."""

    def __init__(self, face: Aperture, wavelength: float):
        # wavelength [m]
        self.along = Lobes(face.along_shape, face.length / wavelength)
        self.across = Lobes(face.across_shape, face.height / wavelength)

    def intensity(self, u: DrJitArray, v: DrJitArray) -> DrJitArray:
        """Return the one-way intensity of directions."""
        return self.along.intensity(u) * self.across.intensity(v)

    def pressure(self, u: DrJitArray, v: DrJitArray) -> DrJitArray:
        """Return the one-way pressure of directions."""
        return self.along.pressure(u) * self.across.pressure(v)


class FaceBeams:
    """Beams of the transmitting and of the receiving face, the same on either side."""

    def __init__(self, sonar: Sidescan):
        self.transmit = SideFace(sonar.transmit, sonar.wavelength)
        self.receive = self.transmit if sonar.one_face else SideFace(sonar.receive, sonar.wavelength)
        self.depression = dr.opaque(mi.Float, sonar.depression_angle)        # [rad]

    def across(self, body: mi.Vector3f) -> mi.Float:
        """Return v of body directions."""
        return body.z * dr.cos(self.depression) - abs(body.y) * dr.sin(self.depression)

    def two_way(self, u: DrJitArray, v: DrJitArray, back_u: DrJitArray,
                back_v: DrJitArray) -> tuple[DrJitArray, DrJitArray]:
        """Return the two-way intensity along and across the platform, sent to (u, v), received from the other pair."""
        return (_both(self.transmit.along, self.receive.along, u, back_u),
                _both(self.transmit.across, self.receive.across, v, back_v))

    def one_way(self, body: mi.Vector3f, face: SideFace) -> mi.Float:
        """Return the intensity of one face, `transmit` or `receive`, towards body directions."""
        return mi.Float(face.intensity(body.x, self.across(body)))

    def lobe(self, u: DrJitArray, back_u: DrJitArray) -> DrJitArray:
        """Return the two-way intensity along the platform that separates the main lobe from side lobes.

        Where the platform turns, the transmitted and the received lobe lie side by side. The middle of their product
        lies half-way.
        """
        middle = 0.5 * (u + back_u)
        return _both(self.transmit.along, self.receive.along, middle, middle)


def _both(transmit: Lobes, receive: Lobes, s: DrJitArray, back_s: DrJitArray) -> DrJitArray:
    """Return the product of intensities; one face that sends and receives in one direction is evaluated once."""
    sent = transmit.intensity(s)
    return dr.square(sent) if receive is transmit and back_s is s else sent * receive.intensity(back_s)
