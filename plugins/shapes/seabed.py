"""Synthetic seabed (`seabed`): a rectangle with slope, waves, sand ripples and roughness, in any combination.

All parts add up. Each part is a function of the shape's own coordinates, so a longer bed shows more of the same seabed.
The grid always has a node at the origin, and covers at least ``length`` and ``width``. A wave needs at least four nodes
a wavelength.

.. code-block:: xml

    <shape type="seabed" id="seabed">
        <float name="depth" value="20"/>
        <float name="length" value="100"/> <float name="width" value="150"/> <float name="spacing" value="0.1"/>
        <float name="ripple_wavelength" value="0.8"/> <float name="ripple_height" value="0.1"/>
        <string name="fractal_sediment" value="medium sand"/>
        <ref id="sand"/>
    </shape>
"""
import mitsuba as mi
import numpy as np

from mitsonar.seabed.fractal import Fractal
from mitsonar.seabed.relief import Plane, Sinusoid
from mitsonar.seabed.ripples import Ripples
from mitsonar.seabed.roughness import RoughnessSpectrum

from ..attributes import Angle, Attributes, Integer, Number, Text
from .grid_mesh import MATERIAL, SMOOTH_NORMALS, TO_WORLD, fill, triangulate

MOST_NODES = 5e7        # 100 million triangles: about 10 GB once Embree has built its tree
NODES_PER_WAVE = 4      # below this the crests of a wave are cut off at random

SINE = (
    Number("sine_wavelength", default=None, above=0, unit="m", text="wavelength of sinusoidal waves, crest to crest"),
    Number("sine_height", default=None, minimum=0, unit="m", text="height of sinusoidal waves, trough to crest"),
    Angle("sine_heading_deg", default=0.0, text="compass heading across the crests of sinusoidal waves"),
)
RIPPLE = (
    Number("ripple_wavelength", default=None, above=0, unit="m", text="wavelength of sand ripples, crest to crest"),
    Number("ripple_height", default=None, minimum=0, unit="m", text="height of sand ripples, trough to crest"),
    Angle("ripple_heading_deg", default=0.0, text="compass heading that the steep sides of ripples face"),
    Number("ripple_asymmetry", default=0.0, minimum=0, below=1,
           text="asymmetry of ripples; 0: equal sides, towards 1: a vertical lee"),
    Number("ripple_sharpness", default=0.0, minimum=0, maximum=1,
           text="sharpness of ripples; 0: sinusoidal, 1: pointed crests between rounded troughs"),
    Number("ripple_wander", default=0.0, minimum=0, unit="m", text="rms wander of the ripples' crests"),
    Number("ripple_wander_length", default=None, above=0, unit="m", otherwise="8 wavelengths",
           text="distance along a crest over which it wanders"),
    Number("ripple_defects", default=0.0, minimum=0, unit="1/m^2", text="density of forks and ends of crests"),
)
FRACTAL = (
    Text("fractal_sediment", default=None,
         text='power-law roughness of a sediment of TR 9407, such as "medium sand"; or `fractal_rms` or `fractal_w2`'),
    Number("fractal_rms", default=None, minimum=0, unit="m", text="rms height of power-law roughness"),
    Number("fractal_w2", default=None, minimum=0, unit="m^(4-γ)", text="spectral strength of power-law roughness"),
    Number("fractal_gamma", default=3.25, above=2, below=4,
           text="spectral exponent γ of power-law roughness, with `fractal_rms` or `fractal_w2`"),
    Number("fractal_outer_scale", default=10.0, above=0, unit="m",
           text="outer scale of power-law roughness: longer waves level off"),
)
ATTRIBUTES = (
    Number("depth", unit="m", text="depth of the mean bed below the origin, positive down"),
    Number("length", default=200.0, above=0, unit="m", text="extent to the north (y)"),
    Number("width", default=200.0, above=0, unit="m", text="extent to the east (x)"),
    Number("spacing", default=0.5, above=0, unit="m",
           text="node distance; at most a quarter of the shortest wavelength"),
    Integer("seed", default=0, minimum=0, text="seed of everything random"),
    Angle("slope_deg", default=0.0, minimum=0, below=90, text="slope of the mean bed"),
    Angle("slope_heading_deg", default=0.0, text="compass heading in which it descends"),
    *SINE, *RIPPLE, *FRACTAL, SMOOTH_NORMALS, TO_WORLD, MATERIAL,
)


