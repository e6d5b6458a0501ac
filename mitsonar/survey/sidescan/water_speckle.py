"""Speckle of the gates of a sidescan that hold no ground, as those of the water above it."""
from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, looped, upload
from mitsonar.device.chance import Salt, gaussian, hashed, hashed_pair, uniform
from mitsonar.signal.gates import speckle_gates

from ..energy.sidescan_survey import SidescanSurvey
from ..motion.places import PingPoses
from .side_beam import NEAREST, GateBeam

EMPTY = 1e-4                       # sum of |w|² below which a gate has scatterers of the water
WATER_CELLS = 12                   # cells along the track within the lobe


class WaterCells:
    """Scatterers of the water, hashed in cells along the track, on a level with the sonar.

    Cells lie along the course, rounded to one of `COURSES` directions over half a turn, and are anchored in the scene.
    """

    COURSES = 16

    def __init__(self, survey: SidescanSurvey):
        self._lib, self._survey, window = arrays_of(mi.Float), survey, survey.window
        self._seed = dr.opaque(mi.UInt32, survey.world.seed & 0xFFFFFFFF)
        speed, pulse_length = survey.sonar.sound_speed, survey.sonar.pulse_length
        gates = survey.bins * speckle_gates(survey.bin_length, pulse_length)
        self._begin, self._step = (dr.opaque(mi.Float, 0.5 * speed * value)
                                   for value in (window[0], (window[1] - window[0]) / gates))
        self._speed, self._twice = dr.opaque(mi.Float, speed), dr.opaque(mi.Float, 4 * np.pi / survey.sonar.wavelength)

    def _rows(self, ping: np.ndarray) -> np.ndarray:
        """Return place and speed along the rounded course, this course, and what else a row needs, of pings (B, 8)."""
        track, velocity = self._survey.track, self._survey.voyage.velocity[ping]
        forward = track.rotation(ping)[:, :2, 0]
        moving = np.linalg.norm(velocity[:, :2], axis=1) > 1e-3
        course = np.where(moving, np.arctan2(velocity[:, 1], velocity[:, 0]), np.arctan2(forward[:, 1], forward[:, 0]))
        number = np.round(course / (np.pi / self.COURSES)).astype(int) % self.COURSES
        ahead = np.stack([np.cos(number * np.pi / self.COURSES), np.sin(number * np.pi / self.COURSES)], -1)
        # to starboard of the rounded course, or to port of it where the sonar goes the other way
        turned = np.where(np.sum(forward * ahead, 1) > 0, 1.0, -1.0)
        return np.concatenate([
            np.sum(track.position[ping, :2] * ahead, 1)[:, None], np.sum(velocity[:, :2] * ahead, 1)[:, None], ahead,
            turned[:, None], number[:, None], np.zeros((len(ahead), 2))], 1)

    def added(self, ping: np.ndarray, poses: PingPoses, beam: GateBeam, thread: mi.UInt32, count: mi.UInt32,
              sums: tuple[mi.Float, mi.Float, mi.Float], later: mi.UInt32) -> tuple[mi.Float, mi.Float]:
        """Return g of gates (R,) from their sums Σ w a e and Σ |w|², with the water's where there is no ground.

        Gates that begin by so many steps `later` have scatterers of the water of their own.
        """
        row = thread // count
        gate, which = thread - row * count, row >> 1
        table = upload(mi.Float64, self._rows(ping))
        low, high = (dr.gather(self._lib.Array4f64, table, 2 * which + half) for half in (0, 1))
        near = dr.maximum(self._begin + mi.Float(gate) * self._step, 0)
        R = dr.maximum(near + 0.5 * self._step, NEAREST)
        # of the point abeam at which u is 0, along the rounded course, from the sonar half-way of the time
        axis = poses.axis(which)
        along, across = (mi.Float(low[2]) * axis.x + mi.Float(low[3]) * axis.y,
                         mi.Float(low[3]) * axis.x - mi.Float(low[2]) * axis.y)
        starboard = (mi.Float(row & 1) * 2 - 1) * mi.Float(high[0])
        steep = dr.maximum(abs(along), 0.1)
        along = dr.select(along < 0, -steep, steep)
        abeam, half = -starboard * across / along * R, beam.edge(gate) * R / steep
        power = dr.floor(dr.log2(2 * half / WATER_CELLS))
        length = mi.Float64(dr.exp2(power))
        place = low[0] + low[1] * mi.Float64(R / self._speed)
        first, last = (dr.floor((place + mi.Float64(abeam + end)) / length) for end in (-half, half))
        key = hashed(self._lib, self._seed ^ mi.UInt32(Salt.WATER_SPECKLE), mi.UInt32(high[1]),
                     mi.UInt32(mi.Int32(power)), gate, dr.select(starboard > 0, mi.UInt32(1), 0))
        key = dr.select(later == 0, key, hashed(self._lib, key, later))
        empty, lobe = sums[2] < EMPTY, beam.lobe(gate)

        def step(cell: mi.Float64, last: mi.Float64, real: mi.Float, imaginary: mi.Float,
                 weight: mi.Float) -> tuple[mi.Float64, mi.Float64, mi.Float, mi.Float, mi.Float]:
            bits = hashed(self._lib, key, mi.UInt32(mi.Int32(cell)))
            s = mi.Float((cell + mi.Float64(uniform(self._lib, bits))) * length - place)
            u = (s * along + starboard * across * dr.sqrt(dr.maximum(R * R - s * s, 0))) / R
            b_real, b_imaginary = beam.pressure(lobe, u, mi.Bool(True))
            later = s * s / (2 * R)
            a_real, a_imaginary = gaussian(self._lib, *hashed_pair(self._lib, bits), -self._twice * mi.Float(later))
            return (cell + 1, last, real + (b_real * a_real - b_imaginary * a_imaginary),
                    imaginary + (b_real * a_imaginary + b_imaginary * a_real),
                    weight + dr.square(b_real) + dr.square(b_imaginary))

        real, imaginary, weight = (dr.select(empty, 0, part) for part in sums)
        _, _, real, imaginary, weight = looped(
            (dr.select(empty, first, last + 1), last, real, imaginary, weight), lambda cell, last, *_: cell <= last,
            step, "cells of the water")
        scale = dr.rsqrt(dr.maximum(weight, 1e-12))
        return real * scale, imaginary * scale
