"""The scattered lobe of a surface with a power-law spectrum of roughness, by small slopes of lowest order.

    σ_rough = |A|² / (2π ΔK_z²) ∫_0^∞ J0(ΔK r) exp(-ΔK_z² D(r) / 2) r dr,      A = k² a / 2,      D(r) = C² r^2α
            = |a|² / (8π s²) (b s²)^(-1/α) F(q),      q = b s² d^(-α),      b = C² k^(2 - 2α) / 2

    d = ΔK² / k²,   s = ΔK_z / k = sin θ_i + sin θ_s,   F(q) = q^(1/α) I(q, α)  (I: see rough_interface),  α = γ/2 - 1
    C² = 2π w2 Γ(2 - α) 2^(-2α) / [α (1 - α) Γ(1 + α)]

d -> ``shift``, s -> ``shift_z``, k -> ``wavenumber``; w2, γ of the spectrum w2 K^-γ. The amplitude a is that of the
material below (`fluid`). F is 2π times the density of a stable law of two dimensions: flat where q is large, about the
specular direction, and far from it as q^(1 + 1/α), the limit of perturbation.

Directions are drawn from a lobe that has its height and its tail, of the shift of the transverse wavenumber over k,

    p(r) = α / (π w²) (1 + r²/w²)^(-1 - α),     ∫_0^r 2π r p dr = 1 - (1 + r²/w²)^(-α),     w² = 2α (b s²)^(1/α) / F(∞)

cut off at the horizon: r runs up to r_end(ψ), where sin θ_s = 0, in each direction ψ about the specular one.
"""
import numpy as np
from scipy.special import polygamma

__all__ = ["lobe_density", "lobe_factor", "lobe_shift", "lobe_width", "log_roughness"]

SMALLEST = 1e-9                    # of k: keeps specular and grazing limits finite, at which they are reached to 1e-9
SMALLEST_DRAWN, CORE, TINY = 1e-3, 40.0, 1e-12
MOST = 80.0                        # exponent: exact forward grazing has no bound, and float32 ends at 88
# ln Γ(2 - α) - ln Γ(1 + α) in odd powers of α - 1/2
_ODD = [-2 * float(polygamma(2 * n, 1.5)) / float(np.prod(np.arange(1.0, 2 * n + 2))) for n in range(12)]


def log_roughness(module, wavenumber, w2, alpha):
    """Give ln b [-]: half the structure function over a length of 1/k, times k²."""
    x = alpha - 0.5
    square, series = x * x, 0.0
    for coefficient in reversed(_ODD):
        series = series * square + coefficient
    return (module.log(np.pi * w2 / (alpha * (1 - alpha))) + x * series - (2 * np.log(2)) * alpha
            + (2 - 2 * alpha) * module.log(wavenumber))


def lobe_factor(module, log_lobe, shift, shift_z, wavenumber, w2, gamma):
    """Give σ_rough over |a|² [-].

    Parameters
    ----------
    module : module
        ``numpy`` or ``drjit``.
    log_lobe : callable(log_q, alpha)
        Gives ln F.
    shift, shift_z : array [-]
        d, of at least 0, and s.
    wavenumber : array [rad/m]
    w2, gamma : array [m^(4 - gamma)], [-]
    """
    alpha = 0.5 * gamma - 1
    s = module.maximum(shift_z, SMALLEST)
    log_core = log_roughness(module, wavenumber, w2, alpha) + 2 * module.log(s)
    log_q = log_core - alpha * module.log(shift + SMALLEST**2)
    exponent = log_lobe(log_q, alpha) - log_core / alpha
    return module.exp(module.minimum(exponent, MOST)) / (8 * np.pi * s * s)


def lobe_width(module, log_lobe, sine, wavenumber, w2, gamma):
    """Give w² [-] of the lobe that directions are drawn from, where sound comes in at ``sine`` of grazing angle."""
    alpha = 0.5 * gamma - 1
    log_core = log_roughness(module, wavenumber, w2, alpha) + 2 * module.log(module.maximum(2 * sine, SMALLEST_DRAWN))
    return 2 * alpha * module.exp(module.minimum(log_core / alpha, MOST) - log_lobe(0 * log_core + CORE, alpha))


def lobe_shift(module, x, y, sine, width, alpha, first, second):
    """Draw a direction from the lobe by two numbers in [0, 1).

    Parameters
    ----------
    module : module
    x, y, sine : array [-]
        Direction towards where sound comes from: along the surface, and the sine of the grazing angle.
    width, alpha : array [-]
        w² and α.
    first, second : array

    Returns
    -------
    x, y, z : array [-]
        Unit vector of the direction that sound goes on in.
    """
    cosine, sine_turn = module.cos(2 * np.pi * second), module.sin(2 * np.pi * second)
    near, far = _horizon(module, x, y, sine, cosine, sine_turn)
    missed = first * _within(module, far * far, width, alpha)
    r = module.sqrt(width * module.maximum(module.exp(-module.log(1 - missed) / alpha) - 1, 0))
    r = module.minimum(r, far)
    return r * cosine - x, r * sine_turn - y, module.sqrt((far - r) * (near + r))


def lobe_density(module, x, y, sine, x_out, y_out, width, alpha):
    """Give the density of `lobe_shift` over the transverse direction [-]: per sr once it is multiplied by sin θ_s."""
    dx, dy = x + x_out, y + y_out
    square = module.maximum(dx * dx + dy * dy, TINY)
    scale = 1 / module.sqrt(square)
    _, far = _horizon(module, x, y, sine, dx * scale, dy * scale)
    peak = alpha / (np.pi * width * _within(module, far * far, width, alpha))
    return peak * module.exp(-(1 + alpha) * module.log(1 + square / width))


def _horizon(module, x, y, sine, cosine, sine_turn):
    """Distances from the specular direction to the horizon, backwards and forwards along a direction."""
    along = x * cosine + y * sine_turn          # back towards where sound comes from: the longer way
    root = module.sqrt(sine * sine + along * along)
    far = module.maximum(root + along, TINY)
    near = module.maximum(root - along, TINY)
    # the product is sin² θ: the smaller of both by the larger
    return module.maximum(near, sine * sine / far), module.maximum(far, sine * sine / near)


def _within(module, square, width, alpha):
    """Share of the lobe within a distance, given squared."""
    return module.maximum(1 - module.exp(-alpha * module.log(1 + square / width)), TINY)
