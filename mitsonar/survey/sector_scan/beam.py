"""The one beam of a rotating head, in the head's frame: x along the beam, y the way it turns, z across.

    b(u, v) = sinc(L u / λ) sinc(H v / λ),    u = d·y,  v = d·z;    nothing behind the face

L and H -> length and height of its face (`sonar.directivity`). Sound is sent to where the head looks at the
transmission and received from where it looks when the echo is back: lobes side by side, if it turns on meanwhile.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.types import Vector
from mitsonar.imaging.sidescan import mean_intensity, pulse_shares
from mitsonar.signal.matched_filtering import compression
from mitsonar.sonar.faces.directivity import Aperture
from mitsonar.sonar.faces.sidescan import Sidescan

from ..energy.face_beams import BEAM_EDGE, FaceBeams
from ..motion.places import Place
from ..pressure.array_survey import ArraySurvey


def face_of(survey: ArraySurvey) -> Sidescan:
    """Return the face and the pulse of a head: those of a sidescan's side that looks along the beam."""
    transmit, receive = (Aperture(length=array.length, height=array.height)
                         for array in (survey.transmit, survey.receive))
    return Sidescan(frequency=survey.frequency, source_level_db=survey.source_level_db,
                    pulse_length=compression(survey.pulse, survey.sampling_rate)[0],
                    transmit=transmit, receive=receive, depression_angle=0.0, sound_speed=survey.sound_speed(0))


class StepBeam:
    """Return the response of the beam of a head."""
    # bin_length [s]

    count = 1

    def __init__(self, face: Sidescan, bin_length: float):
        self._faces, self._shares = FaceBeams(face), pulse_shares(bin_length, face.pulse_length)

    def two_way(self, sent: mi.Vector3f, back: mi.Vector3f) -> tuple[mi.Float, mi.Bool]:
        """Return the two-way intensity, and whether it is the main lobe's, of directions of the head's frame."""
        along, across = self._faces.two_way(sent.y, sent.z, back.y, back.z)
        pattern = dr.select((sent.x >= 0) & (back.x >= 0), along * across, 0)
        return mi.Float(pattern), mi.Bool(self._faces.lobe(sent.y, back.y) > BEAM_EDGE)

    def receive(self, place: Place, ping: mi.UInt32, sent: Vector, towards: Vector) -> tuple[mi.UInt32, mi.Float]:
        """Return the beam that receives echoes, which is the only one, and its two-way intensity."""
        # ping (R,); sent, towards (R,)
        pattern, _ = self.two_way(place.body(ping, sent), place.body(ping, towards))
        return dr.zeros(mi.UInt32, dr.width(pattern)), pattern

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return the mean level that the pulse makes of intensities (rows, ..., bins)."""
        return mean_intensity(intensity, self._shares)
