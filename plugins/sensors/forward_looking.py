"""Forward-looking sonar (`forward_looking`): a line of receivers across the bow, and a fan of beams ahead.

You describe it by a preset of an instrument class, the fan and its beams, and the downward tilt. Its picture is `level`
over (ping, beam, range), with the `bearing` of each beam. Such instruments have a film `range` of 2 to 120 m.

One face transmits over the whole fan. Receivers are `element_spacing` wavelengths apart and as wide; their number times
their spacing is the aperture. Grating lobes enter a fan at spacings above 1 / (1 + sin(fan / 2)) wavelengths. For an
acoustic lens, the line is the aperture that forms its beams.

A preset has the finest range resolution of its class: c / (2 bandwidth), or c `pulse_ms` / 2 for a cw pulse. If the
film's window is longer than 2000 such cells, the preset's pulse is lengthened, and its band narrowed, until the window
has 2000 cells, as instruments choose longer pulses for longer ranges. A `pulse_ms` or `bandwidth_khz` that you write is
not changed.

`mi.traverse` lists the elements' ``tx_position``, ``rx_position``, ``tx_delay``, ``rx_delay``, ``tx_weight`` and
``rx_weight``. Later renders use values that you write there, and form their beams for them. After a change of
``rx_delay``, pictures are made from the elements' signals.

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

from ..attributes import Angle, Attributes, Choice, FromTable, Integer, Number, Preset, SameAs
from ..films.recorder_attributes import read_recorder, recorder_of
from .array_attributes import ARRAYS, MOST_ELEMENTS, PICTURE
from .array_reading import nominal_sound_speed, with_elements_changed, with_flaws
from .platform import ROUTE, pings
from .pulse_attributes import PULSE, read_pulse
from .sonar_sensor import (
    HIGHEST_DB,
    LOWEST_DB,
    NESTED,
    NOISE,
    PASS,
    RECEIVE_FLAWS,
    SELF_NOISE,
    SOUND_SPEED,
    VERTICAL_SIDELOBE,
    FanSensor,
    power_of,
)

NARROWEST_DEG = 0.1
MOST_CELLS = 2000                  # range resolution cells in the film's window
PRESETS = presets("forward_looking")
PRESET = FromTable(table=PRESETS, by="preset")
OF_ARRAYS = {attribute.name: attribute for attribute in ARRAYS.named("receive")}

ATTRIBUTES = (
    Preset("preset", default="multibeam_750khz", choices=tuple(PRESETS),
           text="source of the defaults marked *preset*"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="carrier frequency"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level on the axis of the transmit face"),
    *(replace(attribute, default=PRESET) if attribute.name != "pulse_window" else attribute for attribute in PULSE),
    Integer("beams", default=PRESET, minimum=1, maximum=100_000, text="number of beams of the picture"),
    Angle("fan_deg", default=PRESET, above=0, maximum=180, text="fan width, from the first to the last beam"),
    Choice("beam_spacing", default=PRESET, choices=STEPS,
           text="quantity that grows by equal steps from beam to beam: the bearing, or its sine"),
    Angle("tilt_deg", default=PRESET, minimum=-90, maximum=90, text="downward tilt of all elements and of the fan"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=NARROWEST_DEG, maximum=180,
          text="vertical beam width of the transmit face, full width at -3 dB one way; 180: omnidirectional"),
    Angle("receive_vertical_beam_width_deg", default=SameAs("vertical_beam_width_deg"), minimum=NARROWEST_DEG,
          maximum=180, text="vertical beam width of the receivers"),
    replace(VERTICAL_SIDELOBE, default=PRESET),
    Angle("transmit_beam_width_deg", default=SameAs("fan_deg"), minimum=NARROWEST_DEG, maximum=180,
          text="horizontal beam width of the transmit face"),
    Angle("receive_beam_width_deg", default=None, minimum=NARROWEST_DEG, maximum=180,
          otherwise="of a face as wide as the spacing", text="horizontal beam width of a single receiver"),
    Integer("receive_elements", default=PRESET, minimum=2, maximum=MOST_ELEMENTS,
            text="number of receivers of a row across the bow"),
    Number("element_spacing", default=PRESET, above=0, unit="wavelengths", text="distance between elements of a row"),
    Integer("receive_rows", default=1, minimum=1, maximum=MOST_ELEMENTS,
            text="number of rows, one below the other, that share the receivers' height"),
    replace(OF_ARRAYS["receive_shading"], default="taylor 4 30", otherwise=""),
    *(OF_ARRAYS[name] for name in ("receive_failed", "receive_jitter", "receive_jitter_seed")),
    replace(RECEIVE_FLAWS, default=PRESET),
    *recorder_of(PRESETS), SOUND_SPEED, PICTURE, *NOISE,
    replace(SELF_NOISE, default=PRESET, otherwise="*preset*; none without `noise`"), pings(1), PASS, ROUTE, *NESTED,
)


class ForwardLooking(FanSensor):
    """Forward-looking sensor; `mitsonar.survey.fan.forward_looking` plans its run and makes its picture."""

    kind, declared = "forward_looking", ATTRIBUTES

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the fan and the elements."""
        self.read_transmission(attributes)
        self.beams, self.fan_width, self.beam_steps = attributes.beams, attributes.fan_deg, attributes.beam_spacing
        self.tilt, self.picture = attributes.tilt_deg, attributes.picture
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        self.pulse = read_pulse(attributes, self.frequency, _longer(attributes, self.nominal_sound_speed))
        wavelength = self.nominal_sound_speed / self.frequency
        self.transmit, self.receive = _transmitter(attributes, wavelength), _receivers(attributes, wavelength)
        self.recorder = read_recorder(attributes, source_level_db=self.source_level_db,
                                      width=1 / (attributes.receive_elements * attributes.element_spacing),
                                      pulse_length=self.pulse.compressed_length())

    def to_string(self) -> str:
        return f"ForwardLooking[{self.frequency / 1000:g} kHz, {self.beams} beams of {self.receive.elements} elements]"


