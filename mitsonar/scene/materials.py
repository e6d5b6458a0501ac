"""Scattering and reflection by the materials of hits, mitsonar's own and Mitsuba's.

Hits are passed as a `Meeting`, the part of `tracing.hits.Hits` that materials need. Mitsuba's materials
(those that are not `plugins.bsdfs.material`) count by their value f_r cos θ_o: σ = f_r sin θ_i sin θ_s.
"""
from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any, Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.water.profile import SoundSpeedProfile

from .geometry import Geometry
from .protocols import SoundMaterial, smooth_material, sound_material

SCATTERING = (mi.BSDFFlags.DiffuseReflection, mi.BSDFFlags.GlossyReflection)
IN_BEAM = 0.5                      # share of directions that are drawn near the plane of the beam
NARROWEST = 0.02                   # [rad] angle from that plane below which they are drawn evenly
# of a fitted lobe: sine and cosine of the grazing angle beside it, slope of the facet that its width is found at, and
# the least share of the lobe that is left there
LOW, LEVEL = 0.3, float(np.sqrt(1 - 0.3 ** 2))
SLOPE, LEAST_LEFT = 0.25, 1e-6
SCALES = float(np.log1p(0.5 * np.pi / NARROWEST))


class Meeting(Protocol):
    """Hits of rays on surfaces, one for each ray: their places, normals and materials."""

    @property
    def point(self) -> dr.ArrayBase:
        """Array3f64 (R,) [m]."""
        ...

    @property
    def normal(self) -> mi.Vector3f:
        """Unit normal of the facet, on the side that sound comes from."""
        ...

    @property
    def smooth(self) -> mi.Vector3f | None:
        """Normal to scatter by in place of the facet's, on the same side."""
        ...

    @property
    def arrival_direction(self) -> mi.Vector3f:
        """Unit vector along the travel."""
        ...

    @property
    def sound_speed(self) -> mi.Float64:
        """Sound speed of the water at the hit [m/s]."""
        ...

    @property
    def shape(self) -> mi.ShapePtr:
        """Shape that is hit."""
        ...

    @property
    def primitive(self) -> mi.UInt32:
        """Facet of the shape."""
        ...

    @property
    def uv(self) -> mi.Point2f:
        """Texture coordinates."""
        ...


def check(geometry: Geometry, profile: SoundSpeedProfile, frequency: float) -> None:
    """Check that every material of a scene scatters or reflects at a frequency [Hz], and that its law holds there."""
    slowest = float(np.min(profile.at(np.linspace(*geometry.depth_range, 9))))
    for shape in geometry.scene.shapes():
        material, inside = shape.bsdf(), _inside(shape.bsdf())
        _check_kind(shape, material, inside)
        for part in inside:
            if isinstance(part, mi.Texture):
                _check_texture(shape, part)
        if (law := sound_material(material)) is not None:
            law.check(frequency, slowest)


def _inside(thing):
    """Return the objects within an object of Mitsuba's, however deep; shared ones once."""
    parts, waiting = {}, [thing]
    while waiting:
        for part in _children(waiting.pop()):
            if id(part) not in parts:
                parts[id(part)] = part               # kept, so that no other object gets its address
                waiting.append(part)
    return list(parts.values())


def _children(thing):
    children = []

    class Collector(mi.TraversalCallback):          # of the variant that is set now
        def put(self, _name: str, value: Any, *_: Any) -> None:
            if isinstance(value, mi.Object):
                children.append(value)

    thing.traverse(Collector())
    return children


def _check_kind(shape, material, inside):
    """Refuse a material of Mitsuba's that holds one of mitsonar's: its value has neither frequency nor mirrors."""
    if sound_material(material) is not None:
        return
    for part in inside:
        if (law := sound_material(part)) is None:
            continue
        if not mi.has_flag(part.flags(), mi.BSDFFlags.DiffuseReflection):
            raise ValueError(f"the material of {_name(shape)} holds another, {part}, which must stand alone; give that "
                             "one to the shape itself")
        if law.coherence != 1.0:
            raise ValueError(f"the material of {_name(shape)} holds another of a coherence, {part}, which must stand "
                             "alone; give that one to the shape itself")
    if not any(mi.has_flag(material.flags(), flag) for flag in SCATTERING):
        raise ValueError(f"the material of {_name(shape)}, {material.class_name()}, scatters nothing back to the "
                         "sonar; use rigid, soft or impedance for a smooth surface, lambert for a rough one")


