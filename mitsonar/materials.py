"""What surfaces send back: the scattering strength of a hit's material, whatever kind of material it is."""
import drjit as dr
import mitsuba as mi

__all__ = ["scattering_strength"]


def scattering_strength(hits, active, frequency):
    """Scattering strength of each hit's material towards where the ray came from, and sin of the grazing angle.

    Parameters
    ----------
    hits
        Anything with ``point``, ``normal``, ``arrival_direction``, ``uv``, ``shape`` and ``primitive`` as
        `trace.Hits` has them.
    active : Bool (R,)
    frequency : float [Hz]

    Returns
    -------
    strength, sin_grazing : Float (R,)
    """
    frame = mi.Frame3f(hits.normal)
    towards = -hits.arrival_direction
    sin_grazing = dr.dot(hits.normal, towards)
    si = dr.zeros(mi.SurfaceInteraction3f, dr.width(sin_grazing))
    si.t = dr.select(active, 1.0, dr.inf)
    si.p = mi.Point3f(hits.point)
    si.n, si.sh_frame, si.uv = hits.normal, frame, hits.uv
    si.shape, si.prim_index = hits.shape, hits.primitive
    si.wi = frame.to_local(towards)
    frequency = dr.opaque(mi.Float, frequency)

    def strength(material, si, frequency, active):
        law = getattr(material, "scattering_strength", None)
        if law is not None:
            return law(si, si.wi, si.wi, frequency, active)
        # a Mitsuba material: its value is f_r cos θ_o, and σ = f_r sin θ_i sin θ_s
        return material.eval(mi.BSDFContext(), si, si.wi, active)[0] * mi.Frame3f.cos_theta(si.wi)

    return dr.dispatch(hits.shape.bsdf(), strength, si, frequency, active), sin_grazing
