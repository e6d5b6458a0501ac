"""Far-field pressure patterns of continuous apertures.

    b(u, v) = sinc(L u / λ) sinc(H v / λ),   sinc(x) = sin(πx)/(πx)

L -> ``length`` along u, H -> ``height`` along v [m], λ -> ``wavelength`` [m]; u and v are the direction's cosines along
the two sides. The full width at -3 dB (one way) is 2 asin(0.44294647 λ / L) (e.g. Urick 1983, ch. 3; physics of line
arrays), and an aperture of zero height is a line, omnidirectional around its axis. Faces that are shaded, curved,
measured or built with errors have another beam in either plane (`beam_shapes`).
"""
from dataclasses import dataclass

import drjit as dr
import numpy as np

from mitsonar.device.types import Numbers

from .beam_shapes import EVEN, BeamShape

HALF_POWER = 0.44294647069         # sinc² = 1/2
FINER = 16                         # steps within those of a table, to find where it falls to a half


def sinc(x: Numbers) -> Numbers:
    """Return sin(πx)/(πx) of a NumPy or Dr.Jit array."""
    if isinstance(x, (np.ndarray, float)):
        return np.sinc(x)
    x = np.pi * x
    return dr.select(abs(x) < 1e-3, 1 - x * x / 6, dr.sin(x) / x)


def length_for_beam_width(beam_width: float, wavelength: float, half_power: float = HALF_POWER) -> float:
    """Return the side [m] whose full one-way -3 dB beam is `beam_width` [rad]; 0 for π or more (no beam).

    `half_power` is the x = L s / λ where the power of its beam is a half, see `beam_shapes.half_power`.
    """
    if beam_width >= np.pi:
        return 0.0
    return half_power * wavelength / np.sin(0.5 * beam_width)


@dataclass(frozen=True, kw_only=True)
class Aperture:
    """A rectangular transducer face, or a line where `height` is 0.

    Attributes
    ----------
    length : float [m]
        Side along the platform.
    height : float [m]
        Side across.
    along_shape, across_shape : BeamShape
        Beams in the planes of either side; by default those of an even face.
    """

    length: float
    height: float = 0.0
    along_shape: BeamShape = EVEN
    across_shape: BeamShape = EVEN

    def __post_init__(self):
        for name in ("length", "height"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise ValueError(f"aperture {name} is {value} m; give a finite size >= 0 (0: omnidirectional)")

    def along(self, u: Numbers, wavelength: Numbers) -> Numbers:
        """Return the pressure pattern along the platform, of the direction cosine u [-]."""
        return self.along_shape.pressure(u, self.length / wavelength)

    def across(self, v: Numbers, wavelength: Numbers) -> Numbers:
        """Return the pressure pattern across, of the direction cosine v [-]."""
        return self.across_shape.pressure(v, self.height / wavelength)

    def beam_widths(self, wavelength: float) -> tuple[float, float]:
        """Return the full one-way -3 dB widths along and across [rad]; π where a side makes no beam."""
        along, across = (_width(side / wavelength, shape) for side, shape in
                         ((self.length, self.along_shape), (self.height, self.across_shape)))
        return along, across


def _width(size: float, shape: BeamShape) -> float:
    if shape.table is None:
        return float(2 * np.arcsin(min(1.0, HALF_POWER / size))) if size > 0 else np.pi
    s = np.linspace(-1, 1, FINER * (len(shape.table) - 1) + 1)
    loud = s[np.interp(s, s[::FINER], np.abs(shape.table)) >= np.sqrt(0.5)]
    return float(np.arcsin(loud[-1]) - np.arcsin(loud[0]))
