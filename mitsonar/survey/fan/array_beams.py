"""The beams of an array: which beam receives a direction, how strongly, and what a picture of them shows.

A fan tells directions apart by the angle ψ = arcsin(d·a) about its axis a, and a line of elements by that alone: every
direction d belongs to the beam whose ψ is the nearest. What beam b shows is what all beams receive,

    shown_b = Σ_b' M_bb' E_b',    M_bb' = mean over beam b' of |Σ_e w_e e^(ik r_e·(û(ψ) - û_b))|²

smeared over range by the compressed pulse, a sinc of the signal's bandwidth. Elements' patterns, the transmit array's,
and of a receive array that is no line its pattern off the fan's plane weigh the echoes themselves.

The far-field sum of an array's elements, on the device.

    F(d) = Σ_e w_e e^(i2π(x_e·d - t_e))

x_e -> places in wavelengths, t_e -> drive delays in cycles, w_e weights, d unit vectors in the places' frame.
"""
from __future__ import annotations

from collections.abc import Callable
from typing import cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held, opaque_vector, upload
from mitsonar.device.types import Float, Vector
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.sonar.arrays.array import Array

from ..motion.places import Place
from ..pressure.array_survey import ArraySurvey

FINER = 64                         # places of a line's table, over those that resolve it: read within 3e-4
STRAIGHT = 1e-3                    # wavelengths that elements may stand off a line


class ArraySum:
    """Sum the elements of an array that have a weight."""
    # place (E, 3) [wavelengths]; weight (E,) [-]; late (E,) [cycles]

    def __init__(self, place: np.ndarray, weight: np.ndarray, late: np.ndarray):
        working = np.flatnonzero(weight)
        self._table = np.concatenate([place[working], late[working, None]], 1)
        self._weight = upload(mi.Float, weight[working].astype(np.float32))
        self._count = dr.opaque(mi.UInt32, len(working))
        dr.eval(self._weight)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray | None = None) -> tuple[mi.Float, mi.Float]:
        """Return real and imaginary part of F."""
        # direction (R,); rotation (3, 3)
        table = self._table
        if rotation is not None:
            table = np.concatenate([table[:, :3] @ rotation.T, table[:, 3:]], 1)
        on_device = upload(mi.Float, table.astype(np.float32))
        dr.eval(on_device)
        return _summed(on_device, self._weight, self._count, direction)


