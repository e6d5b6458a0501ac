"""Plane waves reflected by smooth surfaces.

    R = (y - 1) / (y + 1),    y = ρ sin θ / P,    P = √(κ² - cos²θ),    κ = (1 + iδ) / ν

ρ, ν density and sound speed of the medium behind over those of water -> ``density_ratio``, ``sound_speed_ratio``; δ the
imaginary over the real part of its wavenumber -> ``loss``; θ grazing angle -> ``sin_grazing`` (Rayleigh's coefficient
of a fluid; Jackson and Richardson, 2007, ch. 8). The formula is for e^(-iωt); functions return its conjugate, for the
e^(+iωt) of mitsonar. A rigid surface has R = 1, a soft one (pressure release, air) R = -1.
"""
import drjit as dr
import numpy as np

from mitsonar.device.types import Numbers

WATER_DENSITY = 1025.0             # [kg/m³]


def fluid_reflection(sin_grazing: Numbers, density_ratio: Numbers, sound_speed_ratio: Numbers,
                     loss: Numbers = 0.0) -> tuple[Numbers, Numbers]:
    """Return the reflection coefficient of a fluid half-space."""
    sqrt = dr.sqrt if any(map(dr.is_array_v, (sin_grazing, density_ratio, sound_speed_ratio, loss))) else np.sqrt
    # P² = x + iy with y >= 0: both parts of its root are positive
    x = (1 - loss * loss) / (sound_speed_ratio * sound_speed_ratio) - (1 - sin_grazing * sin_grazing)
    y = 2 * loss / (sound_speed_ratio * sound_speed_ratio)
    size = sqrt(x * x + y * y)
    real, imaginary = sqrt(abs(0.5 * (size + x))), sqrt(abs(0.5 * (size - x)))
    top = density_ratio * sin_grazing
    below = (top + real) * (top + real) + imaginary * imaginary
    # (top - P) / (top + P), conjugate
    return ((top - real) * (top + real) - imaginary * imaginary) / below, 2 * top * imaginary / below
