"""Synthetic seabed (`seabed`): a rectangle with slope, waves, sand ripples, roughness and marks, in any combination.

All parts add up. Each part is a function of the shape's own coordinates, so a longer bed shows more of the same seabed.
The grid always has a node at the origin, and covers at least ``length`` and ``width``. A wave needs at least four nodes
a wavelength.

.. code-block:: xml

    <shape type="seabed" id="seabed">
        <float name="depth" value="20"/>
        <float name="length" value="100"/> <float name="width" value="150"/> <float name="spacing" value="0.1"/>
        <float name="ripple_wavelength" value="0.8"/> <float name="ripple_height" value="0.1"/>
        <string name="fractal_sediment" value="medium sand"/>
        <float name="pockmark_density" value="0.002"/>
        <float name="pockmark_diameter" value="5"/> <float name="pockmark_depth" value="0.5"/>
        <ref id="sand"/>
    </shape>

About objects that the shape refers to by `<ref>`, and about `targets` that have a `scour_depth`, the bed is scoured.
"""
import mitsuba as mi
import numpy as np

from mitsonar.scene.queries.height_field import withhold
from mitsonar.seabed.fractal import Fractal
from mitsonar.seabed.marks import DragMarks, PockMarks, SandRibbons
from mitsonar.seabed.relief import Plane, Sinusoid
from mitsonar.seabed.ripples import Ripples
from mitsonar.seabed.roughness import RoughnessSpectrum

from ..attributes import Angle, Attributes, Integer, Number, Text
from .grid_mesh import MATERIAL, SMOOTH_NORMALS, TO_WORLD, fill, triangulate
from .scoured import SCOUR, STANDING, Ground, scour_about_standing

MOST_NODES = 5e7        # 100 million triangles: about 10 GB once Embree has built its tree
NODES_PER_WAVE = 4      # below this the crests of a wave are cut off at random
NODES_PER_FURROW = 3    # between its berms, which are as long a wave as NODES_PER_WAVE allows

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
POCKMARK = (
    Number("pockmark_density", default=None, minimum=0, unit="1/m^2",
           text="number of pock marks per area; in soft mud 1e-5 to 1e-2, of a few metres to some hundred metres "
                "(Hovland and Judd 1988)"),
    Number("pockmark_diameter", default=None, above=0, unit="m", text="mean diameter of pock marks, rim to rim"),
    Number("pockmark_depth", default=None, minimum=0, unit="m",
           text="mean depth of pock marks, mostly 0.02 to 0.1 of the diameter"),
    Number("pockmark_spread", default=0.3, minimum=0, below=1,
           text="diameters and depths vary by factors from 1 - spread to 1 + spread"),
)
DRAG = (
    Number("drag_density", default=None, minimum=0, unit="1/m^2",
           text="number of drag marks per area, of trawls, anchors or ice: 1e-5 to 1e-2"),
    Number("drag_width", default=None, above=0, unit="m",
           text="width of drag marks between their berms: 0.2 to 2 of trawls and anchors, tens of metres of ice"),
    Number("drag_depth", default=None, minimum=0, unit="m",
           text="depth of drag marks, at most half the width; mostly 0.02 to 0.3 of trawls and anchors"),
    Number("drag_length", default=None, above=0, unit="m",
           text="mean length of drag marks, at least 12 widths; they have half to one and a half of it"),
    Angle("drag_heading_deg", default=0.0, text="mean compass heading along drag marks"),
    Angle("drag_heading_spread_deg", default=12.0, minimum=0, maximum=180,
          text="standard deviation of the heading of drag marks"),
)
RIBBON = (
    Number("ribbon_spacing", default=None, above=0, unit="m", text="distance between the crests of sand ribbons"),
    Number("ribbon_height", default=None, minimum=0, unit="m",
           text="height of sand ribbons over the bed between them: 0.02 to 1 (Kenyon 1970)"),
    Number("ribbon_width", default=None, above=0, unit="m", otherwise="half the spacing", text="width of sand ribbons"),
    Angle("ribbon_heading_deg", default=0.0, text="compass heading along sand ribbons, that of the current"),
    Number("ribbon_wander", default=0.0, minimum=0, unit="m", text="rms wander of the ribbons' crests"),
    Number("ribbon_wander_length", default=None, above=0, unit="m", otherwise="4 spacings",
           text="distance over which a ribbon wanders"),
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
    *SINE, *RIPPLE, *FRACTAL, *POCKMARK, *DRAG, *RIBBON, *SCOUR, STANDING, SMOOTH_NORMALS, TO_WORLD, MATERIAL,
)


