"""Lambert's law of bottom scattering.

    σ = μ sin θ_i sin θ_s,     S_b = 10 log μ + 20 log sin θ   (backscatter)

μ -> ``strength``, θ grazing angles. Mackenzie (1961, JASA 33, 1596) found 10 log μ = -27 dB in deep water at 530 and
1030 Hz; at sonar frequencies -35 (mud) to -10 dB (gravel, rock). Energy: μ <= 1/π (-4.97 dB).
"""
import numpy as np

from mitsonar.device.types import Numbers

STRONGEST = 1 / np.pi              # all the incident power comes back


def scattering_strength(strength: Numbers, sin_incident: Numbers, sin_scattered: Numbers) -> Numbers:
    """Return the scattered power per area and solid angle over the incident intensity [-]."""
    return strength * sin_incident * sin_scattered
