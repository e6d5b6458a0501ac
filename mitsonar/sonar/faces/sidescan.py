"""Sidescan sonar: its pulse, faces and receiver.

Each side has its own face on the platform's body (x forward, y starboard, z down): the normal lies in the athwart
plane, `depression_angle` below horizontal, the length along x, the height across. Directions from a face are written

    d_body = (u, ± sqrt(1 - u²) cos φ, sqrt(1 - u²) sin φ)            + starboard, - port

u the cosine along x, φ the depression in the athwart plane; dΩ = du dφ. A face receives nothing from behind it, that
is from the other side of the body (a hard baffle in the plane y = 0); what leaks through the baffle is the other side's
own record, fainter (`imaging.recorder`).
"""
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mitsonar.device.types import Numbers

from .directivity import Aperture

SIDES = ("port", "starboard")


@dataclass(frozen=True, kw_only=True)
class Sidescan:
    """Settings of a sidescan.

    Attributes
    ----------
    frequency : float [Hz]
    source_level_db : float [dB re 1 µPa @ 1 m]
        Source level on the axis of each face, rms over the pulse.
    pulse_length : float [s]
        Effective length of the (compressed) pulse: its bandwidth is the inverse.
    transmit, receive : Aperture
    depression_angle : float [rad]
        Angle of the faces' normals below the horizontal.
    sound_speed : float [m/s]
        Sound speed at the head, by which the sonar converts time to slant range.
    """

    frequency: float
    source_level_db: float
    pulse_length: float
    transmit: Aperture
    receive: Aperture
    depression_angle: float
    sound_speed: float

    def __post_init__(self):
        for name, unit in (("frequency", "Hz"), ("pulse_length", "s"), ("sound_speed", "m/s")):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ValueError(f"sidescan {name} is {value} {unit}; give a finite number above 0")

    @property
    def wavelength(self) -> float:
        """Wavelength at the head [m]."""
        return self.sound_speed / self.frequency

    @property
    def bandwidth(self) -> float:
        """Receiver bandwidth [Hz], matched to the pulse."""
        return 1.0 / self.pulse_length

    @property
    def resolution(self) -> float:
        """Length of the resolution cell in slant range [m]."""
        return 0.5 * self.sound_speed * self.pulse_length

    @property
    def longest(self) -> float:
        """Length of the longer face [m], a wavelength at least."""
        return max(self.transmit.length, self.receive.length, self.wavelength)

    @property
    def one_face(self) -> bool:
        """Return True if the same face of a side transmits and receives."""
        return self.transmit == self.receive

    def along_intensity(self, u: Numbers, u_back: Numbers | None = None) -> Numbers:
        """Return the two-way intensity pattern along the platform of cosines u, and `u_back` at reception."""
        sent = self.transmit.along(u, self.wavelength)
        if u_back is None and self.one_face:
            return (sent * sent) ** 2
        return (sent * self.receive.along(u if u_back is None else u_back, self.wavelength)) ** 2

    def across_intensity(self, v: Numbers) -> Numbers:
        """Return the two-way intensity pattern across, of the cosine v = sqrt(1 - u²) sin(φ - depression)."""
        sent = self.transmit.across(v, self.wavelength)
        return (sent * (sent if self.one_face else self.receive.across(v, self.wavelength))) ** 2

    def solid_angle(self) -> float:
        """Integrate the two-way equivalent beam ∫ b_t² b_r² dΩ of one face [sr]."""
        return _solid_angle(self)

    def directivity_index_db(self) -> float:
        """Return the receive directivity index 10 log 4π/∫ b_r² dΩ [dB], against isotropic noise."""
        return float(10 * np.log10(4 * np.pi / _receiving_solid_angle(self)))


# Integrals take longer than many a render; scenes that follow one another mostly have the same sonar.
@lru_cache(maxsize=16)
def _solid_angle(sonar: Sidescan) -> float:
    """Integrate ∫ b_t² b_r² dΩ."""
    return _over_directions(sonar.along_intensity, sonar.across_intensity, sonar.depression_angle)


@lru_cache(maxsize=16)
def _receiving_solid_angle(sonar: Sidescan) -> float:
    """Integrate ∫ b_r² dΩ."""
    return _over_directions(lambda u: sonar.receive.along(u, sonar.wavelength) ** 2,
                            lambda v: sonar.receive.across(v, sonar.wavelength) ** 2, sonar.depression_angle)


def _over_directions(along: Callable[[Numbers], Numbers], across: Callable[[Numbers], Numbers],
                     depression_angle: float) -> float:
    """Integrate along(u) across(v) du dφ over the half space of a face, v = sqrt(1 - u²) sin(φ - depression)."""
    phi = np.linspace(-np.pi / 2, np.pi / 2, 8001) - depression_angle
    sine = np.sin(phi)
    w = np.linspace(0, 1, 129)
    ring = [np.trapezoid(across(root * sine), phi) for root in w]                    # smooth in w = sqrt(1 - u²)
    u = np.linspace(-1, 1, 200001)
    return float(np.trapezoid(along(u) * np.interp(np.sqrt(1 - u * u), w, ring), u))