def _longer(attributes: Attributes, sound_speed: float) -> float:
    """Return by what factor the pulse is longer than the preset's, for the film's window."""
    if attributes.given("pulse_ms", "bandwidth_khz"):
        return 1.0
    length = attributes.pulse_ms if attributes.pulse == "cw" else 1 / attributes.bandwidth_khz           # [ms]
    window = attributes.film.range - attributes.film.range_min
    return max(1.0, window / (MOST_CELLS * 0.5 * sound_speed * length / 1000))


def _normal(attributes: Attributes) -> list[float]:
    """Return the normal of all elements, body frame."""
    return [float(np.cos(attributes.tilt_deg)), 0.0, float(np.sin(attributes.tilt_deg))]


def _transmitter(attributes: Attributes, wavelength: float) -> Array:
    length, height = (length_for_beam_width(width, wavelength) for width in
                      (attributes.transmit_beam_width_deg, attributes.vertical_beam_width_deg))
    return element_array([0.0, 0.0, 0.0], normal=_normal(attributes), along="starboard", length=length, height=height,
                         floor=_floor(attributes, height), pattern="rectangular", baffle="hard")


def _floor(attributes: Attributes, height: float) -> float:
    """Return the power of the diffuse side lobes of a face; one without height has neither lobes nor nulls."""
    return power_of(attributes.vertical_sidelobe_db) if height else 0.0


def _receivers(attributes: Attributes, wavelength: float) -> Array:
    pitch, rows = attributes.element_spacing * wavelength, attributes.receive_rows
    height = length_for_beam_width(attributes.receive_vertical_beam_width_deg, wavelength)
    if rows > 1 and not height:
        raise attributes.error(f"receive_rows is {rows}, but receivers with a vertical beam width of 180 degrees have "
                               "no height to share; give receive_vertical_beam_width_deg below 180, or one row.")
    width = attributes.receive_beam_width_deg
    length = pitch if width is None else length_for_beam_width(width, wavelength)
    made = planar_array(attributes.receive_elements, rows, pitch, row_pitch=height / rows or pitch, axis="starboard",
                        normal=_normal(attributes), length=length, height=height / rows,
                        floor=_floor(attributes, height), pattern="rectangular", baffle="hard")
    return with_flaws(attributes, with_elements_changed(attributes, "receive", made))


mi.register_sensor("forward_looking", ForwardLooking)
