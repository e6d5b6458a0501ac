"""Forward-looking sonar (`forward_looking`): a line of receivers across the bow, and a fan of beams ahead.

It is described as such instruments are: by a preset of their classes, the fan, its beams, how far it looks down. Its
picture is `level` over (ping, beam, range), with the `bearing` of each beam. The film's `range` is 2 to 120 m on these
instruments.

One face sends over the whole fan. The receivers stand `element_spacing` wavelengths apart, and are as wide; their
number times their spacing is the aperture. Grating lobes enter a fan where they stand more than 1 / (1 + sin(fan / 2))
wavelengths apart. Of an acoustic lens the line is the aperture that makes its beams.

A preset has the finest range resolution of its class, c / (2 bandwidth), or of a cw pulse c `pulse_ms` / 2. Where the
film's window is longer than 2000 of these, the preset's pulse is as much longer, and its band narrower, as makes it
2000: so instruments change over to longer pulses for longer ranges. A `pulse_ms` or `bandwidth_khz` that is written
stays.

`mi.traverse` names the elements' ``tx_position``, ``rx_position``, ``tx_delay``, ``rx_delay``, ``tx_weight`` and
``rx_weight``. What is written there is there, and beams are formed for it. Pictures by receivers' delays are made of
their signals.

.. code-block:: xml

    <sensor type="forward_looking">
        <string name="preset" value="multibeam_720khz"/>
        <point name="start" x="0" y="0" z="-6"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="20"/></film>
    </sensor>
"""
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array, planar_array
from mitsonar.sonar.arrays.sectors import STEPS
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.sonar.preset_tables import presets
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Choice, FromTable, Integer, Number, Preset, SameAs
from .array_attributes import ARRAYS, MOST_ELEMENTS, PICTURE
from .array_reading import nominal_sound_speed, with_elements_changed
from .element_keys import ElementKeys
from .platform import ROUTE, pings
from .pulse_attributes import PULSE, read_pulse
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, PASS, SELF_NOISE, SOUND_SPEED, SonarSensor

NARROWEST_DEG = 0.1
MOST_CELLS = 2000                  # of the range resolution, in the film's window
PRESETS = presets("forward_looking")
PRESET = FromTable(table=PRESETS, by="preset")
OF_ELEMENTS = ("receive_failed", "receive_jitter", "receive_jitter_seed")
OF_ARRAYS = {one.name: one for one in ARRAYS.named("receive")}

ATTRIBUTES = (
    Preset("preset", default="multibeam_750khz", choices=tuple(PRESETS),
           text="where the defaults marked *preset* come from"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="carrier"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="on the axis of the transmitting face"),
    *(replace(one, default=PRESET) if one.name != "pulse_window" else one for one in PULSE),
    Integer("beams", default=PRESET, minimum=1, maximum=100_000, text="of the picture"),
    Angle("fan_deg", default=PRESET, above=0, maximum=180, text="from the first to the last beam"),
    Choice("beam_spacing", default=PRESET, choices=STEPS, text="what grows by equal steps from beam to beam: the "
                                                               "bearing, or its sine"),
    Angle("tilt_deg", default=PRESET, minimum=-90, maximum=90, text="of all elements, and so of the fan, downwards"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=NARROWEST_DEG, maximum=180,
          text="full width at -3 dB one way, of the transmitting face; 180: all directions alike"),
    Angle("receive_vertical_beam_width_deg", default=SameAs("vertical_beam_width_deg"), minimum=NARROWEST_DEG,
          maximum=180, text="the same of the receivers"),
    Angle("transmit_beam_width_deg", default=SameAs("fan_deg"), minimum=NARROWEST_DEG, maximum=180,
          text="across, of the transmitting face"),
    Angle("receive_beam_width_deg", default=None, minimum=NARROWEST_DEG, maximum=180,
          otherwise="of a face as wide as the spacing", text="across, of each receiver by itself"),
    Integer("receive_elements", default=PRESET, minimum=2, maximum=MOST_ELEMENTS, text="of a row, across the bow"),
    Number("element_spacing", default=PRESET, above=0, unit="wavelengths", text="between elements of a row"),
    Integer("receive_rows", default=1, minimum=1, maximum=MOST_ELEMENTS,
            text="that share the receivers' height, one below the other"),
    replace(OF_ARRAYS["receive_shading"], default="taylor 4 30", otherwise=""),
    *(OF_ARRAYS[name] for name in OF_ELEMENTS),
    SOUND_SPEED, PICTURE, *NOISE, SELF_NOISE, pings(1), PASS, ROUTE, *NESTED,
)


