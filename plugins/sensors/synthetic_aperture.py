"""Synthetic aperture sonar (`synthetic_aperture`): receivers that look aside, and images as fine far off as near.

One side of a vehicle. A transmitter, or several that take turns (a vernier array), and one row of receivers or more,
one above the other (``banks``, for interferometry), stand along the track. Their echoes are recorded receiver by
receiver, from where each is at its moment: nothing stops for a ping. `mitsonar.raw_echoes` and ``mitsonar signals``
give them with the true trajectory; `mitsonar.focus` and ``mitsonar focus`` make the image, and so does
`mitsonar.render`.

The transmitter is ``transmitter_length`` long, a receiver ``receiver_length``, and receivers stand edge to edge. An
image resolves half the longer of the two along the track, and c / (2 ``bandwidth_khz``) across. Each ping fills the
aperture for ``receivers`` times half ``receiver_length``; ``overlap`` receivers of it are covered again by the next
one, for micronavigation. It sets the ping rate for the speed; without it pings come as fast as the range allows.

Tracks are straight, ``circle_radius`` about the start, or recorded, and ``sway``, ``heave``, ``yaw_deg`` and the like
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
           text="where the defaults marked *preset* come from"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="carrier"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="on the axis of a transmitter"),
    *(replace(one, default=PRESET) if one.name in ("pulse_ms", "bandwidth_khz") else one for one in PULSE),
    Choice("side", default="starboard", choices=tuple(SIDES), text="that it looks to"),
    Angle("depression_deg", default=PRESET, minimum=-89, maximum=89, text="of where it looks, below the horizontal"),
    Integer("receivers", default=PRESET, minimum=1, maximum=MOST_ELEMENTS, text="of a bank"),
    Number("receiver_length", default=PRESET, above=0, maximum=100, unit="m", text="along the track"),
    Integer("banks", default=PRESET, minimum=1, maximum=16, text="rows of receivers, one above the other"),
    Number("bank_spacing", default=PRESET, above=0, maximum=100, unit="m", text="between their middles, across where "
                                                                               "they look"),
    Integer("transmitters", default=1, minimum=1, maximum=64, text="that send one after the other, ping by ping"),
    Number("transmitter_length", default=PRESET, above=0, maximum=100, unit="m", text="along the track"),
    Number("transmitter_spacing", default=None, above=0, maximum=100, unit="m",
           otherwise="half the length of a bank", text="between transmitters, along the track"),
    Number("transmitter_forward", default=0.0, minimum=-100, maximum=100, unit="m",
           text="of the middle of the transmitters from that of the receivers"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=0.5, maximum=180,
          text="full width at -3 dB one way, of transmitters and receivers; 180: all directions alike"),
    Number("thin_below_db", default=-30.0, minimum=-80, maximum=0, unit="dB",
           text="two-way, re the axis: of cells that side lobes leave less of only so many are taken, each the "
                "stronger, that they bring the energy of all; -80: all are"),
    Integer("overlap", default=None, minimum=0, maximum=MOST_ELEMENTS, otherwise="as the range allows",
            text="receivers whose places along the aperture two pings have in common: sets the ping rate"),
    Choice("image_grid", default="ground", choices=GRIDS, text="where `mitsonar.render` focuses: points of a level "
                                                               "plane at the bed's mean depth, or slant ranges"),
    Number("image_spacing", default=None, above=0, maximum=100, unit="m", otherwise="half the resolution",
           text="between the points of that grid"),
    Text("image_window", default="taylor 4 30", text="over the aperture's angles, of that image, as \"taylor 4 30\" or "
                                                     "\"boxcar\""),
    Text("range_window", default="taylor 4 30", text="over the pulse's band, likewise"),
    SOUND_SPEED, *NOISE, SELF_NOISE, pings(40), PASS, ROUTE, *NESTED,
)


class SyntheticAperture(SonarSensor):
    """See the module's text; `mitsonar.survey.synthetic_aperture.kind` plans its run and makes its echoes and its
    image."""

    kind, declared = "synthetic_aperture", ATTRIBUTES
    follows_offsets = False            # its echoes follow the trajectory

    def read(self, attributes: Attributes) -> None:
        """Take the pulse, the rows of elements and what an image of them is to be."""
        self.preset = attributes.preset
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, attributes.self_noise_db
        self.pulse = read_pulse(attributes, self.frequency)
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        wavelength = self.nominal_sound_speed / self.frequency
        self.transmit, self.receive = _transmitters(attributes, wavelength), _receivers(attributes, wavelength)
        self.bank = np.repeat(np.arange(attributes.banks), attributes.receivers)
        self.grid, self.grid_spacing = attributes.image_grid, attributes.image_spacing
        self.windows = tuple(_window(attributes, name) for name in ("image_window", "range_window"))
        self.thin_below = float(power_from_db(attributes.thin_below_db))
        self.route = _paced(attributes, self.route)

    def element_keys(self) -> ElementKeys:
        return ElementKeys(self.kind, self.transmit, self.receive, GEOMETRY)

    def to_string(self) -> str:
        return f"SyntheticAperture[{self.frequency / 1000:g} kHz, {self.receive.elements} receivers]"


def _looks(attributes: Attributes) -> np.ndarray:
    """The direction that all elements look in, body frame."""
    angle = attributes.depression_deg
    return np.array([0.0, SIDES[attributes.side] * np.cos(angle), np.sin(angle)])


def _upwards(attributes: Attributes) -> np.ndarray:
    """The direction from a bank to the one above it, across where they look."""
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
    """A window's name that is known."""
    text = getattr(attributes, name)
    try:
        window_weights(text, WINDOW_TRIED)
    except ValueError as error:
        raise attributes.error(f"{name}: {error}") from None
    return text


def _paced(attributes: Attributes, route):
    """The route with the ping rate that the overlap asks for at its speed."""
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
