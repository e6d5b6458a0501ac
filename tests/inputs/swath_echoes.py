"""Echoes of a bed in a fan of split beams, scatterer by scatterer and element by element.

Stands apart from the package: nothing of it is imported but the record that says what the sounder is like. Every
scatterer has a place, a complex Gaussian amplitude and a Gaussian pulse; every element of the receive array hears it
with the phase of its own place (far field, narrow band); beams are sums over the elements of each half.
"""
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse

from mitsonar.hydrography.detection.detection import Head

SOUND_SPEED = 1500.0


def lambertian(incidence):
    """Lambert's law, -20 dB at normal incidence."""
    return 0.01 * np.cos(incidence) ** 2 + 1e-4


def specular(incidence):
    """The same with a lobe of 15 dB about normal incidence."""
    return lambertian(incidence) + 0.3 * np.exp(-(incidence / 0.15) ** 2)


@dataclass(frozen=True, kw_only=True)
class Sounder:
    """Receive array of half-wavelength spacing, beams, pulse, clock."""

    beam_deg: float = 1.0              # -3 dB at broadside
    fan_deg: float = 70.0
    beams: int = 141
    pulse: float = 1e-4                # ∫|χ|² dt [s]
    along_deg: float = 1.0             # transmit, -3 dB, Gaussian
    duration: float = 0.1
    samples_per_pulse: float = 2.0
    taper: float = 0.0                 # 0 none, 1 a cosine

    @cached_property
    def time(self):
        step = self.pulse / self.samples_per_pulse
        return 1e-4 + step * np.arange(int(self.duration / step))

    @property
    def sines(self):
        return np.sin(np.radians(np.linspace(-self.fan_deg, self.fan_deg, self.beams)))

    @cached_property
    def elements(self):                # even number, wavelengths
        number = 2 * int(np.ceil(0.886 / np.radians(self.beam_deg)))
        return (np.arange(number) - (number - 1) / 2) / 2

    @property
    def shading(self):
        places = self.elements
        return 1 - self.taper + self.taper * np.cos(np.pi * places / (2 * places.max() + 0.5))

    @property
    def baseline(self):                # between the shaded halves' phase centres
        upper = self.elements > 0
        return 2 * np.average(self.elements[upper], weights=self.shading[upper])

    @cached_property
    def beam_widths(self):
        """-3 dB widths of the beams, measured on their pattern."""
        offsets = np.linspace(0, 3, 3001) * np.radians(self.beam_deg)
        pattern = np.abs(np.exp(2j * np.pi * np.outer(offsets, self.elements)) @ self.shading) / self.shading.sum()
        return 2 * offsets[np.argmin(pattern > np.sqrt(0.5))] / np.sqrt(1 - self.sines ** 2)

    @cached_property
    def pattern_integral(self):
        """∫ of the beam's power pattern over the sine."""
        offsets = np.linspace(-0.5, 0.5, 20001)
        pattern = np.abs(np.exp(2j * np.pi * np.outer(offsets, self.elements)) @ self.shading) / self.shading.sum()
        return np.trapezoid(pattern ** 2, offsets)

    @property
    def along_sigma(self):
        return np.radians(self.along_deg) / 2.3548


def bed(sounder, chance, *, depth=20.0, slope_deg=0.0, strength=lambda incidence: np.ones_like(incidence), per_cell=5,
        relief=lambda y: np.zeros_like(y)):
    """Scatterers (places x, y, z; amplitudes) of a plane bed: depth under the sonar, down to starboard if positive.

    Mean square amplitude per area is ``strength`` of the incidence angle; spherical spreading both ways is in it.
    """
    reach = sounder.time[-1] * SOUND_SPEED / 2
    limit = np.sqrt(max(reach ** 2 - (0.5 * depth) ** 2, 1))
    number = int(2 * limit / (SOUND_SPEED * sounder.pulse / 2) * per_cell)
    y = chance.uniform(-limit, limit, number)
    tilt = np.tan(np.radians(slope_deg))
    z = depth + tilt * y + relief(y)
    keep = z > 0.1 * depth
    y, z = y[keep], z[keep]
    width = 3 * sounder.along_sigma * np.hypot(y, z)
    x = chance.uniform(-1, 1, len(y)) * width
    area = 2 * limit * np.hypot(1, tilt) * 2 * width / number
    slant = np.sqrt(x ** 2 + y ** 2 + z ** 2)
    incidence = np.arccos(np.clip((z - y * tilt) / np.hypot(1, tilt) / slant, 0, 1))
    along = np.exp(-0.5 * (x / slant / sounder.along_sigma) ** 2)            # power
    power = strength(incidence) * area * along / slant ** 4
    amplitude = np.sqrt(power / 2) * (chance.standard_normal(len(y)) + 1j * chance.standard_normal(len(y)))
    return np.stack([x, y, z]), amplitude


