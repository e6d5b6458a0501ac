"""Lambert bottom (`lambert`): σ = μ sin θ_i sin θ_s, in the facet's own frame.

- ``mu_db`` [dB, -27]: 10 log μ; -35 for mud to -10 for gravel and rock, at most -4.97.

.. code-block:: xml

    <bsdf type="lambert" id="sand"><float name="mu_db" value="-25"/></bsdf>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.plugins.properties import Attributes
from mitsonar.scattering import lambert
from mitsonar.units import power_from_db


class Lambert(mi.BSDF):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        mu_db = attributes.number("mu_db", -27.0, unit="dB", maximum=10 * np.log10(lambert.STRONGEST))
        attributes.finish()
        super().__init__(props)
        self.mu_db = mu_db
        self.strength = dr.opaque(mi.Float, float(power_from_db(mu_db)))
        flags = mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [flags]
        self.m_flags = flags

    def traverse(self, callback):
        callback.put("strength", self.strength, mi.ParamFlags.Differentiable)

    def parameters_changed(self, keys):
        dr.make_opaque(self.strength)

    def scattering_strength(self, si, wi, wo, frequency, active=True):
        """σ of the law for local directions towards source and receiver; `frequency` [Hz] plays no part."""
        sin_i, sin_s = abs(mi.Frame3f.cos_theta(wi)), abs(mi.Frame3f.cos_theta(wo))
        return dr.select(active, lambert.scattering_strength(self.strength, sin_i, sin_s), 0)

    # As a BSDF, f_r cos θ_o = σ / sin θ_i = μ sin θ_s: lets any Mitsuba integrator show the scene.
    def eval(self, ctx, si, wo, active=True):
        return mi.Spectrum(dr.select(active, self.strength * abs(mi.Frame3f.cos_theta(wo)), 0))

    def pdf(self, ctx, si, wo, active=True):
        return dr.select(active, mi.warp.square_to_cosine_hemisphere_pdf(wo), 0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def sample(self, ctx, si, sample1, sample2, active=True):
        sample = mi.BSDFSample3f()
        sample.wo = mi.warp.square_to_cosine_hemisphere(sample2)
        sample.pdf = self.pdf(ctx, si, sample.wo, active)
        sample.eta = 1.0
        sample.sampled_type = mi.UInt32(+mi.BSDFFlags.DiffuseReflection)
        sample.sampled_component = 0
        active &= sample.pdf > 0
        return sample, dr.select(active, self.eval(ctx, si, sample.wo, active) / sample.pdf, 0)

    def to_string(self):
        return f"Lambert[mu_db={self.mu_db}]"


mi.register_bsdf("lambert", Lambert)