class Seabed(mi.Mesh):
    """Mesh of a synthetic seabed; the class attribute ``seabed`` marks it as a seabed."""

    seabed = True

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        spacing, depth = attributes.spacing, attributes.depth
        x, y = (_axis(extent, spacing) for extent in (attributes.width, attributes.length))
        relief = _relief(attributes)
        if x.size * y.size > MOST_NODES:
            raise attributes.error(f"{y.size} x {x.size} nodes at a spacing of {spacing} m are more than "
                                   f"{MOST_NODES:.0e}; use a coarser spacing or a smaller bed.")
        grid = triangulate(x, y, relief.on_grid(x, y) - depth, attributes.to_world)
        self.smooth_normals = attributes.smooth_normals
        super().__init__("seabed", len(grid.vertices), len(grid.faces), props=props,
                         has_vertex_normals=attributes.smooth_normals, has_vertex_texcoords=True)
        fill(self, grid)
        self._description = f"Seabed[{y.size} x {x.size} nodes at {spacing} m, depth {depth} m, {relief}]"

    def to_string(self) -> str:
        """Return the parts of the bed."""
        return self._description


def _axis(extent, spacing):
    half = int(np.ceil(extent / 2 / spacing - 1e-9))
    return np.arange(-half, half + 1) * spacing


def _relief(attributes):
    parts = (_sinusoid(attributes), _ripples(attributes), _fractal(attributes))
    plane = Plane(slope=attributes.slope_deg, heading=attributes.slope_heading_deg)
    return sum(filter(None, parts), start=plane)


def _sinusoid(attributes):
    wavelength, height = attributes.sine_wavelength, attributes.sine_height
    if not _is_wave(attributes, SINE, wavelength, height):
        return None
    return Sinusoid(wavelength=wavelength, height=height, heading=attributes.sine_heading_deg)


def _ripples(attributes):
    wavelength, height = attributes.ripple_wavelength, attributes.ripple_height
    if not _is_wave(attributes, RIPPLE, wavelength, height):
        return None
    return Ripples(wavelength=wavelength, height=height, heading=attributes.ripple_heading_deg,
                   asymmetry=attributes.ripple_asymmetry, sharpness=attributes.ripple_sharpness,
                   wander=attributes.ripple_wander, wander_length=attributes.ripple_wander_length,
                   defect_density=attributes.ripple_defects, seed=attributes.seed)


def _is_wave(attributes, declared, wavelength, height):
    """Return True if a wave is requested; refuse an incomplete one, or one too short for the grid."""
    names, spacing = [one.name for one in declared], attributes.spacing
    given = attributes.given(*names)
    missing = [name for name, value in zip(names, (wavelength, height)) if value is None]
    if given and missing:
        raise attributes.error(f"{given[0]} is written without {' and '.join(missing)}.")
    if given and wavelength < NODES_PER_WAVE * spacing:
        raise attributes.error(f"{names[0]} is {wavelength} m on a grid of {spacing} m; a wave needs {NODES_PER_WAVE} "
                               f"nodes: use spacing <= {wavelength / NODES_PER_WAVE:g}.")
    return bool(given)


def _fractal(attributes):
    strengths = attributes.given("fractal_sediment", "fractal_w2", "fractal_rms")
    details = attributes.given("fractal_gamma", "fractal_outer_scale")
    sediment, gamma, outer_scale = attributes.fractal_sediment, attributes.fractal_gamma, attributes.fractal_outer_scale
    if len(strengths) > 1:
        raise attributes.error(f"{' and '.join(strengths)} are written; give one of them.")
    if details and not strengths:
        raise attributes.error(f"{details[0]} is written; give fractal_sediment, fractal_w2 or fractal_rms with it.")
    if sediment is not None and "fractal_gamma" in details:
        raise attributes.error("fractal_gamma is written, but the sediment has its own; give fractal_w2 instead.")
    if not strengths:
        return None
    if sediment is not None:
        spectrum = RoughnessSpectrum.of_sediment(sediment, outer_scale=outer_scale)
    elif attributes.fractal_rms is not None:
        spectrum = RoughnessSpectrum.of_height(attributes.fractal_rms, gamma=gamma, outer_scale=outer_scale)
    else:
        spectrum = RoughnessSpectrum(w2=attributes.fractal_w2, gamma=gamma, outer_scale=outer_scale)
    return Fractal(spectrum=spectrum, seed=attributes.seed)


mi.register_shape("seabed", Seabed)