class Seabed(mi.Mesh):
    """Mesh of a synthetic seabed; the class attribute ``seabed`` marks it as a seabed."""

    seabed = True
    ground: Ground | None = None

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
        scour_about_standing(attributes, self)
        withhold(self)
        self._description = f"Seabed[{y.size} x {x.size} nodes at {spacing} m, depth {depth} m, {relief}]"

    def to_string(self) -> str:
        """Return the parts of the bed."""
        return self._description


def _axis(extent, spacing):
    half = int(np.ceil(extent / 2 / spacing - 1e-9))
    return np.arange(-half, half + 1) * spacing


def _relief(attributes):
    makers = _sinusoid, _ripples, _fractal, _pockmarks, _drag_marks, _ribbons
    plane = Plane(slope=attributes.slope_deg, heading=attributes.slope_heading_deg)
    return sum(filter(None, (make(attributes) for make in makers)), start=plane)


def _sinusoid(attributes):
    if not _is_written(attributes, SINE, needed=2, finest="sine_wavelength"):
        return None
    return Sinusoid(wavelength=attributes.sine_wavelength, height=attributes.sine_height,
                    heading=attributes.sine_heading_deg)


def _ripples(attributes):
    if not _is_written(attributes, RIPPLE, needed=2, finest="ripple_wavelength"):
        return None
    return Ripples(wavelength=attributes.ripple_wavelength, height=attributes.ripple_height,
                   heading=attributes.ripple_heading_deg, asymmetry=attributes.ripple_asymmetry,
                   sharpness=attributes.ripple_sharpness, wander=attributes.ripple_wander,
                   wander_length=attributes.ripple_wander_length, defect_density=attributes.ripple_defects,
                   seed=attributes.seed)


def _pockmarks(attributes):
    if not _is_written(attributes, POCKMARK, needed=3, finest="pockmark_diameter",
                       smallest=1 - attributes.pockmark_spread):
        return None
    return PockMarks(density=attributes.pockmark_density, diameter=attributes.pockmark_diameter,
                     depth=attributes.pockmark_depth, spread=attributes.pockmark_spread, seed=attributes.seed)


def _drag_marks(attributes):
    if not _is_written(attributes, DRAG, needed=4, finest="drag_width", nodes=NODES_PER_FURROW):
        return None
    return DragMarks(density=attributes.drag_density, width=attributes.drag_width, depth=attributes.drag_depth,
                     length=attributes.drag_length, heading=attributes.drag_heading_deg,
                     heading_spread=attributes.drag_heading_spread_deg, seed=attributes.seed)


def _ribbons(attributes):
    finest = "ribbon_spacing" if attributes.ribbon_width is None else "ribbon_width"
    if not _is_written(attributes, RIBBON, needed=2, finest=finest, smallest=0.5 if finest == "ribbon_spacing" else 1):
        return None
    return SandRibbons(spacing=attributes.ribbon_spacing, height=attributes.ribbon_height,
                       width=attributes.ribbon_width, heading=attributes.ribbon_heading_deg,
                       wander=attributes.ribbon_wander, wander_length=attributes.ribbon_wander_length,
                       seed=attributes.seed)


def _is_written(attributes, declared, *, needed, finest, nodes=NODES_PER_WAVE, smallest=1.0):
    """Return True if a part is written; refuse one without its first ``needed`` attributes, or too fine for the grid.

    The part varies over the share ``smallest`` of the attribute ``finest``, and needs so many nodes there.
    """
    names, spacing = [one.name for one in declared], attributes.spacing
    given = attributes.given(*names)
    missing = [name for name in names[:needed] if getattr(attributes, name) is None]
    if given and missing:
        raise attributes.error(f"{given[0]} is written without {' and '.join(missing)}.")
    if given and getattr(attributes, names[0]) == 0:
        return False                                                   # a density of nothing needs no nodes
    if given and smallest * getattr(attributes, finest) < nodes * spacing:
        narrowest = smallest * getattr(attributes, finest)
        part = "a wave" if finest.endswith("wavelength") else f"the narrowest, {narrowest:g} m,"
        raise attributes.error(f"{finest} is {getattr(attributes, finest)} m on a grid of {spacing} m; {part} needs "
                               f"{nodes} nodes: use spacing <= {narrowest / nodes:g}.")
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
