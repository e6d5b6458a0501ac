"""Fluid sediment (`sediment`): small-slope scattering from a rough surface, plus volume scattering.

The law holds for any pair of directions. A sediment is one of the 23 of APL-UW TR 9407, or is made of free parameters;
see `mitsonar.scattering.Sediment`. A frequency outside a sediment's validity is refused.

Textures of parameters are clipped to the valid range. Write them with ``raw`` true, and textures of classes also with
``filter_type`` nearest. A ``mesh_attribute`` texture reads values from the faces or vertices of a mesh: the face
property ``sediment_1`` of a PLY file is ``face_sediment``.

Neighbouring classes blend patch by patch, see `mitsonar.scattering.surfaces.borders`: classes of an image over the
width ``class_border``, others by ``second_class`` and ``second_share``, which `bathymetry` makes.

With ``mesh_resolution`` the law leaves out the roughness that the mesh itself resolves, so that it does not count
twice. Near nadir, facets that are smooth to the sound (2 k h < 1, with h the rms height of the remaining roughness) are
off by some dB.

.. code-block:: xml

    <bsdf type="sediment" id="map">
        <string name="classes" value="clay, medium sand, sandy gravel"/>
        <texture name="sediment_class" type="mesh_attribute"><string name="name" value="face_sediment"/></texture>
        <float name="volume_parameter" value="0.003"/>
    </bsdf>
"""
import warnings
from dataclasses import replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scattering.laws.sediment import BOUNDS, Sediment
from mitsonar.scattering.surfaces.arithmetic import Arithmetic, power
from mitsonar.scattering.surfaces.fluid import Fluid
from mitsonar.scattering.surfaces.lobe_directions import lobe_density, lobe_shift, lobe_width
from mitsonar.scattering.surfaces.lobe_table import LobeTable, RatioTable
from mitsonar.scattering.surfaces.resolved import cut, resolved_factor
from mitsonar.scattering.surfaces.small_slope import lobe_factor

from ..attributes import Attributes, Number, NumberOrTexture, Text
from .class_map import CLASSES, class_map_of
from .material import COHERENCE, Material
from .parameter import Parameter
from .variation import VARIATION, variation_of

FLUID = "density_ratio", "sound_speed_ratio", "loss", "volume_parameter"
LEAST = {"density_ratio": 1e-2, "sound_speed_ratio": 1e-2, "loss": 1e-5, "w2": 1e-12,      # of textures
         "shear_speed_ratio": 1e-3, "shear_loss": 1e-5}
SHARES = 0.1, 0.9                  # bounds of the share of draws that goes to the lobe


def own(name: str, bounds: dict, text: str, *, unit: str = "", or_none: bool = False) -> NumberOrTexture:
    """Declare a parameter in place of the sediment's own; `or_none` allows 0."""
    low, high = bounds[name]
    least = {"minimum": low} if or_none else {"above": low}
    return NumberOrTexture(name, default=None, otherwise="its own", maximum=high, unit=unit, text=text, **least)


MESH_RESOLUTION = Number(
    "mesh_resolution", default=0.0, minimum=0, unit="m",
    text="distance of the nodes of a mesh that has this roughness itself, as the shape `seabed` with "
         "`fractal_sediment`: what is longer is left to it; 0: it has none")

ATTRIBUTES = (
    Text("sediment", default="medium sand",
         text="by name: `clay`, `silt`, `fine sand`, `sandy gravel`, ...; an unknown one is answered with all"),
    own("density_ratio", BOUNDS, "density over the water's"),
    own("sound_speed_ratio", BOUNDS, "sound speed over the water's"),
    own("loss", BOUNDS, "imaginary over real wavenumber"),
    own("volume_parameter", BOUNDS, "scattering of the volume: cross section [1/m] over absorption [dB/m]; 0: none",
        or_none=True),
    own("w2", BOUNDS, "strength of the roughness spectrum", unit="m^(4-γ)"),
    own("gamma", BOUNDS, "exponent γ of that spectrum"),
    *CLASSES, MESH_RESOLUTION, COHERENCE, *VARIATION,
)


