"""Sonar with arrays (`array_sonar`): transmit and receive elements anywhere on a moving platform, and their signals.

The platform moves and turns while sound travels. ``mitsonar.render`` forms a fan of beams from the receive array;
``mitsonar.impulse_response`` and ``mitsonar.element_signals`` return the signal of every element.

`mi.traverse` lists the elements' ``tx_position``, ``rx_position``, ``tx_delay``, ``rx_delay``, ``tx_weight`` and
``rx_weight``. Later renders use values that you write there, and form their beams for them. After a change of
``rx_delay``, pictures are made from the elements' signals.

.. code-block:: xml

    <sensor type="array_sonar">
        <float name="frequency_khz" value="300"/>
        <string name="receive" value="line"/>
        <integer name="receive_elements" value="64"/>
        <string name="receive_normal" value="forward"/>
        <point name="start" x="0" y="0" z="-10"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="60"/></film>
    </sensor>
"""
import mitsuba as mi
import numpy as np

from ..attributes import Angle, Attributes, Integer, Number
from ..films.recorder_attributes import read_recorder, recorder_of
from .array_attributes import ARRAYS, PICTURE
from .array_reading import nominal_sound_speed, read_array, with_flaws
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
    FanSensor,
)

SIDES = ("transmit", "receive")

ATTRIBUTES = (
    Number("frequency_khz", default=100.0, above=0, maximum=10_000, unit="kHz", text="carrier frequency"),
    Number("source_level_db", default=210.0, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level of the whole transmit array in its steering direction"),
    *PULSE,
    ARRAYS, RECEIVE_FLAWS, SOUND_SPEED,
    Integer("beams", default=121, minimum=1, maximum=100_000, text="number of beams of the picture; a point has one"),
    Angle("fan_deg", default=120.0, above=0, maximum=180,
          text="width of the picture's fan about the receivers' normal, in the plane of their longest axis"),
    *recorder_of(), PICTURE, *NOISE, SELF_NOISE, pings(1), PASS, ROUTE, *NESTED,
)


class ArraySonar(FanSensor):
    """Sensor with transmit and receive arrays; `mitsonar.survey.fan.kind` plans its run and makes its picture."""

    kind, declared = "array", ATTRIBUTES

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the arrays and the picture's beams."""
        self.read_transmission(attributes)
        self.pulse = read_pulse(attributes, self.frequency)
        self.beams, self.fan_width = attributes.beams, attributes.fan_deg
        self.picture = attributes.picture
        # for the default pitch; steering delays are computed again for the water along the track
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        self.transmit, self.receive = (read_array(attributes, side, self.nominal_sound_speed, frequency=self.frequency)
                                       for side in SIDES)
        self.receive = with_flaws(attributes, self.receive)
        aperture = float(np.linalg.norm(np.ptp(self.receive.position, 0))) * self.frequency / self.nominal_sound_speed
        self.recorder = read_recorder(attributes, source_level_db=self.source_level_db, width=1 / max(aperture, 0.1),
                                      pulse_length=self.pulse.compressed_length())
        self.delays_from_file = bool(attributes.given("transmit_file")), bool(attributes.given("receive_file"))

    def to_string(self) -> str:
        return f"ArraySonar[{self.frequency / 1000:g} kHz, {self.transmit.elements} x {self.receive.elements} elements]"


mi.register_sensor("array_sonar", ArraySonar)
