"""Directions drawn from the scattered lobe of a rough surface, on the device.

The sampled lobe has the height and the tail of that of `small_slope` about the specular direction; r is the shift of
the transverse wavenumber over k:

    p(r) = α / (π w²) (1 + r²/w²)^(-1 - α),     ∫_0^r 2π r p dr = 1 - (1 + r²/w²)^(-α),     w² = 2α (b s²)^(1/α) / F(∞)

cut off at the horizon: r runs up to r_end(ψ), where sin θ_s = 0, in each direction ψ about the specular one.
"""
from collections.abc import Callable

import drjit as dr
import numpy as np

from mitsonar.device.types import Float

from .small_slope import MOST, log_roughness

SMALLEST = 1e-3                    # 2 sin θ_i: below, the lobe keeps this width
CORE = 40.0                        # ln q in the flat middle of the lobe
TINY = 1e-14
NARROWEST, WIDEST = 1e-10, 10.0     # w²: from nearly a mirror in float32 to flat over all directions


def lobe_width(log_lobe: Callable[[Float, Float], Float], sine: Float, wavenumber: Float, w2: Float,
               gamma: Float) -> Float:
    """Return w² [-] of the sampled lobe; ``sine`` is that of the incident grazing angle."""
    alpha = 0.5 * gamma - 1
    log_core = log_roughness(dr, wavenumber, w2, alpha) + 2 * dr.log(dr.maximum(2 * sine, SMALLEST))
    width = 2 * alpha * dr.exp(dr.minimum(log_core / alpha, MOST) - log_lobe(0 * log_core + CORE, alpha))
    return dr.clip(width, NARROWEST, WIDEST)


def lobe_shift(x: Float, y: Float, sine: Float, width: Float, alpha: Float, first: Float,
               second: Float) -> tuple[Float, Float, Float]:
    """Draw a direction from the lobe with two numbers in [0, 1)."""
    cosine, sine_turn = dr.cos(2 * np.pi * second), dr.sin(2 * np.pi * second)
    near, far = _horizon(x, y, sine, cosine, sine_turn)
    within = first * _within(far * far, width, alpha)
    r = dr.minimum(dr.sqrt(width * dr.maximum(_expm1(-_log1p(-within) / alpha), 0)), far)
    return r * cosine - x, r * sine_turn - y, dr.sqrt((far - r) * (near + r))


def lobe_density(x: Float, y: Float, sine: Float, x_out: Float, y_out: Float, width: Float, alpha: Float) -> Float:
    """Return the density of `lobe_shift` over the transverse direction [-]: times sin θ_s it is per sr."""
    dx, dy = x + x_out, y + y_out
    square = dr.maximum(dx * dx + dy * dy, TINY)
    scale = 1 / dr.sqrt(square)
    _, far = _horizon(x, y, sine, dx * scale, dy * scale)
    peak = alpha / (np.pi * width * _within(far * far, width, alpha))
    return peak * dr.exp(-(1 + alpha) * _log1p(square / width))


def _horizon(x: Float, y: Float, sine: Float, cosine: Float, sine_turn: Float) -> tuple[Float, Float]:
    """Return the distances from the specular direction to the horizon, backwards and forwards along a direction."""
    along = x * cosine + y * sine_turn          # back towards the source: the longer distance
    longer = dr.sqrt(sine * sine + along * along) + abs(along)
    shorter = sine * sine / dr.maximum(longer, TINY)            # their product is sin² θ
    return dr.select(along > 0, shorter, longer), dr.maximum(dr.select(along > 0, longer, shorter), TINY)


def _within(square: Float, width: Float, alpha: Float) -> Float:
    """Return the share of the lobe within a squared distance."""
    return dr.maximum(-_expm1(-alpha * _log1p(square / width)), TINY)


def _log1p(x: Float) -> Float:
    """Return ln(1 + x) without cancellation about 0."""
    return dr.select(abs(x) < 0.5, 2 * dr.atanh(dr.clip(x / (2 + x), -0.5, 0.5)), dr.log(dr.maximum(1 + x, TINY)))


def _expm1(y: Float) -> Float:
    """Return e^y - 1 without cancellation about 0."""
    half = dr.tanh(0.5 * dr.clip(y, -1, 1))
    return dr.select(abs(y) < 1, 2 * half / (1 - half), dr.exp(dr.minimum(y, MOST)) - 1)
