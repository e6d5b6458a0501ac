"""Synthetic aperture sonar (`synthetic_aperture`): receivers on one side of a vehicle, with the same resolution at all
ranges.

A transmitter, or several that transmit in turn (a vernier array), and one or more rows of receivers lie along the
track; rows one above the other (``banks``) are for interferometry. Echoes are recorded receiver by receiver while the
platform moves, without the stop-and-hop approximation. `mitsonar.raw_echoes` and ``mitsonar signals`` make the raw
echoes with the true trajectory. `mitsonar.focus`, ``mitsonar focus`` and `mitsonar.render` make the image.

The transmitter is ``transmitter_length`` long and a receiver ``receiver_length``; receivers stand edge to edge. The
image resolves half the longer of the two along the track, and c / (2 ``bandwidth_khz``) across. Each ping fills
``receivers`` times half ``receiver_length`` of the aperture; the next ping covers ``overlap`` receivers of it again,
for micronavigation. The overlap sets the ping rate for the speed; without it pings follow as fast as the range allows.

Tracks are straight, circles (``circle_radius``) or recorded; ``sway``, ``heave``, ``yaw_deg`` and other random motion
disturb them.

`mi.traverse` names the elements' ``tx_position``, ``rx_position``, ``tx_delay`` and ``rx_delay``.

.. code-block:: xml

    <sensor type="synthetic_aperture">
        <string name="preset" value="minehunting_300khz"/>
        <integer name="overlap" value="8"/>
        <point name="start" x="0" y="0" z="-5"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range_min" value="20"/><float name="range" value="60"/></film>
    </sensor>
"""
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.arrays.shading import window_weights
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.sonar.preset_tables import presets
from mitsonar.units import hertz_from_khz, power_from_db

from ..attributes import Angle, Attributes, Choice, FromTable, Integer, Number, Preset, Text
from .array_attributes import MOST_ELEMENTS
from .array_reading import nominal_sound_speed
from .element_keys import GEOMETRY, ElementKeys
from .platform import ROUTE, pings
from .pulse_attributes import PULSE, read_pulse
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, PASS, SELF_NOISE, SOUND_SPEED, SonarSensor

PRESETS = presets("synthetic_aperture")
PRESET = FromTable(table=PRESETS, by="preset")
SIDES = {"port": -1.0, "starboard": 1.0}
GRIDS = ("ground", "slant")
WINDOW_TRIED = 64

