"""How the faces of a sidescan are built, whatever the water: the sides that their beams need follow from it.

    L = x_3dB λ / sin(Δ / 2)

Δ -> full width at -3 dB, one way, x_3dB -> `beam_shapes.half_power` of its window and sag, λ the wavelength at the
head. A measured beam has a width of its own.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .beam_shapes import BeamShape, half_power, line_shape, measured_shape
from .directivity import Aperture, length_for_beam_width

__all__ = ["BuiltFace", "MeasuredBeam"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MeasuredBeam:
    """One-way levels of a beam in one plane.

    Attributes
    ----------
    angle : (K,) [rad]
        To the normal, increasing; forward along the platform, downwards across it.
    level_db : (K,) [dB]
    """

    angle: np.ndarray
    level_db: np.ndarray


@dataclass(frozen=True, kw_only=True)
class BuiltFace:
    """A face.

    Attributes
    ----------
    width, vertical_width : float [rad]
        Full one-way -3 dB beam widths along and across the platform; π: a point. Unused where a beam is measured.
    window : str
        Shading along the platform, one of `shading.WINDOWS`.
    sag : float [wavelengths]
        How far the edges stand back across the platform.
    floor, vertical_floor : float [-]
        Mean power of diffuse side lobes along and across, relative to the axis; unused where a beam is measured.
    pattern, vertical_pattern : MeasuredBeam or None
        Beams as measured, in place of those that widths make.
    """

    width: float
    vertical_width: float
    window: str = "boxcar"
    sag: float = 0.0
    floor: float = 0.0
    vertical_floor: float = 0.0
    pattern: MeasuredBeam | None = None
    vertical_pattern: MeasuredBeam | None = None

    def aperture(self, wavelength: float) -> Aperture:
        """Give the face at a wavelength [m].

        Raises
        ------
        ValueError
            If there is no such window, or a measured beam is none.
        """
        length, along = _side(self.width, wavelength, self.window, 0.0, self.floor, False, self.pattern)
        height, across = _side(self.vertical_width, wavelength, "boxcar", self.sag, self.vertical_floor,
                               True, self.vertical_pattern)
        return Aperture(length=length, height=height, along_shape=along, across_shape=across)


def _side(width: float, wavelength: float, window: str, sag: float, floor: float, shielded: bool,
          measured: MeasuredBeam | None) -> tuple[float, BeamShape]:
    """The side [m] that makes a beam in its plane, and that beam."""
    if measured is not None:
        shape, width = measured_shape(measured.angle, measured.level_db)
        return length_for_beam_width(width, wavelength), shape
    # an even line has its closed form to the last digit
    flat = window.split() == ["boxcar"] and not sag
    side = (length_for_beam_width(width, wavelength) if flat
            else length_for_beam_width(width, wavelength, half_power(window, sag)))
    return side, line_shape(side / wavelength, window=window, sag=sag, floor=floor, shielded=shielded)
