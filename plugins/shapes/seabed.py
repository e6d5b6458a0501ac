"""Shape ``seabed``: a rectangle of seabed with slope, waves, sand ripples and roughness, in any combination."""
import numpy as np

import mitsuba as mi
from mitsonar.plugins.attributes import Attributes
from mitsonar.plugins.shapes.grid_mesh import fill, triangulate
from mitsonar.scattering import Fractal, Plane, Ripples, RoughnessSpectrum, Sinusoid

_MOST_NODES = 5e7       # 100 million triangles: about 10 GB once Embree has built its tree
_NODES_PER_WAVE = 4     # below this the crests of a wave are cut off at random


class Seabed(mi.Mesh):
    """Synthesise a seabed about the origin of the shape.

    ======================== ========= =====================================================================
    ``length``, ``width``    200       extent along y (north) and x (east) [m]
    ``spacing``              0.5       distance of the grid's nodes [m]
    ``depth``                          depth of the mean bed below the origin, positive down [m]
    ``seed``                 0         realisation of everything random
    ``slope_deg``            0         angle of the bed below the horizon
    ``slope_heading_deg``    0         compass heading in which it descends
    ``sine_wavelength``                sinusoidal waves: crest to crest [m]
    ``sine_height``                    trough to crest [m]
    ``sine_heading_deg``     0         compass heading at right angles to the crests
    ``ripple_wavelength``              sand ripples: crest to crest [m]
    ``ripple_height``                  trough to crest [m]
    ``ripple_heading_deg``   0         compass heading the steep sides face
    ``ripple_asymmetry``     0         0 equal sides, towards 1 a vertical lee
    ``ripple_sharpness``     0         0 sinusoidal, 1 pointed crests between rounded troughs
    ``ripple_wander``        0         root-mean-square displacement of the crests [m]
    ``ripple_wander_length``           distance over which they wander [m], 8 wavelengths
    ``ripple_defects``       0         forks and ends of crests per area [1/m^2]
    ``fractal_sediment``               roughness of a sediment of TR 9407, such as "medium sand"; or
    ``fractal_w2``                     spectral strength [m^(4 - gamma)]; or
    ``fractal_rms``                    root-mean-square height [m]
    ``fractal_gamma``        3.25      spectral exponent, for the latter two
    ``fractal_outer_scale``  10        wavelength above which the roughness levels off [m]
    ``to_world``                       applied to the finished mesh
    ======================== ========= =====================================================================

    All parts add up. They stand in absolute coordinates of the shape: a longer bed shows more of the same seabed. The
    grid always has a node at the origin, and reaches at least as far as asked.

    .. code-block:: python

        "bed": {"type": "seabed", "length": 100.0, "width": 150.0, "spacing": 0.1, "depth": 20.0,
                "ripple_wavelength": 0.8, "ripple_height": 0.1, "fractal_sediment": "medium sand",
                "bsdf": {"type": "lambert"}}

    The class attribute ``seabed`` is True: whoever looks for the seabed finds it by that.
    """

    seabed = True

    def __init__(self, props):
        attributes = Attributes(props)
        spacing = attributes.number("spacing", 0.5, unit="m", above=0)
        x, y = (_axis(attributes.number(name, 200.0, unit="m", above=0), spacing) for name in ("width", "length"))
        depth = attributes.number("depth", unit="m")
        to_world = attributes.matrix()
        relief = _relief(attributes, spacing)
        attributes.finish()
        if x.size * y.size > _MOST_NODES:
            raise attributes.error(f"{y.size} x {x.size} nodes at a spacing of {spacing} m are more than "
                                   f"{_MOST_NODES:.0e}; use a coarser spacing or a smaller bed.")
        grid = triangulate(x, y, relief.on_grid(x, y) - depth, to_world)
        super().__init__("seabed", len(grid.vertices), len(grid.faces), props=props, has_vertex_texcoords=True)
        fill(self, grid)
        self._description = f"Seabed[{y.size} x {x.size} nodes at {spacing} m, depth {depth} m, {relief}]"

    def to_string(self):
        """Say what the bed is made of."""
        return self._description


def _axis(extent, spacing):
    half = int(np.ceil(extent / 2 / spacing - 1e-9))
    return np.arange(-half, half + 1) * spacing


def _relief(attributes, spacing):
    seed = attributes.integer("seed", 0, minimum=0)
    plane = Plane(slope=attributes.angle("slope_deg", 0, minimum=0, below=90),
                  heading=attributes.angle("slope_heading_deg", 0))
    parts = (_sinusoid(attributes, spacing), _ripples(attributes, spacing, seed), _fractal(attributes, seed))
    return sum(filter(None, parts), start=plane)


def _sinusoid(attributes, spacing):
    shape = {"wavelength": attributes.number("sine_wavelength", None, unit="m", above=0),
             "height": attributes.number("sine_height", None, unit="m", minimum=0)}
    heading = attributes.angle("sine_heading_deg", 0)
    return Sinusoid(**shape, heading=heading) if _is_wave(attributes, "sine", shape, spacing) else None


def _ripples(attributes, spacing, seed):
    shape = {"wavelength": attributes.number("ripple_wavelength", None, unit="m", above=0),
             "height": attributes.number("ripple_height", None, unit="m", minimum=0)}
    details = {"heading": attributes.angle("ripple_heading_deg", 0),
               "asymmetry": attributes.number("ripple_asymmetry", 0.0, minimum=0, below=1),
               "sharpness": attributes.number("ripple_sharpness", 0.0, minimum=0, maximum=1),
               "wander": attributes.number("ripple_wander", 0.0, unit="m", minimum=0),
               "wander_length": attributes.number("ripple_wander_length", None, unit="m", above=0),
               "defect_density": attributes.number("ripple_defects", 0.0, unit="1/m^2", minimum=0)}
    return Ripples(**shape, **details, seed=seed) if _is_wave(attributes, "ripple", shape, spacing) else None


def _is_wave(attributes, kind, shape, spacing):
    """Tell whether a wave is asked for, and refuse half of one or one that the grid cannot hold."""
    given = attributes.given(*(name for name in attributes.props.keys() if name.startswith(f"{kind}_")))
    missing = [f"{kind}_{name}" for name, value in shape.items() if value is None]
    if given and missing:
        raise attributes.error(f"{given[0]} is written without {' and '.join(missing)}.")
    if given and shape["wavelength"] < _NODES_PER_WAVE * spacing:
        raise attributes.error(f"{kind}_wavelength is {shape['wavelength']} m on a grid of {spacing} m; a wave needs "
                               f"{_NODES_PER_WAVE} nodes: use spacing <= {shape['wavelength'] / _NODES_PER_WAVE:g}.")
    return bool(given)


def _fractal(attributes, seed):
    sediment = attributes.text("fractal_sediment", None)
    w2 = attributes.number("fractal_w2", None, minimum=0)
    rms = attributes.number("fractal_rms", None, unit="m", minimum=0)
    gamma = attributes.number("fractal_gamma", 3.25, above=2, below=4)
    outer_scale = attributes.number("fractal_outer_scale", 10.0, unit="m", above=0)
    strengths = attributes.given("fractal_sediment", "fractal_w2", "fractal_rms")
    details = attributes.given("fractal_gamma", "fractal_outer_scale")
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
    elif rms is not None:
        spectrum = RoughnessSpectrum.of_height(rms, gamma=gamma, outer_scale=outer_scale)
    else:
        spectrum = RoughnessSpectrum(w2=w2, gamma=gamma, outer_scale=outer_scale)
    return Fractal(spectrum=spectrum, seed=seed)


mi.register_shape("seabed", Seabed)
