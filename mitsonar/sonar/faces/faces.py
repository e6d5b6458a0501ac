"""Construction of a sidescan's faces, whatever the water; their beams follow from it.

    L = x_3dB λ / sin(Δ / 2)

Δ -> full width at -3 dB, one way, x_3dB -> `beam_shapes.half_power` of its window and sag, λ the wavelength at the
head. A measured beam has a width of its own.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .beam_shapes import BeamShape, half_power, line_shape, measured_shape
from .directivity import Aperture, length_for_beam_width


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredBeam:
    """One-way levels of a beam in one plane."""

    angle: np.ndarray  # (K,) [rad]: to the normal, increasing
    level_db: np.ndarray  # (K,) [dB]


@dataclass(frozen=True, kw_only=True)
class BuiltFace:
    """A face."""

    width: float  # [rad]: full one-way -3 dB beam width along the platform
    vertical_width: float  # [rad]: likewise, across
    window: str = "boxcar"  # shading along the platform, one of `shading.WINDOWS`
    sag: float = 0.0  # [wavelengths]: how far the edges stand back across the platform
    floor: float = 0.0  # mean power of diffuse side lobes along, relative to the axis
    vertical_floor: float = 0.0  # likewise, across
    pattern: MeasuredBeam | None = None  # measured pattern along, instead of that of the width
    vertical_pattern: MeasuredBeam | None = None  # likewise, across

    def aperture(self, wavelength: float) -> Aperture:
        """Return the face at a wavelength [m]."""
        length, along = _side(self.width, wavelength, self.window, 0.0, self.floor, False, self.pattern)
        height, across = _side(self.vertical_width, wavelength, "boxcar", self.sag, self.vertical_floor,
                               True, self.vertical_pattern)
        return Aperture(length=length, height=height, along_shape=along, across_shape=across)


def _side(width: float, wavelength: float, window: str, sag: float, floor: float, shielded: bool,
          measured: MeasuredBeam | None) -> tuple[float, BeamShape]:
    """Return the side [m] that makes a beam in its plane, and that beam."""
    if measured is not None:
        shape, width = measured_shape(measured.angle, measured.level_db)
        return length_for_beam_width(width, wavelength), shape
    # an even line has its closed form to the last digit
    flat = window.split() == ["boxcar"] and not sag
    side = (length_for_beam_width(width, wavelength) if flat
            else length_for_beam_width(width, wavelength, half_power(window, sag)))
    return side, line_shape(side / wavelength, window=window, sag=sag, floor=floor, shielded=shielded)
