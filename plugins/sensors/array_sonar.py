"""Sonar with arrays (`array_sonar`): transmit and receive elements anywhere on a moving platform, and their signals.

The platform moves and turns while sound is on its way. ``mitsonar.render`` forms a fan of beams of the receive array;
``mitsonar.impulse_response`` and ``mitsonar.element_signals`` give what every element receives.

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

from mitsonar.sonar import PULSES
from mitsonar.sonar.shading import window_weights
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Choice, Integer, Number, Text
from .array_attributes import ARRAYS, PICTURE
from .array_reading import read_array
from .platform import ROUTE, pings
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, SOUND_SPEED, SonarSensor

WINDOW_SAMPLES = 64                # on which a pulse's window is tried
SIDES = ("transmit", "receive")

ATTRIBUTES = (
    Number("frequency_khz", default=100.0, above=0, maximum=10_000, unit="kHz", text="carrier"),
    Number("source_level_db", default=210.0, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="of the whole transmit array where it is steered to"),
    Choice("pulse", default="lfm", choices=tuple(PULSES), text="of one frequency, or a sweep"),
    Number("pulse_ms", default=1.0, above=0, maximum=10_000, unit="ms", text="its length"),
    Number("bandwidth_khz", default=10.0, unit="kHz", text="of a sweep"),
    Text("pulse_window", default=None, text='window over the pulse, as "hann" or "tukey 0.1"'),
    ARRAYS, SOUND_SPEED,
    Integer("beams", default=121, minimum=1, maximum=100_000, text="of the picture; a point has one"),
    Angle("fan_deg", default=120.0, above=0, maximum=180,
          text="width of the picture's fan about the receivers' normal, in the plane of their longest axis"),
    PICTURE, *NOISE,
    Number("self_noise_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
           text="noise of each receiver by itself"),
    pings(1), ROUTE, *NESTED,
)


class ArraySonar(SonarSensor):
    """See the module's text; `mitsonar.survey.array` plans its run and makes its picture."""

    kind, declared = "array", ATTRIBUTES

    def read(self, attributes: Attributes) -> None:
        """Take the pulse, the arrays and the picture's beams."""
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, attributes.self_noise_db
        self.pulse = _pulse(attributes, self.frequency)
        self.beams, self.fan_width = attributes.beams, attributes.fan_deg
        self.picture = attributes.picture
        # for the default pitch; delays of steering are made anew for the water that the track leads through
        profile, start = self.water.profile, self.route.start
        self.nominal_sound_speed = self.sound_speed or float(
            np.mean(profile.sound_speed) if start is None else profile.at(-start[2]))
        self.transmit, self.receive = (read_array(attributes, side, self.nominal_sound_speed, frequency=self.frequency)
                                       for side in SIDES)
        self.delays_from_file = tuple(bool(attributes.given(f"{side}_file")) for side in SIDES)

    def to_string(self) -> str:
        return f"ArraySonar[{self.frequency / 1000:g} kHz, {self.transmit.elements} x {self.receive.elements} elements]"


def _pulse(attributes, frequency):
    arguments = {"frequency": frequency, "duration": attributes.pulse_ms / 1000}
    if attributes.pulse != "cw":
        arguments["bandwidth"] = float(hertz_from_khz(attributes.bandwidth_khz))
    elif attributes.given("bandwidth_khz"):
        raise attributes.error("bandwidth_khz is given, but a cw pulse has that of its length; leave it out, or make "
                               "the pulse lfm or hfm.")
    window = attributes.pulse_window
    try:
        return PULSES[attributes.pulse](**arguments, window=None if window is None else _window(window))
    except ValueError as error:
        raise attributes.error(error) from None


def _window(text):
    """A window's name, or its name and numbers, as SciPy takes them; what shading would refuse is refused here too."""
    window_weights(text, WINDOW_SAMPLES)
    name, *numbers = text.split()
    return (name, *map(float, numbers)) if numbers else name


mi.register_sensor("array_sonar", ArraySonar)
