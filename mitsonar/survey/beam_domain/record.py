"""Echoes of a ping in the beam domain: where they lie on the grid of time and sine, how strong, and whose they are."""
from __future__ import annotations

from dataclasses import dataclass

import mitsuba as mi
import numpy as np

__all__ = ["GridEchoes", "TargetEchoes"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GridEchoes:
    """Some echoes, on the device.

    Attributes
    ----------
    column : Float (R,)
        Samples after the record's start, the delay that Doppler makes of a sweep included.
    sine : Float (R,)
    real, imaginary : Float (R,)
        Complex amplitude for a source level of 0 dB, the carrier's phase included; 0 where the way is not free.
    energy : Float (R,)
        Mean square of the amplitude over chance, as if the way were free; 0 where there is no echo.
    state : UInt32 (R,)
        What hides it: `ground.FREE`, `HIDDEN_BY_BED` or `HIDDEN_BY_OBJECT`.
    label : UInt32 (R,)
        Number of the instance.
    launch_sine : Float (R,)
        Of the way out, below the horizon.
    x, y, depth : Float (R,) [m]
        Place, scene coordinates; x and y from the ping's origin.
    """

    column: mi.Float
    sine: mi.Float
    real: mi.Float
    imaginary: mi.Float
    energy: mi.Float
    state: mi.UInt32
    label: mi.UInt32
    launch_sine: mi.Float
    x: mi.Float
    y: mi.Float
    depth: mi.Float


@dataclass(frozen=True, kw_only=True, eq=False)
class TargetEchoes:
    """Echoes with a phase of their own, of one instance or several.

    Attributes
    ----------
    echoes : GridEchoes
    label : (R,) uint32
        Numbers of the instances; 0 of what belongs to none.
    """

    echoes: GridEchoes
    label: np.ndarray