def with_point(places, amplitudes, *, across, depth, amplitude):
    """Scatterers and one more."""
    return np.concatenate([places, [[0.0], [across], [depth]]], axis=1), np.append(amplitudes, amplitude)


def head_of(sounder, **changes):
    """What a detector is told of the sounder."""
    return Head(**{"pulse_length": sounder.pulse, "beam_width": sounder.beam_widths, "baseline": sounder.baseline,
                   "transmit_width": np.radians(sounder.along_deg), **changes})


def time_of_plane(sounder, depth, slope_deg=0.0):
    """When each beam's axis meets the plane [s]."""
    angle = np.arcsin(sounder.sines)
    return 2 * depth / SOUND_SPEED / (np.cos(angle) - np.tan(np.radians(slope_deg)) * np.sin(angle))


def halves(sounder, places, amplitudes, chance, *, noise_db=None):
    """Beams of both halves (B, T), complex64.

    ``noise_db`` is the noise in the whole beam over the median of the beams' greatest intensities.
    """
    time, step = sounder.time, sounder.pulse / sounder.samples_per_pulse
    slant = np.sqrt(np.sum(places ** 2, axis=0))
    delay, sine = 2 * slant / SOUND_SPEED, places[1] / slant
    width = sounder.pulse / np.sqrt(2 * np.pi)                               # of |χ|²
    reach = int(np.ceil(6 * width / step))
    first = np.floor((delay - time[0]) / step).astype(int)
    rows = first[:, None] + np.arange(-reach, reach + 1)
    shape = np.exp(-((time[0] + rows * step - delay[:, None]) / (2 * width)) ** 2)
    columns = np.broadcast_to(np.arange(len(delay))[:, None], rows.shape)
    inside = (rows >= 0) & (rows < len(time))
    pulses = sparse.csr_matrix((shape[inside].astype(np.float32), (rows[inside], columns[inside])),
                               shape=(len(time), len(delay)))
    heard = amplitudes[:, None] * np.exp(2j * np.pi * np.outer(sine, sounder.elements))
    signals = pulses @ heard.astype(np.complex64)
    out = []
    for side in (sounder.elements < 0, sounder.elements > 0):
        weights = sounder.shading[side] / sounder.shading[side].sum()
        steer = weights * np.exp(-2j * np.pi * np.outer(sounder.sines, sounder.elements[side]))
        beams = np.ascontiguousarray((signals[:, side] @ steer.T.astype(np.complex64)).T)
        out.append(beams)
    if noise_db is not None:
        noise = np.median((np.abs(out[0] + out[1]) ** 2 / 4).max(axis=1)) * 10 ** (noise_db / 10)
        for beams in out:
            beams += np.sqrt(2 * noise) * coloured(sounder, beams.shape, chance)
    return out[0], out[1]


def coloured(sounder, shape, chance):
    """Noise of mean power 1 with the pulse's spectrum."""
    step, width = sounder.pulse / sounder.samples_per_pulse, sounder.pulse / np.sqrt(2 * np.pi)
    white = chance.standard_normal((*shape, 2)).astype(np.float32).view(np.complex64)[..., 0]
    lags = np.arange(-8, 9) * step
    kernel = np.exp(-(lags / (2 * width)) ** 2 * 2)
    kernel = (kernel / np.sqrt(np.sum(kernel ** 2) * 2)).astype(np.float32)
    return sum(np.roll(white, lag, axis=1) * weight for lag, weight in zip(range(-8, 9), kernel, strict=True))
