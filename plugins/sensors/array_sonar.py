"""Sonar with arrays (`array_sonar`): transmit and receive elements anywhere on a moving platform, and their signals.

- ``frequency_khz`` [100], ``source_level_db`` [210 dB re 1 µPa @ 1 m]: of the whole transmit array towards where it is
  steered
- ``pulse``: ``cw``, ``lfm`` [default] or ``hfm``; ``pulse_ms`` [1], ``bandwidth_khz`` [10] of a sweep, ``pulse_window``
  such as "hann" or "tukey 0.1"
- ``transmit``, ``receive`` [point] and what goes with them: the arrays, see `array_attributes`
- ``sound_speed`` [m/s]: at the array, for steering and slant range; default: the profile there

- ``beams`` [121], ``fan_deg`` [120]: the fan that `mitsonar.render` forms of the receive array, about its normal, in
  the plane of the axis along which it is longest

The run: ``pings`` [1], ``track``, ``start``, ... as `platform` says. The platform moves and turns while sound is on its
way.

What is heard:

- ``noise`` [true]: ambient noise of the water, coherent between close elements; ``noise_level_db``
  [dB re 1 µPa²/Hz] instead of the water's, ``self_noise_db`` of each receiver, independent of the others

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

from mitsonar.plugins.attributes import Attributes
from mitsonar.sonar import PULSES
from mitsonar.sonar.shading import window_weights
from mitsonar.units import hertz_from_khz

from .array_attributes import read_array
from .sonar_sensor import LEVELS_DB, SonarSensor

WINDOW_SAMPLES = 64                # on which a pulse's window is tried
SIDES = ("transmit", "receive")


class ArraySonar(SonarSensor):
    """See the module's text; `mitsonar.survey.array` plans its run and makes its picture."""

    kind = "array"
    usual_pings = 1

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the arrays and the picture's beams."""
        frequency_khz = attributes.number("frequency_khz", 100.0, above=0, maximum=10_000, unit="kHz")
        self.frequency = float(hertz_from_khz(frequency_khz))
        self.source_level_db = attributes.number("source_level_db", 210.0, **LEVELS_DB)
        self.pulse = self._read_pulse(attributes, self.frequency)
        self.beams = attributes.integer("beams", 121, minimum=1, maximum=100_000)
        self.fan_width = attributes.angle("fan_deg", 120.0, above=0, maximum=180)
        self.self_noise_db = attributes.number("self_noise_db", None, **LEVELS_DB)
        # for the default pitch; delays of steering are made anew for the water that the track leads through
        profile, start = self.water.profile, self.route.start
        self.nominal_sound_speed = self.sound_speed or float(
            np.mean(profile.sound_speed) if start is None else profile.at(-start[2]))
        self.transmit, self.receive = (read_array(attributes, side, self.nominal_sound_speed, frequency=self.frequency)
                                       for side in SIDES)
        self.delays_from_file = tuple(bool(attributes.given(f"{side}_file")) for side in SIDES)

    def to_string(self):
        return f"ArraySonar[{self.frequency / 1000:g} kHz, {self.transmit.elements} x {self.receive.elements} elements]"

    @staticmethod
    def _read_pulse(attributes, frequency):
        kind = attributes.text("pulse", "lfm", choices=tuple(PULSES))
        duration = attributes.number("pulse_ms", 1.0, above=0, maximum=10_000, unit="ms") / 1000
        window = attributes.text("pulse_window", None)
        arguments = {"frequency": frequency, "duration": duration}
        if kind == "cw":
            if attributes.given("bandwidth_khz"):
                raise attributes.error("bandwidth_khz is given, but a cw pulse has that of its length; leave it "
                                       "out, or make the pulse lfm or hfm.")
            attributes.number("bandwidth_khz", None)
        else:
            arguments["bandwidth"] = float(hertz_from_khz(attributes.number("bandwidth_khz", 10.0, unit="kHz")))
        try:
            return PULSES[kind](**arguments, window=None if window is None else _window(window))
        except ValueError as error:
            raise attributes.error(str(error)) from None


def _window(text):
    """A window's name, or its name and numbers, as SciPy takes them; what shading would refuse is refused here too."""
    window_weights(text, WINDOW_SAMPLES)
    name, *numbers = text.split()
    return (name, *map(float, numbers)) if numbers else name


mi.register_sensor("array_sonar", ArraySonar)
