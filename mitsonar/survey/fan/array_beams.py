"""Beams of an array's fan: the beam that receives a direction, its two-way intensity, and the picture's point spread.

A fan resolves directions by the angle ψ = arcsin(d·a) about its axis a, and a line of elements by ψ alone. Every
direction d belongs to the beam of the nearest ψ. The picture in beam b is a sum over the energies of all beams,

    shown_b = Σ_b' M_bb' E_b',    M_bb' = mean over beam b' of |Σ_e w_e e^(ik r_e·(û(ψ) - û_b))|²

smeared over range by the compressed pulse, a sinc of the signal's bandwidth. The patterns of the elements and of the
transmit array, and for a receive array that is not a line its pattern off the fan's plane, weight the echoes.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import held, opaque_vector
from mitsonar.device.types import Float, Vector
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.sonar.arrays.array import Array

from ..beam_domain.patterns import ArraySum
from ..motion.places import Place
from ..pressure.array_survey import ArraySurvey

PARTS = 8                          # directions in a beam over which its pattern is averaged
FLAT = 0.1                         # [wavelengths] largest distance of a line's elements from the line
REACH = 3                          # samples to either side over which the compressed pulse is summed


class ArrayBeams:
    """Fan of beams of an array, with angles (B,) [rad] and directions (B, 3)."""

    def __init__(self, survey: ArraySurvey, angle: np.ndarray, direction: np.ndarray):
        self._receive, self._angle, self.count = survey.receive, np.asarray(angle, float), len(angle)
        even = np.linspace(self._angle[0], self._angle[-1], self.count)
        self._by_sine = self.count > 2 and not np.allclose(self._angle, even, rtol=0, atol=1e-7)
        self._wavelength = survey.wavelength
        elements = ElementBeams(survey.transmit, survey.receive, self._wavelength)
        self.pattern: Callable | None = elements.intensity if elements else None
        self._axis, self._normal = _axes(self._angle, np.asarray(direction, float))
        off = survey.receive.position - np.outer(survey.receive.position @ self._axis, self._axis)
        flat = np.abs(off - off.mean(0)).max() <= FLAT * self._wavelength
        self._off_plane = None if flat else _elements(survey.receive, self._wavelength)
        self._sent = None
        if np.count_nonzero(survey.transmit.weight) > 1:
            self._sent = _elements(survey.transmit, self._wavelength, survey.frequency)
        self._mixing = self._mixed()
        spread = np.sinc(survey.pulse.bandwidth / survey.sampling_rate * np.arange(-REACH, REACH + 1)) ** 2
        self._spread = spread / spread.sum()

    def receive(self, place: Place, ping: mi.UInt32, sent: Vector,
                towards: Vector) -> tuple[mi.UInt32, mi.Float]:
        """Return the beam that receives each echo, and its two-way intensity."""
        # ping (R,); sent, towards (R,) -> beam (R,), pattern (R,)
        body, weight = place.body(ping, towards), mi.Float(1)
        beam = dr.zeros(mi.UInt32, dr.width(body))
        axis, normal = opaque_vector(mi.Vector3f, self._axis), opaque_vector(mi.Vector3f, self._normal)
        u = dr.clip(dr.dot(body, axis), -1, 1)
        if self.count > 1:
            ends = self._angle[[0, -1]]
            first, last = (dr.opaque(mi.Float, float(end)) for end in (np.sin(ends) if self._by_sine else ends))
            steps = dr.opaque(mi.Float, self.count - 1)
            number = dr.round(((u if self._by_sine else dr.asin(u)) - first) * steps / (last - first))
            inside = (number >= 0) & (number <= steps)
            beam = mi.UInt32(held(cast(Float, number), 0, cast(Float, steps)))
            weight = dr.select(inside, weight, 0)
        if self._off_plane is not None:
            in_plane = dr.sqrt(1 - u * u) * normal + u * axis
            weight *= _intensity(self._off_plane, body - in_plane)
        if self._sent is not None:
            weight *= _intensity(self._sent, place.body(ping, sent))
        if self.pattern is not None:
            weight *= self.pattern(sent, place.rotation[0])
        return beam, weight

    def shown(self, intensity: np.ndarray) -> np.ndarray:
        """Return the picture of intensities (B, ..., bins)."""
        return self._smeared(np.tensordot(self._mixing, intensity, 1))

    def shown_transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`, applied to weights (B, ..., bins)."""
        return np.tensordot(self._mixing.T, self._smeared(cotangent), 1)

    def _smeared(self, mixed: np.ndarray) -> np.ndarray:
        """Smear intensities (B, ..., bins) by the compressed pulse; the operation is symmetric."""
        padded = np.pad(mixed, [(0, 0)] * (mixed.ndim - 1) + [(REACH, REACH)])
        bins, total = mixed.shape[-1], self._spread[0] * padded[..., :mixed.shape[-1]]
        for k, weight in enumerate(self._spread[1:], 1):
            total += weight * padded[..., k:k + bins]
        return total

    def _mixed(self) -> np.ndarray:
        """Return M, (B, B)."""
        if self.count == 1:
            return np.ones((1, 1))
        angle, receive = self._angle, self._receive
        place = np.sin(angle) if self._by_sine else angle
        half = 0.5 * (place[-1] - place[0]) / (self.count - 1)
        fine = (place[:, None] + half * ((np.arange(PARTS) + 0.5) / PARTS * 2 - 1)).ravel()
        fine = np.arcsin(np.clip(fine, -1, 1)) if self._by_sine else fine
        k = 2 * np.pi / self._wavelength
        arriving, steered = (np.exp(1j * k * (np.cos(psi)[:, None] * self._normal + np.sin(psi)[:, None] * self._axis)
                                    @ receive.position.T) for psi in (fine, angle))
        weight = receive.weight / np.abs(receive.weight).sum()
        response = np.abs((steered.conj() * weight) @ arriving.T) ** 2
        return response.reshape(self.count, self.count, PARTS).mean(2)


def _elements(array: Array, wavelength: float, frequency: float = 0.0) -> ArraySum:
    """Return the sum of an array's elements, 1 at most; their delays count where a frequency [Hz] is given."""
    return ArraySum(array.position / wavelength, array.weight / np.abs(array.weight).sum(), frequency * array.delay)


def _intensity(elements: ArraySum, direction: mi.Vector3f) -> mi.Float:
    """Return |F|² towards body directions."""
    real, imaginary = elements.of(direction)
    return real * real + imaginary * imaginary


def _axes(angle: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axis a and normal n of a fan, unit vectors: û = n cos ψ + a sin ψ; the axis of a single beam is 0."""
    if len(angle) == 1:
        return np.zeros(3), direction[0]
    normal, axis = np.linalg.lstsq(np.stack([np.cos(angle), np.sin(angle)], 1), direction, rcond=None)[0]
    return axis / np.linalg.norm(axis), normal / np.linalg.norm(normal)
