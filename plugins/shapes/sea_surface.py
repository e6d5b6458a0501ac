"""Sea surface (`sea_surface`): a square at z = 0 about the origin, rough by its material; level, or with waves.

Tracks and altitudes refer to the seabed, not to this surface.

`waves` makes the surface move: a mesh of the long waves at the time of each ping, by linear theory in deep water
(`mitsonar.water.sea_waves`). Its squares are 1/256 of `size`, and it has the waves that are longer than four of them;
the slopes of shorter ones stay in the material. What scatters there moves with the water. Beyond `size` the surface is
level, and the sonar stays within it. Without wind the surface is a mirror, which the waves lift but do not tilt: see
the manual.

.. code-block:: xml

    <shape type="sea_surface"><float name="wind_speed" value="8"/></shape>

    <shape type="sea_surface">
        <float name="wind_speed" value="6"/> <string name="waves" value="jonswap"/>
        <float name="wave_height" value="0.8"/> <float name="wave_period" value="4"/>
        <float name="wave_heading_deg" value="90"/>
    </shape>
"""
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.io.scene_files import wave_spectra
from mitsonar.water.sea_waves import (
    USUAL_STEEPNESS,
    SeaWaves,
    WaveSpectrum,
    developed_sea,
    wavelength,
)

from ..attributes import Angle, Attributes, Choice, File, Integer, Nested, Number
from ..bsdfs.windy_sea import WIND_SPEED
from .grid_mesh import fill, triangulate

SIDE = 4000.0                      # [m]
SQUARES = 64                       # along a side
WAVY_SQUARES = 256                 # likewise, with waves
PEAK_WAVES = 8                     # along a side, with waves
WIDER, WIDEST = 1.5, 125.0         # growth of the steps of the level border, and the widest [m]
FINEST = 4                         # squares to the shortest wave

ATTRIBUTES = (
    Number("size", default=None, above=0, maximum=1e5, unit="m",
           otherwise="4000, with waves eight wavelengths of their peak", text="side of the square about the origin"),
    replace(WIND_SPEED, text=f"{WIND_SPEED.text}, for the default material and the waves"),
    Choice("waves", default="none", choices=("none", "pierson_moskowitz", "jonswap"),
           text="spectrum of the waves: of a sea that the wind has raised in the end, or of one that still grows"),
    File("spectrum", default=None, text="CSV file of another spectrum, columns `frequency_hz` and `density_m2_hz`; "
                                        "not with `waves`"),
    Number("wave_height", default=None, above=0, maximum=30, unit="m",
           otherwise="of the sea that the wind raises in the end", text="significant height"),
    Number("wave_period", default=None, above=0, maximum=30, unit="s",
           otherwise="that of the wind's sea, or of a steepness of 1/25 if `wave_height` is written",
           text="period of the peak of the spectrum"),
    Angle("wave_heading_deg", default=0.0, text="heading towards which the waves travel, clockwise from north"),
    Number("spreading", default=10.0, minimum=0, maximum=200, text="s of the spread cos^2s(θ/2); 0: all directions"),
    Number("peak_enhancement", default=3.3, minimum=1, maximum=10, text="γ of `jonswap`"),
    Integer("wave_seed", default=0, minimum=0, text="seed of the waves"),
    Nested("bsdf", default=None, otherwise="`windy_sea`", text="material of the surface"),
)


class SeaSurface(mi.Mesh):
    """Level or wavy square at the sea surface."""

    sea_surface = True
    border = 0

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        if attributes.given("to_world"):
            raise attributes.error("to_world is given; the sea surface lies level at z = 0: leave it out.")
        spectrum = _spectrum(attributes)
        self.size = attributes.size or SIDE
        self.waves: SeaWaves | None = None
        squares, longest = SQUARES, None
        if spectrum is not None:
            self.size = attributes.size or PEAK_WAVES * wavelength(spectrum.peak_period)
            squares, longest = WAVY_SQUARES, FINEST * self.size / WAVY_SQUARES
            try:
                self.waves = spectrum.waves(attributes.wave_seed, shortest=longest)
            except ValueError as error:
                raise attributes.error(f"{error}.") from None
        if attributes.bsdf is None:
            windy = {"type": "windy_sea", "wind_speed": attributes.wind_speed}
            props["bsdf"] = mi.load_dict(windy if longest is None else {**windy, "longest_wave": longest})
        elif attributes.given("wind_speed") and (spectrum is None or attributes.given("wave_height", "spectrum")):
            raise attributes.error("wind_speed is given beside a nested bsdf; give it to the bsdf.")
        # many, so that arrays may cut each into cells of millimetres
        edges = 0.5 * self.size * np.linspace(-1, 1, squares + 1)
        if spectrum is not None:
            beside = _border(float(edges[-1]), float(edges[-1] - edges[-2]))
            edges, self.border = np.concatenate([-beside[::-1], edges, beside]), len(beside)
        self.nodes = edges
        grid = triangulate(edges, edges, np.zeros((len(edges), len(edges))), np.eye(4))
        self.rest = grid.vertices.astype(float)
        super().__init__("sea_surface", len(grid.vertices), len(grid.faces), props=props, has_vertex_texcoords=True)
        fill(self, grid)

    def to_string(self) -> str:
        waves = "" if self.waves is None else f", waves of {4 * self.waves.variance**0.5:.3g} m"
        return f"SeaSurface[{self.size:g} m{waves}, {self.bsdf()}]"


def _border(edge: float, spacing: float) -> np.ndarray:
    """Return the places [m] of the nodes of a level border, at ever wider steps beyond the last node with waves."""
    places = [edge]
    while len(places) < 3 or places[-1] < SIDE / 2:
        spacing = min(WIDER * spacing, WIDEST)
        places.append(places[-1] + spacing)
    return np.array(places[1:])


def _spectrum(attributes: Attributes) -> WaveSpectrum | None:
    """Return the spectrum of the waves; None without waves."""
    own, directions = ("wave_height", "wave_period"), ("wave_heading_deg", "spreading", "wave_seed")
    spread = {"heading": attributes.wave_heading_deg, "spreading": attributes.spreading}
    if attributes.waves != "jonswap" and attributes.given("peak_enhancement"):
        raise attributes.error("peak_enhancement is given, and only waves jonswap have it; leave it out.")
    if attributes.spectrum is not None:
        if written := attributes.given("waves", *own):
            raise attributes.error(f"spectrum and {written[0]} are both given; leave one of them out.")
        try:
            return wave_spectra.read(attributes.spectrum, **spread)
        except ValueError as error:
            raise attributes.error(error) from None
    if attributes.waves == "none":
        if written := attributes.given(*own, *directions):
            raise attributes.error(f"{written[0]} is given without waves; give waves or a spectrum too, or leave it "
                                   "out.")
        return None
    developed = developed_sea(attributes.wind_speed)
    height = attributes.wave_height or developed.height
    if not height:
        raise attributes.error("waves are given, but no wind and no wave_height; give one of them.")
    usual = developed.period if attributes.wave_height is None else (
        2 * np.pi * height / (USUAL_STEEPNESS * 9.81)) ** 0.5
    try:
        return WaveSpectrum.model(height, attributes.wave_period or usual, **spread,
                                  enhancement=attributes.peak_enhancement if attributes.waves == "jonswap" else 1.0)
    except ValueError as error:
        raise attributes.error(f"{error}.") from None


mi.register_shape("sea_surface", SeaSurface)
