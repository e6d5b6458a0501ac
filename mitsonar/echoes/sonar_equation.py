"""The sonar equation of a ray.

A ray launched into ΔΩ lights dA = A ΔΩ / sin θ_i of a facet, and the echo's share of that patch at the receiver is

    p² = 10^(SL/10) B ΔΩ (σ / sin θ_i) 10^(-2 ᾱ L / 10) / A'                         [µPa²]
    A' = A (c_0 / c_h)²

SL source level, B two-way intensity pattern, σ scattering strength, θ_i grazing angle on the facet, ᾱ absorption, L arc
length, A ray-tube area per steradian of the outgoing leg: it cancels, and A' is that of the returning leg, from the
stratified reciprocity A c_0² p = A' c_h² p. What a time bin's rays bring adds up (Jackson & Richardson 2007; ray
form of the reverberation integral).
"""
import drjit as dr

__all__ = ["echo_energy"]


def echo_energy(*, solid_angle, pattern, strength, sin_grazing, spreading_area, speed_ratio, loss):
    """Echo of one ray relative to 10^(SL/10) [1/m²].

    Parameters
    ----------
    solid_angle : ΔΩ [sr]
    pattern : B, two-way intensity pattern [-]
    strength : σ [-]
    sin_grazing : sin θ_i, of the incident ray on the facet [-]
    spreading_area : A [m²/sr], outgoing
    speed_ratio : c_h / c_0 [-]
    loss : two-way absorption as a power factor [-], relative to that of the bin's unit
    """
    shining = sin_grazing > 1e-6
    per_patch = dr.select(shining, strength / dr.select(shining, sin_grazing, 1), 0)
    return solid_angle * pattern * per_patch * loss * speed_ratio * speed_ratio / spreading_area
