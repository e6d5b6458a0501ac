"""Beams of a sidescan's faces on the device.

    b(u, v) = sinc(L u / λ) sinc(H v / λ)

u is the cosine of a direction along the platform, v the sine of its angle to the face's normal, downwards: symbols as
in `sonar.sidescan` and `sonar.directivity`. Directions are those of the body, whose faces may have moved and turned
between transmission and reception.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi

from ..device.types import DrJitArray
from ..sonar.directivity import sinc
from ..sonar.sidescan import Sidescan

__all__ = ["BEAM_EDGE", "FaceBeams"]

BEAM_EDGE = 0.25                   # two-way intensity at the edge of the main lobe (-6 dB)


class FaceBeams:
    """The beams of the transmitting and of the receiving face, the same on either side.

    Parameters
    ----------
    sonar : Sidescan

    Attributes
    ----------
    transmit, receive : (Float, Float) [-]
        Length and height of each face, in wavelengths.
    depression : Float [rad]
    """

    def __init__(self, sonar: Sidescan):
        self.transmit, self.receive = ([dr.opaque(mi.Float, side / sonar.wavelength)
                                        for side in (face.length, face.height)]
                                       for face in (sonar.transmit, sonar.receive))
        self.depression = dr.opaque(mi.Float, sonar.depression_angle)

    def across(self, body: mi.Vector3f) -> mi.Float:
        """Give v of body directions."""
        return body.z * dr.cos(self.depression) - abs(body.y) * dr.sin(self.depression)

    def two_way(self, u: DrJitArray, v: DrJitArray, back_u: DrJitArray,
                back_v: DrJitArray) -> tuple[DrJitArray, DrJitArray]:
        """Give the two-way intensity along and across the platform, of what is sent to (u, v) and comes from others."""
        return (dr.square(sinc(u * self.transmit[0]) * sinc(back_u * self.receive[0])),
                dr.square(sinc(v * self.transmit[1]) * sinc(back_v * self.receive[1])))

    def one_way(self, body: mi.Vector3f, face: list[mi.Float]) -> mi.Float:
        """Give the intensity of one face, `transmit` or `receive`, towards body directions."""
        return dr.square(sinc(body.x * face[0]) * sinc(self.across(body) * face[1]))

    def lobe(self, u: DrJitArray, back_u: DrJitArray) -> DrJitArray:
        """Give the two-way intensity along the platform by which the main lobe is told from side lobes.

        What is sent and what is received are lobes side by side where the platform turns. The middle of their product
        lies half-way.
        """
        middle = 0.5 * (u + back_u)
        return dr.square(sinc(middle * self.transmit[0]) * sinc(middle * self.receive[0]))
