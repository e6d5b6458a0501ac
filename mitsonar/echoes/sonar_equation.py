"""The sonar equation: power that returns to the sonar from a surface, a target or the water.

A ray sent into ΔΩ ensonifies the patch A ΔΩ / sin θ_i of a surface. Of each unit of power that it carries,

    σ / sin θ_i                      goes on towards the receiver, per steradian                         `scattered`
    (c_h / c_0)² / A                 of that arrives there                                               `returned`

so that the echo of a ray and, along the legs out and back, the echo of a target of known strength S are

    p² = 10^(SL/10) B ΔΩ (σ / sin θ_i) 10^(-2 ᾱ L / 10) (c_h / c_0)² / A          [µPa²]                 `echo_energy`
    p² = 10^(SL/10) B S g_out g_back,       g = (c_h / c_0) 10^(-ᾱ L / 10) / A                           `along_legs`

S is σ dA of a cell, s_v dV of water, 10^(TS/10) of a point target. In the first line the spreading of the leg out
cancels against the patch; A (c_0 / c_h)² is the ray tube's area on the way back, from the reciprocity of stratified
water, A c_0² back = A c_h² out (Jackson & Richardson 2007; ray form of the reverberation integral). The energies of the
rays in a time bin are added. Pressures are the square roots: a target of pressure f echoes with f √(g_out g_back).

    SL   source level                     B    ``pattern``         two-way intensity pattern [-]
    ΔΩ   ``solid_angle`` [sr]             σ    ``strength``        scattering strength [-]
    θ_i  ``sin_grazing`` [-]              A    ``spreading_area``  of the leg, outgoing [m²/sr]
    c_h / c_0  ``speed_ratio`` [-]        ᾱ L  half of ``loss_db``, the two-way absorption [dB]

No other module divides by a spreading area, or by a sound speed (`tests/structure/test_one_sonar_equation.py`).
"""
from __future__ import annotations

from typing import cast

import drjit as dr
import numpy as np

from mitsonar.device.types import DrJitArray, Float, Float64

GRAZING = 1e-6                     # sine of the grazing angle below which a surface is not lit


def speed_ratio(at_hit: Float | Float64, at_source: Float | Float64) -> Float:
    """Return c_h / c_0, Float (R,), from sound speeds [m/s], Float64 (R,) or Float (R,)."""
    ratio = type(at_source)(at_hit) / at_source
    return cast(type[Float], dr.float32_array_t(type(ratio)))(ratio)


def absorbed(loss_db: Float) -> Float:
    """Return the share of a power that is left after a loss [dB]."""
    return dr.exp(loss_db * float(-np.log(10) / 10))


# ---- rays: energies per solid angle

def scattered(power: Float, strength: Float, sin_grazing: Float) -> Float:
    """Return the power that goes on per steradian; 0 where the ray grazes the surface."""
    lit = sin_grazing > GRAZING
    return power * dr.select(lit, strength / dr.select(lit, sin_grazing, 1), 0)


def passed_on(power: Float, *, spreading_area: Float, patch: Float) -> Float:
    """Return the intensity at the end of a leg between two surfaces [1/m²].

    The area is kept above the patch [m²] that the ray stands for, over π, so that corners do not become infinite.
    """
    return power / (spreading_area + patch * (1 / np.pi))


def returned(power: Float, *, spreading_area: Float, speed_ratio: Float) -> Float:
    """Return the intensity at the sonar from a power per steradian [1/m²]."""
    return power * speed_ratio * speed_ratio / spreading_area


def echo_energy(*, solid_angle: Float, strength: Float, sin_grazing: Float, spreading_area: Float, speed_ratio: Float,
                pattern: Float | float = 1.0, loss: DrJitArray | float = 1.0) -> Float:
    """Return the echo of one ray relative to 10^(SL/10) [1/m²]."""
    power = scattered(solid_angle * pattern, strength, sin_grazing) * loss
    return returned(power, spreading_area=spreading_area, speed_ratio=speed_ratio)


def returned_by_patch(intensity: Float, *, solid_angle: Float, strength: Float, sin_grazing: Float,
                      speed_ratio: Float) -> Float:
    """Return the intensity at the sonar from a patch, the footprint of a ray from the sonar, under an intensity [1/m²].

    The spreading of the ray's own leg cancels: the patch grows by the factor by which its echo weakens.
    """
    return scattered(intensity * solid_angle, strength, sin_grazing) * speed_ratio * speed_ratio


def lit_patch(solid_angle: Float, *, spreading_area: Float, sin_grazing: Float) -> Float:
    """Return the patch of a surface that a ray stands for [m²]."""
    return spreading_area * solid_angle / dr.maximum(sin_grazing, GRAZING)


def solid_angle_of(patch: Float, *, spreading_area: Float, sin_grazing: Float) -> Float:
    """Return the solid angle of a patch [m²] seen along another leg [sr]."""
    return patch * sin_grazing / spreading_area


# ---- legs to points: targets of known strength

def leg_gain(*, spreading_area: Float, speed_ratio: Float, loss_db: Float | None = None) -> Float:
    """Return the gain g of a leg [1/m²]; without `loss_db`, absorption is left out."""
    gain = speed_ratio / spreading_area
    return gain if loss_db is None else gain * dr.exp(loss_db * float(-np.log(10) / 20))


def along_legs(strength: Float, out: Float, back: Float) -> Float:
    """Return the echo of a target of strength S [m²] along legs of gains `out` and `back`."""
    return strength * (out * back)


def pressure_along_legs(pressure: Float | float, out: Float, back: Float) -> Float:
    """Return the pressure of a target that answers with f [m], along legs of gains `out` and `back`."""
    return pressure * dr.sqrt(out * back)


def mirrored_overhead(gain: Float, *, spreading_area: Float, speed_ratio: Float) -> Float:
    """Return the echo of a flat surface straight above, as a pressure [1/m], from the gain of the leg up to it.

    It is half the pressure of a wave that starts there, with reversed sign: -10^(-ᾱ L / 10) / (2 √A).
    """
    return -0.5 * gain / speed_ratio * dr.sqrt(spreading_area)