ATTRIBUTES = (
    Preset("preset", default="minehunting_300khz", choices=tuple(PRESETS),
           text="source of the defaults marked *preset*"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="carrier frequency"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level on the axis of a transmitter"),
    *(replace(one, default=PRESET) if one.name in ("pulse_ms", "bandwidth_khz") else one for one in PULSE),
    Choice("side", default="starboard", choices=tuple(SIDES), text="side to which the sonar looks"),
    Angle("depression_deg", default=PRESET, minimum=-89, maximum=89,
          text="angle of the elements' normals below the horizontal"),
    Integer("receivers", default=PRESET, minimum=1, maximum=MOST_ELEMENTS, text="number of receivers of a bank"),
    Number("receiver_length", default=PRESET, above=0, maximum=100, unit="m",
           text="length of a receiver along the track"),
    Integer("banks", default=PRESET, minimum=1, maximum=16,
            text="number of banks, rows of receivers one above the other"),
    Number("bank_spacing", default=PRESET, above=0, maximum=100, unit="m",
           text="distance between the middles of the banks, in the plane of the face"),
    Integer("transmitters", default=1, minimum=1, maximum=64,
            text="number of transmitters, which transmit in turn, ping by ping"),
    Number("transmitter_length", default=PRESET, above=0, maximum=100, unit="m",
           text="length of a transmitter along the track"),
    Number("transmitter_spacing", default=None, above=0, maximum=100, unit="m",
           otherwise="half the length of a bank", text="distance between transmitters along the track"),
    Number("transmitter_forward", default=0.0, minimum=-100, maximum=100, unit="m",
           text="forward distance of the middle of the transmitters from the middle of the receivers"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=0.5, maximum=180,
          text="vertical beam width of transmitters and receivers, full width at -3 dB one way; 180: omnidirectional"),
    Number("thin_below_db", default=-30.0, minimum=-80, maximum=0, unit="dB",
           text="two-way beam level, relative to the axis, below which cells in side lobes are thinned out: fewer "
                "cells are used, each stronger, so that the mean energy stays; -80: no thinning"),
    Integer("overlap", default=None, minimum=0, maximum=MOST_ELEMENTS, otherwise="as the range allows",
            text="number of receivers whose places along the aperture two pings have in common: sets the ping rate"),
    Choice("image_grid", default="ground", choices=GRIDS,
           text="grid of the image of `mitsonar.render`: points of a level plane at the bed's mean depth, or slant "
                "ranges"),
    Number("image_spacing", default=None, above=0, maximum=100, unit="m", otherwise="half the resolution",
           text="distance between the points of that grid"),
    Text("image_window", default="taylor 4 30",
         text='window over the angles of the aperture in that image, such as "taylor 4 30" or "boxcar"'),
    Text("range_window", default="taylor 4 30", text="window over the band of the pulse in that image"),
    SOUND_SPEED, *NOISE, SELF_NOISE, pings(40), PASS, ROUTE, *NESTED,
)


class SyntheticAperture(SonarSensor):
    """Synthetic aperture sensor; `mitsonar.survey.synthetic_aperture.kind` makes its echoes and image."""

    kind, declared = "synthetic_aperture", ATTRIBUTES
    follows_offsets = False            # its echoes follow the trajectory

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the rows of elements and the settings of the image."""
        self.preset = attributes.preset
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, attributes.self_noise_db
        self.pulse = read_pulse(attributes, self.frequency)
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        wavelength = self.nominal_sound_speed / self.frequency
        self.transmit, self.receive = _transmitters(attributes, wavelength), _receivers(attributes, wavelength)
        self.bank = np.repeat(np.arange(attributes.banks), attributes.receivers)
        self.grid, self.grid_spacing = attributes.image_grid, attributes.image_spacing
        self.windows = _window(attributes, "image_window"), _window(attributes, "range_window")
        self.thin_below = float(power_from_db(attributes.thin_below_db))
        self.route = _paced(attributes, self.route)

    def element_keys(self) -> ElementKeys:
        return ElementKeys(self.kind, self.transmit, self.receive, GEOMETRY)

    def to_string(self) -> str:
        return f"SyntheticAperture[{self.frequency / 1000:g} kHz, {self.receive.elements} receivers]"


def _looks(attributes: Attributes) -> np.ndarray:
    """Return the normal of all elements, body frame."""
    angle = attributes.depression_deg
    return np.array([0.0, SIDES[attributes.side] * np.cos(angle), np.sin(angle)])


def _upwards(attributes: Attributes) -> np.ndarray:
    """Return the direction from a bank to the bank above it, at right angles to their normal."""
    angle = attributes.depression_deg
    return np.array([0.0, SIDES[attributes.side] * np.sin(angle), -np.cos(angle)])


def _transmitters(attributes: Attributes, wavelength: float) -> Array:
    count = attributes.transmitters
    spacing = attributes.transmitter_spacing or 0.5 * attributes.receivers * attributes.receiver_length
    if count == 1 and attributes.given("transmitter_spacing"):
        raise attributes.error("transmitter_spacing is given, and there is one transmitter; leave it out, or give "
                               "transmitters more.")
    along = attributes.transmitter_forward + (np.arange(count) - 0.5 * (count - 1)) * spacing
    return _elements(attributes, along[:, None] * np.array([1.0, 0.0, 0.0]), attributes.transmitter_length, wavelength)


def _receivers(attributes: Attributes, wavelength: float) -> Array:
    count, banks = attributes.receivers, attributes.banks
    if count * banks > MOST_ELEMENTS:
        raise attributes.error(f"banks times receivers are {count * banks}, and {MOST_ELEMENTS} elements are the most; "
                               "take fewer.")
    if banks == 1 and attributes.given("bank_spacing"):
        raise attributes.error("bank_spacing is given, and there is one bank; leave it out, or give banks more.")
    along = (np.arange(count) - 0.5 * (count - 1)) * attributes.receiver_length
    above = (0.5 * (banks - 1) - np.arange(banks)) * attributes.bank_spacing
    place = along[:, None] * np.array([1.0, 0.0, 0.0]) + above[:, None, None] * _upwards(attributes)
    return _elements(attributes, place.reshape(-1, 3), attributes.receiver_length, wavelength)


def _elements(attributes: Attributes, place: np.ndarray, length: float, wavelength: float) -> Array:
    height = length_for_beam_width(attributes.vertical_beam_width_deg, wavelength)
    return element_array(place, normal=_looks(attributes), along="forward", length=length, height=height,
                         pattern="rectangular", baffle="hard")


def _window(attributes: Attributes, name: str) -> str:
    """Return the name of a window after a check that it exists."""
    text = getattr(attributes, name)
    try:
        window_weights(text, WINDOW_TRIED)
    except ValueError as error:
        raise attributes.error(f"{name}: {error}") from None
    return text


def _paced(attributes: Attributes, route):
    """Return the route with the ping rate that the overlap needs at its speed."""
    overlap, count = attributes.overlap, attributes.receivers
    if overlap is None:
        return route
    if attributes.given("ping_rate_hz"):
        raise attributes.error("overlap and ping_rate_hz are both given, and each sets the other; leave one of them "
                               "out.")
    if overlap >= count:
        raise attributes.error(f"overlap is {overlap}, and there are {count} receivers; give at most {count - 1}.")
    if not route.speed or (route.record is not None and attributes.track is not None):
        raise attributes.error("overlap sets the ping rate for a speed above 0 that the scene writes; of a recorded "
                               "track give ping_rate_hz.")
    return replace(route, ping_rate=2 * route.speed / ((count - overlap) * attributes.receiver_length))


mi.register_sensor("synthetic_aperture", SyntheticAperture)
