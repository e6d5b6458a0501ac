"""Leakage between the sides of a sidescan: a faint copy of the other side's echoes at the same ranges.

    p²_port  = p²_port + (a + x) p²_starboard,     z_port = z_port + √(a + x) z_starboard,    likewise starboard

The face of a side receives through its baffle by the back-to-front ratio a, -20 to -45 dB for faces in a hull (Urick
1983, ch. 3; Butler and Sherman 2016). Channels leak electrically by x, -35 to -70 dB between receivers on one tow cable
or board. a + x -> ``leakage``.
"""
import numpy as np


def leaked(intensity: np.ndarray, leakage: float) -> np.ndarray:
    """Return mean intensities (ping, side, ...) with the leakage of the other side added."""
    return intensity + leakage * intensity[:, ::-1] if leakage else intensity


def leaked_pressure(pressure: np.ndarray, leakage: float) -> np.ndarray:
    """Return complex pressures (ping, side, ...) with the leakage of the other side added."""
    return pressure + np.sqrt(leakage) * pressure[:, ::-1] if leakage else pressure
