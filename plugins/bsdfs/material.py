"""Base class of the materials: a scattering law as a Mitsuba bsdf.

A law is σ(in, out), the power scattered per area and solid angle over the incident intensity. The value of Mitsuba's
bsdf is f_r cos θ_o = σ / sin θ_i, with the grazing angle θ_i of the incoming ray.
"""
from typing import Any

import drjit as dr
import mitsuba as mi

from mitsonar.scattering.surfaces.glints import Glints

from ..attributes import NumberOrTexture
from .variation import Variation

SHOWN_AT = 100e3, 1500.0           # [Hz], [m/s]: for Mitsuba's own integrators

COHERENCE = NumberOrTexture(
    "coherence", default=1.0, minimum=0, maximum=1,
    text="of what scatters there between any two passes, numbers that sonars other than `sidescan` have as `pass`: 1: "
         "the same echoes in all, 0: others in each")


class Material(mi.BSDF):
    """Surface that scatters by a law; a subclass defines the law and the sampling of its directions.

    Directions are local unit vectors away from the surface, with z along its normal on the side of the sound.
    """

    textured = False
    variation = Variation()
    coherence: float | mi.Texture = 1.0  # of scatterers between any two passes
    smooth = reflects = mirror = False

    def __init__(self, props: mi.Properties, *, flags: mi.BSDFFlags | int | None = None) -> None:
        super().__init__(props)
        if flags is None:
            flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [flags]
        self.m_flags = flags

    def check(self, frequency: float, sound_speed: float) -> None:
        """Refuse frequencies [Hz] and sound speeds [m/s] outside the validity of the law, before a run."""

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return σ [-] for directions wi, wo (R,), a frequency [Hz] and a sound speed [m/s]."""
        # not abstract: Mitsuba's classes have a metaclass of their own
        raise NotImplementedError(f"{type(self).__name__} lacks the method scattering_strength")

    def patchy_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                        sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return σ [-] of the law times the strength of the local patch relative to the mean."""
        strength = self.scattering_strength(si, wi, wo, frequency, sound_speed, active)
        return self.variation.of(strength, si.p, active)

    @property
    def glints(self) -> Glints | None:
        """Return the strong scatterers of the material."""
        return self.variation.glints

    def coherence_at(self, si: mi.SurfaceInteraction3f, active: mi.Bool | bool = True) -> mi.Float:
        """Return the coherence between any two passes of the scatterers at interactions, 0 to 1."""
        if isinstance(self.coherence, mi.Texture):
            return dr.clip(self.coherence.eval_1(si, mi.Bool(active)), 0, 1)
        return dr.full(mi.Float, self.coherence, dr.width(si.p))

    def coherent_reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                            sound_speed: mi.Float, lowest_wavenumber: mi.Float,
                            active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return the real and imaginary parts (R,) of the coherent reflection coefficient, for e^(+iωt)."""
        # frequency [Hz]; sound_speed [m/s]; lowest_wavenumber (R,) [rad/m]
        raise NotImplementedError(f"{type(self).__name__} lacks the method coherent_reflection")

    def drawn_direction(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, frequency: mi.Float, sound_speed: mi.Float,
                        sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool | bool = True) -> mi.Vector3f:
        """Draw the direction of a scattered ray, Vector3f (R,), from Float and Point2f samples in [0, 1)."""
        return mi.warp.square_to_cosine_hemisphere(sample2)

    def direction_density(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                          sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return the density of `drawn_direction` [1/sr]."""
        density: Any = mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return dr.select(active & (wo.z > 0), density, 0)

    # ---- Mitsuba's own interface: any of its integrators can show the scene
    def eval(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f,
             active: mi.Bool | bool = True) -> mi.Spectrum:
        sine = mi.Frame3f.cos_theta(si.wi)
        active = mi.Bool(active) & (sine * mi.Frame3f.cos_theta(wo) > 0)
        strength = self.patchy_strength(si, *_upright(si.wi, wo), *_shown(), active)
        return mi.Spectrum(dr.select(active, strength / dr.maximum(abs(sine), 1e-6), 0))

    def pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f,
            active: mi.Bool | bool = True) -> mi.Float:
        active = mi.Bool(active) & (mi.Frame3f.cos_theta(si.wi) * mi.Frame3f.cos_theta(wo) > 0)
        return dr.select(active, self.direction_density(si, *_upright(si.wi, wo), *_shown(), active), 0)

    def eval_pdf(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, wo: mi.Vector3f,
                 active: mi.Bool | bool = True) -> tuple[mi.Spectrum, mi.Float]:
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def sample(self, ctx: mi.BSDFContext, si: mi.SurfaceInteraction3f, sample1: mi.Float, sample2: mi.Point2f,
               active: mi.Bool | bool = True) -> tuple[mi.BSDFSample3f, mi.Spectrum]:
        below = mi.Frame3f.cos_theta(si.wi) < 0
        wi, _ = _upright(si.wi, si.wi)
        wo = self.drawn_direction(si, wi, *_shown(), sample1, sample2, active)
        sample: Any = mi.BSDFSample3f()            # Mitsuba's stubs give its fields the types of another variant
        sample.wo = dr.select(below, mi.Vector3f(wo.x, wo.y, -wo.z), wo)
        sample.pdf = self.pdf(ctx, si, sample.wo, active)
        sample.eta = 1.0
        sample.sampled_type = mi.UInt32(+self.m_flags)
        sample.sampled_component = 0
        active = mi.Bool(active) & (sample.pdf > 0)
        value: Any = self.eval(ctx, si, sample.wo, active)
        value = value / dr.select(active, sample.pdf, 1)
        return sample, dr.select(active, value, 0)

    def traverse(self, callback: mi.TraversalCallback) -> None:
        if isinstance(self.coherence, mi.Texture):
            callback.put("coherence", self.coherence, mi.ParamFlags.NonDifferentiable)


def _shown():
    return dr.opaque(mi.Float, SHOWN_AT[0]), dr.opaque(mi.Float, SHOWN_AT[1])


def _upright(wi, wo):
    """Return directions turned so that `wi` lies above the surface."""
    sign = dr.select(mi.Frame3f.cos_theta(wi) < 0, mi.Float(-1), mi.Float(1))
    return mi.Vector3f(wi.x, wi.y, wi.z * sign), mi.Vector3f(wo.x, wo.y, wo.z * sign)