def _check_texture(shape, texture):
    """Refuse a texture that finds no values at a shape: it would be 0 there, and pass for a parameter."""
    if texture.class_name() == "MeshAttribute":
        match = re.search(r'name = "(.*?)"', str(texture))
        name = match[1] if match else ""
        if not np.any(shape.has_attribute(name)):
            raise ValueError(f'a texture of {_name(shape)} reads the mesh attribute "{name}", which this shape does '
                             'not have; in a PLY file, face_mud is the property "mud_1" of the faces, vertex_mud of '
                             "the vertices")
    elif texture.is_spatially_varying() and "vertex_positions" in mi.traverse(shape) \
            and not shape.has_vertex_texcoords():
        raise ValueError(f"{_name(shape)} has a texture but no texture coordinates; write them into the mesh, or use "
                         "a mesh_attribute")


def _name(shape):
    return f'"{shape.id()}"' if shape.id() else f"a {shape.class_name()}"


def scattering_strength(hits: Meeting, active: mi.Bool, frequency: float, *,
                        smooth_patches: bool = False) -> tuple[mi.Float, mi.Float]:
    """Return each hit's backscattering strength and the sine of its grazing angle, (R,); frequency in [Hz]."""
    si = _interaction(hits, active)

    def backwards(material: mi.BSDF, si: mi.SurfaceInteraction3f, frequency: mi.Float, sound_speed: mi.Float,
                  active: mi.Bool) -> mi.Float:
        return _strength(material, si, si.wi, frequency, sound_speed, active)

    strength = dr.dispatch(hits.shape.bsdf(), backwards, si, dr.opaque(mi.Float, frequency),
                           mi.Float(hits.sound_speed), active)
    return strength, mi.Float(mi.Frame3f.cos_theta(si.wi)) if smooth_patches else _sine(hits, si)


def bistatic_strength(hits: Meeting, towards: mi.Vector3f, active: mi.Bool,
                      frequency: float) -> tuple[mi.Float, mi.Float]:
    """Return each hit's scattering strength towards given directions, Vector3f (R,), and sin of its grazing angle."""
    si = _interaction(hits, active)
    wo = si.to_local(towards)
    seen = active & (mi.Frame3f.cos_theta(wo) > 0) & (mi.Frame3f.cos_theta(si.wi) > 0)
    strength = dr.dispatch(hits.shape.bsdf(), _strength, si, wo, dr.opaque(mi.Float, frequency),
                           mi.Float(hits.sound_speed), seen)
    return dr.select(seen, strength, 0), _sine(hits, si)


def fitted_lobe(hits: Meeting, active: mi.Bool, frequency: float) -> tuple[mi.Float, mi.Float, mi.Float]:
    """Return d, s and w (R,) of a fit to each hit's strength towards all directions, for where it need not be exact:

        σ ~ d sin θ_s + s exp(-w t²),     t -> slope of the facet that would mirror the way in to the way out

    It is exact where the way out runs across the plane of incidence at a sine of `LOW`, is mirrored, or is mirrored by
    a slope of `SLOPE` across this plane.
    """
    si = _interaction(hits, active)
    x, y = _azimuth(si.wi)
    aside, mirrored = mi.Vector3f(-LEVEL * y, LEVEL * x, LOW), mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z)
    tilted = 2 * si.wi.z / (1 + SLOPE ** 2) * mi.Vector3f(-SLOPE * y, SLOPE * x, 1) - si.wi

    def law(material: mi.BSDF, si: mi.SurfaceInteraction3f, aside: mi.Vector3f, mirrored: mi.Vector3f,
            tilted: mi.Vector3f, frequency: mi.Float, sound_speed: mi.Float,
            active: mi.Bool) -> tuple[mi.Float, mi.Float, mi.Float]:
        at, near, far = (_strength(material, si, wo, frequency, sound_speed, active)
                         for wo in (aside, mirrored, tilted))
        return at, near, far

    at, near, far = dr.dispatch(hits.shape.bsdf(), law, si, aside, mirrored, tilted, dr.opaque(mi.Float, frequency),
                                mi.Float(hits.sound_speed), active & (si.wi.z > 0))
    diffuse = dr.maximum(at, 0) / aside.z
    lobe = dr.maximum(near - diffuse * mirrored.z, 0)
    left = dr.clip((far - diffuse * tilted.z) / dr.maximum(lobe, 1e-30), LEAST_LEFT, 1)
    return diffuse, lobe, -dr.log(left) * float(SLOPE ** -2)