class SedimentBed(Material):
    """Fluid sediment."""

    law, bounds, declared = Sediment, BOUNDS, ATTRIBUTES
    reflects = True

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, self.declared)
        self.named = _named(attributes, self.law)
        self.classes = class_map_of(attributes, self.named)
        written = {name: getattr(attributes, name) for name in self.bounds}
        self.mesh_resolution = attributes.mesh_resolution
        if self.mesh_resolution and isinstance(attributes.gamma, mi.Texture):
            raise attributes.error("mesh_resolution is written, and gamma is a texture; give gamma as a number.")
        self.variation, self.coherence = variation_of(attributes), attributes.coherence
        super().__init__(props)
        fixed = {name: value for name, value in written.items() if isinstance(value, float)}
        self.sediments: list[Any] = [_made(attributes, self.law, name, fixed) for name in self.named]
        self.varying = [name for name, value in written.items() if isinstance(value, mi.Texture)]
        self.parameters = {}
        for name, (low, high) in self.bounds.items():
            value = written[name]
            if not isinstance(value, mi.Texture):
                value = np.array([getattr(sediment, name) for sediment in self.sediments])
                value = value[:1] if np.ptp(value) == 0 else value
            self.parameters[name] = Parameter(value, LEAST[name] if name in LEAST else low, high, low)
        self.textured = (self.classes is not None or bool(self.varying)
                         or isinstance(self.coherence, mi.Texture))
        self.lib = arrays_of(mi.Float)
        self.arithmetic = Arithmetic(dr, self.lib.Complex2f)
        self._tabulate()

    def _tabulate(self):
        gamma = self.parameters["gamma"]
        alpha = None if gamma.textured or gamma.classes > 1 else 0.5 * gamma.value - 1
        self.log_lobe = LobeTable(self.lib, upload, alpha).look_up
        if self.mesh_resolution:
            self.log_ratio = RatioTable(self.lib, upload, float(gamma.value.numpy()[0])).look_up
            self.cut = dr.opaque(mi.Float, cut(self.mesh_resolution))

    def traverse(self, callback: mi.TraversalCallback) -> None:
        super().traverse(callback)
        for name, parameter in self.parameters.items():
            # the table of the roughness that a mesh leaves is made for one gamma, without derivatives
            parameter.traverse(name, callback, followed=name != "gamma" or not self.mesh_resolution)
        for name, texture in ({} if self.classes is None else self.classes.textures).items():
            callback.put(name, texture, mi.ParamFlags.NonDifferentiable)

    def parameters_changed(self, keys: list[str]) -> None:
        for name, parameter in self.parameters.items():
            parameter.check(f"{self.law.__name__}: {name}")
            parameter.keep()
        self._tabulate()

    def check(self, frequency: float, sound_speed: float) -> None:
        """Refuse frequencies outside the validity of any of the sediments; values of textures are not checked."""
        for sediment in self.sediments:
            if {"w2", "gamma"} & set(self.varying):
                sediment = replace(sediment, w2=LEAST["w2"])
            sediment.check(frequency, 2 * np.pi * frequency / sound_speed)
            if doubt := sediment.doubt(frequency, 2 * np.pi * frequency / sound_speed):
                warnings.warn(doubt, stacklevel=2)

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return σ of surface and volume."""
        below, w2, gamma = self._at(si, active)
        sin_i, sin_s = _sines(wi, wo)
        x, y = wi.x + wo.x, wi.y + wo.y
        seen = x * x + y * y, sin_i + sin_s, _wavenumber(frequency, sound_speed), w2, gamma
        if self.mesh_resolution:
            factor = resolved_factor(dr, self.log_lobe, self.log_ratio, *seen, self.cut)
        else:
            factor = lobe_factor(dr, self.log_lobe, *seen)
        amplitude = below.amplitude(sin_i, sin_s, -(wi.x * wo.x + wi.y * wo.y))
        return dr.select(active, power(amplitude) * factor + below.volume_strength(sin_i, sin_s), 0)

    def coherent_reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                            sound_speed: mi.Float, lowest_wavenumber: mi.Float,
                            active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return R exp(-2 (k h sin θ)²) of a half-space, h² = 2π w2 K^(2 - γ) / (γ - 2) of the roughness above K."""
        below, w2, gamma = self._at(si, active)
        lowest = dr.maximum(lowest_wavenumber, self.cut) if self.mesh_resolution else lowest_wavenumber
        height = (2 * np.pi) * w2 * dr.exp((2 - gamma) * dr.log(lowest)) / (gamma - 2)
        kept = dr.exp(-2 * height * dr.square(_wavenumber(frequency, sound_speed) * sin_grazing))
        # half-spaces use the convention e^(-iωt)
        flat = below.reflection(dr.clip(sin_grazing, 0, 1))
        return dr.select(active, flat.real * kept, 0), dr.select(active, -flat.imag * kept, 0)

    # ---- drawing: the lobe about the specular direction, by `lobe_directions`, or a cosine for the volume
    def drawn_direction(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, frequency: mi.Float, sound_speed: mi.Float,
                        sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool | bool = True) -> mi.Vector3f:
        width, alpha, share = self._lobe(si, wi, frequency, sound_speed, active)
        sine, _ = _sines(wi, wi)
        x, y, z = lobe_shift(wi.x, wi.y, sine, width, alpha, sample2.x, sample2.y)
        return dr.select(sample1 < share, mi.Vector3f(x, y, z), mi.warp.square_to_cosine_hemisphere(sample2))

    def direction_density(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                          sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        width, alpha, share = self._lobe(si, wi, frequency, sound_speed, active)
        sin_i, sin_s = _sines(wi, wo)
        lobe = lobe_density(wi.x, wi.y, sin_i, wo.x, wo.y, width, alpha) * sin_s
        density = share * lobe + (1 - share) * mi.warp.square_to_cosine_hemisphere_pdf(wo)
        return dr.select(active & (wo.z > 0), density, 0)

    def _lobe(self, si, wi, frequency, sound_speed, active):
        """Return the width and exponent of the lobe that directions are drawn from, and its share of the draws."""
        below, w2, gamma = self._at(si, active)
        sine, _ = _sines(wi, wi)
        width = lobe_width(self.log_lobe, sine, _wavenumber(frequency, sound_speed), w2, gamma)
        reflected = power(below.reflection(sine))
        diffuse = np.pi * below.volume_strength(sine, mi.Float(0.7)) / dr.maximum(sine, 1e-4)
        share = dr.clip(reflected / (reflected + diffuse), *SHARES)
        return width, 0.5 * gamma - 1, share

    def _at(self, si, active):
        """Return the parameters at interactions: the half-space, w2 and γ."""
        number = mi.UInt32(0) if self.classes is None else self.classes.at(si, active)
        value = {name: parameter.at(si, number, active) for name, parameter in self.parameters.items()}
        return self._below(value, number, active), value["w2"], value["gamma"]

    def _below(self, value, number, active):
        """Return the half-space under the surface."""
        return Fluid(arithmetic=self.arithmetic, **{name: value[name] for name in FLUID})

    def to_string(self) -> str:
        return f"Sediment[{', '.join(self.named)}]"


def _made(attributes, law, name, fixed):
    """Return the sediment of a name with the written values in place of its own."""
    try:
        return law.of(name, **fixed)
    except ValueError as error:
        raise attributes.error(error) from None


def _named(attributes, law):
    """Return the names of the sediments."""
    texture, classes = attributes.sediment_class, attributes.classes
    if isinstance(texture, float):
        raise attributes.error("sediment_class is a number; give a texture of class numbers, or one sediment by name.")
    together = attributes.given("sediment", "classes")
    if len(together) > 1:
        raise attributes.error("sediment and classes are written; give one of them.")
    if (texture is None) != (classes is None):
        given, missing = ("classes", "sediment_class") if texture is None else ("sediment_class", "classes")
        raise attributes.error(f"{given} is written without {missing}; give both, or one sediment by name.")
    names = [attributes.sediment] if classes is None else [name.strip() for name in classes.split(",")]
    for name in names:
        _made(attributes, law, name, {})
    return names


def _sines(wi, wo):
    """Return the sines of both grazing angles; rounding at an edge may place a direction below the surface."""
    return dr.maximum(mi.Frame3f.cos_theta(wi), 0), dr.maximum(mi.Frame3f.cos_theta(wo), 0)


def _wavenumber(frequency, sound_speed):
    return (2 * np.pi) * frequency / sound_speed


mi.register_bsdf("sediment", SedimentBed)