class ForwardLooking(SonarSensor):
    """See the module's text; `mitsonar.survey.fan.forward_looking` plans its run and makes its picture."""

    kind, declared = "forward_looking", ATTRIBUTES
    delays_from_file = (False, False)

    def read(self, attributes: Attributes) -> None:
        """Take the pulse, the fan and what makes it."""
        self.preset = attributes.preset
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, attributes.self_noise_db
        self.beams, self.fan_width, self.beam_steps = attributes.beams, attributes.fan_deg, attributes.beam_spacing
        self.tilt, self.picture = attributes.tilt_deg, attributes.picture
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        self.pulse = read_pulse(attributes, self.frequency, _longer(attributes, self.nominal_sound_speed))
        wavelength = self.nominal_sound_speed / self.frequency
        self.transmit, self.receive = _transmitter(attributes, wavelength), _receivers(attributes, wavelength)
        self.written_picture = self.picture
        self.steering_delays = self.transmit.delay, self.receive.delay

    def element_keys(self) -> ElementKeys:
        return ElementKeys(self.kind, self.transmit, self.receive)

    def take_elements(self, transmit: Array, receive: Array) -> None:
        """Have other elements; receivers' delays are those of signals, so their picture is made of signals."""
        self.picture = self.way_with_delays(self.written_picture, receive, self.steering_delays[1])
        super().take_elements(transmit, receive)

    def to_string(self) -> str:
        return f"ForwardLooking[{self.frequency / 1000:g} kHz, {self.beams} beams of {self.receive.elements} elements]"


def _longer(attributes: Attributes, sound_speed: float) -> float:
    """How many times longer than the preset's the pulse is, for the film's window."""
    if attributes.given("pulse_ms", "bandwidth_khz"):
        return 1.0
    length = attributes.pulse_ms if attributes.pulse == "cw" else 1 / attributes.bandwidth_khz           # [ms]
    window = attributes.film.range - attributes.film.range_min
    return max(1.0, window / (MOST_CELLS * 0.5 * sound_speed * length / 1000))


def _looks(attributes: Attributes) -> list[float]:
    """The direction that all elements look in, body frame."""
    return [float(np.cos(attributes.tilt_deg)), 0.0, float(np.sin(attributes.tilt_deg))]


def _transmitter(attributes: Attributes, wavelength: float) -> Array:
    length, height = (length_for_beam_width(width, wavelength) for width in
                      (attributes.transmit_beam_width_deg, attributes.vertical_beam_width_deg))
    return element_array([0.0, 0.0, 0.0], normal=_looks(attributes), along="starboard", length=length, height=height,
                         pattern="rectangular", baffle="hard")


def _receivers(attributes: Attributes, wavelength: float) -> Array:
    pitch, rows = attributes.element_spacing * wavelength, attributes.receive_rows
    height = length_for_beam_width(attributes.receive_vertical_beam_width_deg, wavelength)
    if rows > 1 and not height:
        raise attributes.error(f"receive_rows is {rows}, but receivers of a vertical beam width of 180 degrees have no "
                               "height to share; give receive_vertical_beam_width_deg below 180, or one row.")
    width = attributes.receive_beam_width_deg
    length = pitch if width is None else length_for_beam_width(width, wavelength)
    made = planar_array(attributes.receive_elements, rows, pitch, row_pitch=height / rows or pitch, axis="starboard",
                        normal=_looks(attributes), length=length, height=height / rows, pattern="rectangular",
                        baffle="hard")
    return with_elements_changed(attributes, "receive", made)


mi.register_sensor("forward_looking", ForwardLooking)