def reflection(hits: Meeting, active: mi.Bool, frequency: float) -> tuple[mi.Float, mi.Float]:
    """Return real and imaginary part (e^(+iωt)) of each hit's reflection coefficient, 0 on materials that are rough."""
    si = _interaction(hits, active)

    def law(material: mi.BSDF, si: mi.SurfaceInteraction3f, frequency: mi.Float, sound_speed: mi.Float,
            active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        smooth = smooth_material(material)
        if smooth is None:
            return dr.zeros(mi.Float, dr.width(si.wi)), dr.zeros(mi.Float, dr.width(si.wi))
        return smooth.reflection(si, mi.Frame3f.cos_theta(si.wi), frequency, sound_speed, active)

    return dr.dispatch(hits.shape.bsdf(), law, si, dr.opaque(mi.Float, frequency), mi.Float(hits.sound_speed), active)


def reflects(geometry: Geometry) -> bool:
    """Return True if a bed's material has a reflection coefficient (`coherent_reflection`)."""
    beds = (shape for shape in geometry.scene.shapes() if geometry.named.of(shape) in geometry.named.seabed)
    return any(material.reflects for material in _sound_materials(beds))


def coherent_reflection(hits: Meeting, sin_grazing: mi.Float, active: mi.Bool, frequency: float,
                        lowest_wavenumber: mi.Float,    # (R,) [rad/m]
                        *, smooth_too: bool = True) -> tuple[mi.Float, mi.Float]:
    """Return the coherent reflection coefficient of a rough plane at hits: real and imaginary part, e^(+iωt)."""
    si = _interaction(hits, active)

    def law(material: mi.BSDF, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
            sound_speed: mi.Float, lowest: mi.Float, active: mi.Bool) -> tuple[mi.Float, mi.Float]:
        own = sound_material(material)
        if own is None or not own.reflects or own.smooth and not smooth_too:
            return dr.zeros(mi.Float, dr.width(si.wi)), dr.zeros(mi.Float, dr.width(si.wi))
        return own.coherent_reflection(si, sin_grazing, frequency, sound_speed, lowest, active)

    return dr.dispatch(hits.shape.bsdf(), law, si, sin_grazing, dr.opaque(mi.Float, frequency),
                       mi.Float(hits.sound_speed), lowest_wavenumber, active)


def loses_coherence(geometry: Geometry, pass_number: int) -> bool:
    """Return True if scatterers differ between passes, that is, if a material's `coherence` is below 1.

    Where the coherence is 0, pass 0 has the scatterers of a scene without passes.
    """
    known = [material.coherence for material in _sound_materials(geometry.scene.shapes())]
    return any(isinstance(value, mi.Texture) or 0 < value < 1 or value == 0 and pass_number for value in known)


def coherence(point: dr.ArrayBase, normal: mi.Vector3f, shape: mi.ShapePtr, primitive: mi.UInt32,
              uv: mi.Point2f) -> mi.Float:
    """Return the coherence (R,) of scatterers between any two passes, from their materials."""
    si: Any = dr.zeros(mi.SurfaceInteraction3f, dr.width(normal))
    si.t, si.p, si.n, si.sh_frame = mi.Float(1), mi.Point3f(point), normal, mi.Frame3f(normal)
    si.uv, si.shape, si.prim_index, si.wi = uv, shape, primitive, mi.Vector3f(0, 0, 1)

    def law(material: mi.BSDF, si: mi.SurfaceInteraction3f) -> mi.Float:
        own = sound_material(material)
        return dr.ones(mi.Float, dr.width(si.p)) if own is None else own.coherence_at(si)

    return dr.dispatch(shape.bsdf(), law, si)


def mirrors(hits: Meeting) -> mi.Bool:
    """Return True for hits (R,) on smooth surfaces, which reflect sound and scatter none."""
    return dr.dispatch(hits.shape.bsdf(), lambda material: mi.Bool(smooth_material(material) is not None))


def next_direction(hits: Meeting, active: mi.Bool, frequency: float, beam: mi.Vector3f, sample1: mi.Float,
                   sample2: mi.Point2f, sample3: mi.Float) -> tuple[mi.Vector3f, mi.Float, mi.Bool]:
    """Draw the direction in which sound goes on from each hit; return it, its energy share and if it is mirrored.

    Only what meets the beam again returns to the sonar. A share of the directions is therefore drawn near the plane of
    the beam, which holds the normal and the direction `beam` (R,), the rest from the material's law.
    """
    si = _interaction(hits, active)
    local = si.to_local(beam)
    drawn = _near_plane(local, sample2, sample3 * float(1 / IN_BEAM))

    def law(material: mi.BSDF, si: mi.SurfaceInteraction3f, frequency: mi.Float, sound_speed: mi.Float,
            sample1: mi.Float, sample2: mi.Point2f, local: mi.Vector3f, drawn: mi.Vector3f, near: mi.Bool,
            active: mi.Bool) -> tuple[mi.Vector3f, mi.Float, mi.Bool]:
        own, smooth = sound_material(material), smooth_material(material)
        if own is None:
            sample, weight = material.sample(mi.BSDFContext(), si, sample1, sample2, active)
            return sample.wo, weight[0], mi.Bool(False)
        if smooth is not None:
            real, imaginary = smooth.reflection(si, mi.Frame3f.cos_theta(si.wi), frequency, sound_speed, active)
            return mi.Vector3f(-si.wi.x, -si.wi.y, si.wi.z), real * real + imaginary * imaginary, mi.Bool(True)
        wo = dr.select(near, drawn, own.drawn_direction(si, si.wi, frequency, sound_speed, sample1, sample2, active))
        density = own.direction_density(si, si.wi, wo, frequency, sound_speed, active)
        density = IN_BEAM * _density_near_plane(local, wo) + (1 - IN_BEAM) * density
        strength = own.patchy_strength(si, si.wi, wo, frequency, sound_speed, active)
        good = active & (density > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        share = strength / (dr.select(good, density, 1) * mi.Frame3f.cos_theta(si.wi))
        return wo, dr.select(good, share, 0), mi.Bool(False)

    wo, share, mirrored = dr.dispatch(hits.shape.bsdf(), law, si, dr.opaque(mi.Float, frequency),
                                      mi.Float(hits.sound_speed), sample1, sample2, local, drawn,
                                      sample3 < IN_BEAM, active & (mi.Frame3f.cos_theta(si.wi) > 1e-6))
    return si.to_world(wo), share, mirrored


def _near_plane(beam, sample2, sample3):
    """Return directions, cosine-weighted in elevation, at angles of all scales from the azimuth of `beam`."""
    apart = NARROWEST * (dr.exp(sample2.y * SCALES) - 1)
    way = mi.UInt32(4 * sample3)                                 # either side, and ahead or back
    sine, cosine = dr.sincos(dr.select((way & 1) != 0, -apart, apart) + dr.select((way & 2) != 0, mi.Float(np.pi), 0))
    x, y = _azimuth(beam)
    across = dr.sqrt(sample2.x)
    return mi.Vector3f(across * (x * cosine - y * sine), across * (y * cosine + x * sine), dr.sqrt(1 - sample2.x))


def _density_near_plane(beam, wo):
    """Return the density of these directions [1/sr]: 2 cos θ over 4 (δ + δ_0) ln(1 + π / 2 δ_0), δ the angle apart."""
    (a, b), (x, y) = _azimuth(beam), _azimuth(wo)
    apart = dr.atan2(abs(a * y - b * x), abs(a * x + b * y))
    return dr.maximum(wo.z, 0) / (2 * SCALES * (apart + NARROWEST))


def _azimuth(direction):
    """Return the parts of directions along a surface, of unit length."""
    square = dr.square(direction.x) + dr.square(direction.y)
    known, scale = square > 1e-12, dr.rsqrt(dr.maximum(square, 1e-12))
    return dr.select(known, direction.x * scale, 1), dr.select(known, direction.y * scale, 0)


def _sound_materials(shapes: Iterable[mi.Shape]) -> Iterator[SoundMaterial]:
    """Yield the materials of shapes that are mitsonar's."""
    return (own for shape in shapes if (own := sound_material(shape.bsdf())) is not None)


def _strength(material: mi.BSDF, si: mi.SurfaceInteraction3f, wo: mi.Vector3f, frequency: mi.Float,
              sound_speed: mi.Float, active: mi.Bool) -> mi.Float:
    """Return the scattering strength of a material from `si.wi` towards `wo`, (R,)."""
    own = sound_material(material)
    if own is not None:
        return own.patchy_strength(si, si.wi, wo, frequency, sound_speed, active)
    return material.eval(mi.BSDFContext(), si, wo, active)[0] * mi.Frame3f.cos_theta(si.wi)


def _interaction(hits, active):
    """Return the hits as surface interactions, which Mitsuba's materials take."""
    frame = mi.Frame3f(hits.normal if hits.smooth is None else hits.smooth)
    si: Any = dr.zeros(mi.SurfaceInteraction3f, dr.width(hits.normal))
    si.t = dr.select(active, 1.0, dr.inf)
    si.p = mi.Point3f(hits.point)
    si.n, si.sh_frame, si.uv = hits.normal, frame, hits.uv
    si.shape, si.prim_index = hits.shape, hits.primitive
    si.wi = frame.to_local(-hits.arrival_direction)
    return si


def _sine(hits, si):
    """Return the sine of the grazing angle on the facets, which sets the size of a ray's patch."""
    if hits.smooth is None:
        return mi.Float(mi.Frame3f.cos_theta(si.wi))
    return mi.Float(-dr.dot(hits.normal, hits.arrival_direction))