class LineSum:
    """Sum the elements of a line from a table: F is a function of the sine along it."""
    # axis (3,) [-]; place (E, 3) [wavelengths]; weight (E,) [-]; late (E,) [cycles]

    def __init__(self, axis: np.ndarray, place: np.ndarray, weight: np.ndarray, late: np.ndarray):
        along = place @ axis
        # a direction less what steers it has sines up to 2
        count = int(np.ceil(4 * FINER * max(np.abs(along).max(), 1))) + 1
        sine = np.linspace(-2, 2, count)
        values = np.concatenate([np.exp(2j * np.pi * (some[:, None] * along - late)) @ weight
                                 for some in np.array_split(sine, -(-count // 4096))])
        self._axis, self._nodes = axis, count
        self._table = upload(mi.Float, values.astype(np.complex64).view(np.float32))
        dr.eval(self._table)

    def of(self, direction: mi.Vector3f, rotation: np.ndarray | None = None) -> tuple[mi.Float, mi.Float]:
        """Return real and imaginary part of F; see `ArraySum.of`."""
        axis = self._axis if rotation is None else rotation @ self._axis
        sine = dr.dot(direction, opaque_vector(mi.Vector3f, axis))
        place = held((sine + 2) * dr.opaque(mi.Float, (self._nodes - 1) / 4), 0.0,
                     dr.opaque(mi.Float, self._nodes - 1.001))
        node = mi.UInt32(place)
        share = place - mi.Float(node)
        low, high = (dr.gather(arrays_of(mi.Float).Array2f, self._table, node + step) for step in (0, 1))
        value = low + (high - low) * share
        return value.x, value.y


def along_a_line(place: np.ndarray) -> np.ndarray | None:
    """Return the unit vector of the line through 0 that places (E, 3) [wavelengths] lie on, None where there is none.
    """
    _, _, axes = np.linalg.svd(place, full_matrices=False)
    axis = axes[0]
    off = place - np.outer(place @ axis, axis)
    return axis if np.abs(off).max() <= STRAIGHT else None


@dr.syntax
def _summed(table, weight, count, direction):
    """Return F of `count` rows (x, t) of a table."""
    real, imaginary = mi.Float(0), mi.Float(0)
    i = mi.UInt32(0)
    while i < count:
        x, y = dr.gather(mi.Float, table, 4 * i), dr.gather(mi.Float, table, 4 * i + 1)
        z, t = dr.gather(mi.Float, table, 4 * i + 2), dr.gather(mi.Float, table, 4 * i + 3)
        w = dr.gather(mi.Float, weight, i)
        turns = x * direction.x + y * direction.y + z * direction.z - t
        sine, cosine = dr.sincos((turns - dr.round(turns)) * float(2 * np.pi))
        real, imaginary = real + w * cosine, imaginary + w * sine
        i += 1
    return real, imaginary


PARTS = 8                          # directions in a beam that its pattern is averaged over
FLAT = 0.1                         # wavelengths that elements of a line may stand off it
REACH = 3                          # samples to either side that the compressed pulse is followed


class ArrayBeams:
    """Return the beams that receive directions, their patterns, and pictures of them."""
    # angle (B,) [rad]; direction (B,) [rad]

    def __init__(self, survey: ArraySurvey, angle: np.ndarray, direction: np.ndarray):
        self._receive, self._angle, self.count = survey.receive, np.asarray(angle, float), len(angle)
        self._by_sine = self.count > 2 and not _even(self._angle)
        self._wavelength = survey.sound_speed(0) / survey.frequency
        turned = float(np.linalg.norm(survey.voyage.turn_rate, axis=1).max()) * survey.time[-1]
        elements = ElementBeams(survey.transmit, survey.receive, self._wavelength, turned)
        self.pattern: Callable | None = elements.intensity if elements else None
        self._axis, self._normal = _axes(self._angle, np.asarray(direction, float))
        off = survey.receive.position - np.outer(survey.receive.position @ self._axis, self._axis)
        flat = np.abs(off - off.mean(0)).max() <= FLAT * self._wavelength
        self._off_plane = None if flat else _elements(survey.receive, self._wavelength)
        self._sent = None
        if np.count_nonzero(survey.transmit.weight) > 1:
            self._sent = _elements(survey.transmit, self._wavelength, survey.frequency)
        self._mixing = self._mixed()
        share = survey.pulse.bandwidth / survey.sampling_rate
        spread = np.sinc(share * np.arange(-REACH, REACH + 1)) ** 2
        self._spread = spread / spread.sum()

    def receive(self, place: Place, ping: mi.UInt32, sent: Vector,
                towards: Vector) -> tuple[mi.UInt32, mi.Float]:
        """Return the beam that receives echoes, and its two-way intensity."""
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
        """Return what the picture makes of intensities (B, ..., bins)."""
        return self._smeared(np.tensordot(self._mixing, intensity, 1))

    def shown_transposed(self, cotangent: np.ndarray) -> np.ndarray:
        """Return the transpose of `shown`, of weights (B, ..., bins)."""
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
    """|F|² towards body directions."""
    real, imaginary = elements.of(direction)
    return real * real + imaginary * imaginary


def _even(values: np.ndarray) -> bool:
    """Return True if values (N,) have equal steps."""
    return bool(np.allclose(values, np.linspace(values[0], values[-1], len(values)), rtol=0, atol=1e-7))


def _axes(angle: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return axis and normal of a fan, unit vectors: û = n cos ψ + a sin ψ. A single beam needs no axis, which is 0."""
    if len(angle) == 1:
        return np.zeros(3), direction[0]
    normal, axis = np.linalg.lstsq(np.stack([np.cos(angle), np.sin(angle)], 1), direction, rcond=None)[0]
    return axis / np.linalg.norm(axis), normal / np.linalg.norm(normal)
