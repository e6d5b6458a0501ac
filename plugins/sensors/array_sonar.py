"""Sonar with arrays (`array_sonar`): transmit and receive elements anywhere on a moving platform, and their signals.

The platform moves and turns while sound is on its way. ``mitsonar.render`` forms a fan of beams of the receive array;
``mitsonar.impulse_response`` and ``mitsonar.element_signals`` give what every element receives.

`mi.traverse` names the elements' ``tx_position``, ``rx_position``, ``tx_delay``, ``rx_delay``, ``tx_weight`` and
``rx_weight``. What is written there is there, and beams are formed for it. Pictures by receivers' delays are made of
their signals.

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

from mitsonar.sonar.arrays.array import Array
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Integer, Number
from .array_attributes import ARRAYS, PICTURE
from .array_reading import nominal_sound_speed, read_array
from .element_keys import ElementKeys
from .platform import ROUTE, pings
from .pulse_attributes import PULSE, read_pulse
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, PASS, SELF_NOISE, SOUND_SPEED, SonarSensor

SIDES = ("transmit", "receive")

ATTRIBUTES = (
    Number("frequency_khz", default=100.0, above=0, maximum=10_000, unit="kHz", text="carrier"),
    Number("source_level_db", default=210.0, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="of the whole transmit array where it is steered to"),
    *PULSE,
    ARRAYS, SOUND_SPEED,
    Integer("beams", default=121, minimum=1, maximum=100_000, text="of the picture; a point has one"),
    Angle("fan_deg", default=120.0, above=0, maximum=180,
          text="width of the picture's fan about the receivers' normal, in the plane of their longest axis"),
    PICTURE, *NOISE, SELF_NOISE, pings(1), PASS, ROUTE, *NESTED,
)


class ArraySonar(SonarSensor):
    """See the module's text; `mitsonar.survey.fan.kind` plans its run and makes its picture."""

    kind, declared = "array", ATTRIBUTES

    def read(self, attributes: Attributes) -> None:
        """Take the pulse, the arrays and the picture's beams."""
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, attributes.self_noise_db
        self.pulse = read_pulse(attributes, self.frequency)
        self.beams, self.fan_width = attributes.beams, attributes.fan_deg
        self.picture = attributes.picture
        # for the default pitch; delays of steering are made anew for the water that the track leads through
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        self.transmit, self.receive = (read_array(attributes, side, self.nominal_sound_speed, frequency=self.frequency)
                                       for side in SIDES)
        self.written_picture = self.picture
        self.steering_delays = self.transmit.delay, self.receive.delay
        self.delays_from_file = tuple(bool(attributes.given(f"{side}_file")) for side in SIDES)

    def element_keys(self) -> ElementKeys:
        return ElementKeys(self.kind, self.transmit, self.receive)

    def take_elements(self, transmit: Array, receive: Array) -> None:
        """Have other elements; receivers' delays are those of signals, so their picture is made of signals."""
        self.picture = self.way_with_delays(self.written_picture, receive, self.steering_delays[1])
        super().take_elements(transmit, receive)

    def to_string(self) -> str:
        return f"ArraySonar[{self.frequency / 1000:g} kHz, {self.transmit.elements} x {self.receive.elements} elements]"


mi.register_sensor("array_sonar", ArraySonar)
