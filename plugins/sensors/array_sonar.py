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
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.plugins.attributes import Attributes
from mitsonar.sonar import PULSES
from mitsonar.sonar.shading import window_weights
from mitsonar.units import hertz_from_khz
from mitsonar.water.profile import FASTEST, SLOWEST

from .array_attributes import read_array
from .platform import ArrayPlan, Platform

LEVELS_DB = {"minimum": -200, "maximum": 300}
WINDOW_SAMPLES = 64                # on which a pulse's window is tried


class ArraySonar(mi.Sensor):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        frequency_khz = attributes.number("frequency_khz", 100.0, above=0, maximum=10_000, unit="kHz")
        frequency = float(hertz_from_khz(frequency_khz))
        self.source_level_db = attributes.number("source_level_db", 210.0, **LEVELS_DB)
        self.pulse = self._read_pulse(attributes, frequency)
        self.sound_speed = attributes.number("sound_speed", None, above=SLOWEST, below=FASTEST, unit="m/s")
        self.beams = attributes.integer("beams", 121, minimum=1, maximum=100_000)
        self.fan_width = attributes.angle("fan_deg", 120.0, above=0, maximum=180)
        self.platform = Platform(attributes, pings=1)
        self.noise = attributes.boolean("noise", True)
        self.given_noise_level_db = attributes.number("noise_level_db", None, **LEVELS_DB)
        self.self_noise_db = attributes.number("self_noise_db", None, **LEVELS_DB)
        self.water = attributes.object(mi.Medium, None)
        if not hasattr(self.water, "profile"):
            raise attributes.error('it must hold the water it works in: <medium type="seawater"/>.')
        # for the default pitch; delays of steering are made for the water that the track leads through, in array_plan
        self._hint = self.sound_speed or float(
            np.mean(self.water.profile.sound_speed) if self.platform.start is None else
            self.water.profile.at(-self.platform.start[2]))
        self.transmit, self.receive = (read_array(attributes, prefix, self._hint, frequency=frequency)
                                       for prefix in ("transmit", "receive"))
        self._from_file = [bool(attributes.given(f"{prefix}_file")) for prefix in ("transmit", "receive")]
        attributes.finish()
        self.provenance = None            # file, resolved text and parameters, told by `mitsonar.load_file`
        super().__init__(props)
        if not hasattr(self.film(), "sampling"):
            raise attributes.error('it must hold the record it makes: <film type="sonar_film"/>.')

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

    def array_plan(self, geometry, origin=None, crs=""):
        """Lay the track over a scene.

        Parameters
        ----------
        geometry : trace.Geometry
        origin : (2,) [m] or None
            Easting and northing of the scene's origin.
        crs : str
            Coordinate system of the origin; empty where nobody knows.

        Returns
        -------
        ArrayPlan

        Raises
        ------
        ValueError
            If the track leaves the seabed, the water, or the recorded span.
        """
        # the slowest water makes the longest wait
        slowest = self.sound_speed or float(np.min(self.water.profile.sound_speed))
        voyage, below = self.platform.plan(geometry, self.film().window(slowest)[0][1], origin, crs)
        track = voyage.track
        speed = self.sound_speed or float(np.mean(self.water.profile.at(-track.position[:, 2])))
        # a file's own delays are times; those of steering are lengths over a sound speed
        transmit, receive = (array if from_file else replace(array, delay=array.delay * (self._hint / speed))
                             for array, from_file in zip((self.transmit, self.receive), self._from_file))
        return ArrayPlan(
            voyage=voyage, depth_below=below, pulse=self.pulse,
            sound_speed=speed, transmit=transmit, receive=receive, source_level_db=self.source_level_db,
            bins_are_samples=True)

    def noise_level_db(self):
        """Ambient noise spectrum level [dB re 1 µPa²/Hz] in the water."""
        if self.given_noise_level_db is not None:
            return self.given_noise_level_db
        return self.water.noise_level_db(self.pulse.frequency)

    # What Mitsuba asks of a sensor that no camera ray leaves
    def traverse(self, callback):
        super().traverse(callback)

    def sample_ray(self, time, wavelength_sample, position_sample, aperture_sample, active=True):
        raise ValueError("an array_sonar sends sound; ask mitsonar.element_signals for what it hears")

    def bbox(self):
        return mi.ScalarBoundingBox3f()

    def to_string(self):
        return (f"ArraySonar[{self.pulse.frequency / 1000:g} kHz, {self.transmit.elements} x {self.receive.elements} "
                "elements]")


def _window(text):
    """A window's name, or its name and numbers, as SciPy takes them; what shading would refuse is refused here too."""
    window_weights(text, WINDOW_SAMPLES)
    name, *numbers = text.split()
    return (name, *map(float, numbers)) if numbers else name


mi.register_sensor("array_sonar", ArraySonar)
