"""The pings of a block as a rotating head receives echoes: when, how strongly, and how far shifted by Doppler.

    factor = (c + v·n') / (c - v·n)

n -> direction that an echo was sent in, n' -> that it is received from, v -> the head's velocity at the transmission, c
-> sound speed there. A row's factor is that of the beam's axis.
"""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from ...device.arrays import arrays_of, upload
from ...signal.beam_grid import RowGrid
from ...signal.beam_grid.residual_doppler import residual_doppler
from ..array_survey import ArraySurvey
from .beam import StepBeam
from .pairs import Pairs
from ..underway import Underway

__all__ = ["StepReceiver"]

SLOWEST = 1e-9                     # [m/s]: a head that is slower has no Doppler


class StepReceiver:
    """Receive the echoes of a block of pings.

    Parameters
    ----------
    survey : ArraySurvey
    beam : StepBeam
    underway : Underway
    ping : (B,) int
        Numbers of the pings.

    Attributes
    ----------
    doppler : (B,) or None [-]
        Factors of the rows; None where nothing moves.
    """

    def __init__(self, survey: ArraySurvey, beam: StepBeam, underway: Underway, ping: np.ndarray):
        self._beam, self._motion, self._lib = beam, underway.motion(ping), arrays_of(mi.Float)
        rotation, velocity = survey.track.rotation()[ping], survey.velocity[ping]
        speed = survey.profile.at(-survey.track.position[ping, 2])
        self.doppler: np.ndarray | None = None
        if np.abs(velocity).max() > SLOWEST:
            closing = np.einsum("pk,pk->p", velocity, rotation[:, :, 0])
            self.doppler = (speed + closing) / (speed - closing)
        table = np.zeros((len(ping), 4, 4))
        table[:, :3, :3], table[:, 3, :3], table[:, 3, 3] = np.swapaxes(rotation, 1, 2), velocity, speed
        table[:, 0, 3] = 0.0 if self.doppler is None else self.doppler - 1
        self._table = upload(mi.Float, table.astype(np.float32))
        dr.eval(self._table)
        self._residual = residual_doppler(survey.pulse)
        self._numbers = [dr.opaque(mi.Float64, v) for v in (survey.frequency, survey.start, survey.sampling_rate)]

    def add(self, grid: RowGrid, pairs: Pairs) -> None:
        """Add echoes to the pings that hear them."""
        echoes, index, ping = pairs.echoes, pairs.index, pairs.row
        sent = dr.gather(mi.Vector3f, echoes.sent, index, pairs.active)
        towards = sent if echoes.towards is echoes.sent else dr.gather(mi.Vector3f, echoes.towards, index, pairs.active)
        delay = dr.gather(mi.Float64, echoes.delay, index, pairs.active)
        real, imaginary = (dr.gather(mi.Float, part, index, pairs.active) for part in (echoes.real, echoes.imaginary))
        x, y, z, moving = (dr.gather(self._lib.Array4f, self._table, 4 * ping + row, pairs.active) for row in range(4))
        heard = towards
        if self._motion is not None:
            distance = dr.gather(mi.Float, echoes.distance, index, pairs.active)
            received = self._motion.receive(ping, towards, distance, delay, moving[3])
            heard, delay = received.towards, received.delay
        pressure = self._beam.pressure(_along(x, y, z, sent), _along(x, y, z, heard))
        frequency, start, rate = self._numbers
        later, turned = mi.Float(0), mi.Float(0)
        if self.doppler is not None:
            velocity = mi.Vector3f(moving[0], moving[1], moving[2])
            closing, sending = dr.dot(velocity, towards), dr.dot(velocity, sent)
            rest = ((closing + sending) / (moving[3] - sending) - x[3]) / (1 + x[3])
            later, turned = self._residual.delay(rest), self._residual.phase(rest)
        cycles = delay * frequency
        sine, cosine = dr.sincos((mi.Float(cycles - dr.round(cycles)) - turned) * float(2 * np.pi))
        real, imaginary = real * cosine + imaginary * sine, imaginary * cosine - real * sine
        pressure = dr.select(pairs.active, pressure, 0)
        grid.add(column=mi.Float((delay + mi.Float64(later) - start) * rate), row=ping, real=real * pressure,
                 imaginary=imaginary * pressure)


def _along(x, y, z, direction):
    """Scene directions in the head's frame, whose axes are rows."""
    return mi.Vector3f(*(row[0] * direction.x + row[1] * direction.y + row[2] * direction.z for row in (x, y, z)))
