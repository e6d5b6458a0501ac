"""Sidescan sonar (`sidescan`): port and starboard faces on a platform that follows a straight or recorded track.

The sonar (defaults from ``preset``: towed_100khz, towed_400khz or auv_900khz):

- ``frequency_khz``, ``source_level_db`` [dB re 1 µPa @ 1 m], ``pulse_ms`` (effective, after compression)
- ``beam_width_deg`` along track, ``vertical_beam_width_deg``: full one-way -3 dB widths of the transmitting face;
  180 makes that side of the face a point; ``receive_beam_width_deg``, ``receive_vertical_beam_width_deg`` if they
  differ
- ``depression_deg``: of the faces' normals below horizontal
- ``sound_speed`` [m/s]: at the head, what the sonar makes slant range of; default: the profile there

The run: ``pings``, ``track``, ``start``, ... as `platform` says.

What is heard:

- ``speckle`` [true]: complex Gaussian echoes, one per resolution cell
- ``noise`` [true]: ambient noise of the water in the receiver's band and beam; ``noise_level_db`` [dB re 1 µPa²/Hz]
  instead of the water's

.. code-block:: xml

    <sensor type="sidescan">
        <string name="preset" value="towed_400khz"/>
        <integer name="pings" value="500"/>
        <float name="altitude" value="15"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="75"/></film>
    </sensor>
"""
import mitsuba as mi
import numpy as np

from mitsonar.plugins.attributes import Attributes
from mitsonar.sonar import Aperture, Sidescan, cw, element_array, length_for_beam_width, presets
from mitsonar.units import db_from_amplitude, hertz_from_khz
from mitsonar.water.profile import FASTEST, SLOWEST

from .platform import ArrayPlan, Platform

WIDTHS = ("beam_width_deg", "vertical_beam_width_deg")
NARROWEST_DEG = 0.01, 0.1          # what the integrals over the beam resolve
SHORTEST_MS = 1e-6
LEVELS_DB = {"minimum": -200, "maximum": 300}     # what energies in float32 can hold


class SidescanSensor(mi.Sensor):
    """See the module's text."""

    def __init__(self, props):
        attributes = Attributes(props)
        self.preset = attributes.text("preset", "towed_400khz", choices=tuple(presets()))
        default = presets()[self.preset]
        self.frequency = float(hertz_from_khz(attributes.number("frequency_khz", default["frequency_khz"], above=0,
                                                                  maximum=10_000, unit="kHz")))
        self.source_level_db = attributes.number("source_level_db", default["source_level_db"], **LEVELS_DB)
        self.pulse_length = attributes.number("pulse_ms", default["pulse_ms"], minimum=SHORTEST_MS, unit="ms") / 1000
        self.transmit_widths = tuple(attributes.angle(name, default[name], minimum=narrowest, maximum=180)
                                     for name, narrowest in zip(WIDTHS, NARROWEST_DEG))
        self.receive_widths = tuple(
            attributes.angle(f"receive_{name}", float(np.rad2deg(width)), minimum=narrowest, maximum=180)
            for name, width, narrowest in zip(WIDTHS, self.transmit_widths, NARROWEST_DEG))
        self.depression_angle = attributes.angle("depression_deg", default["depression_deg"], minimum=-90, maximum=90)
        self.sound_speed = attributes.number("sound_speed", None, above=SLOWEST, below=FASTEST, unit="m/s")
        self.platform = Platform(attributes)
        self.speckle = attributes.boolean("speckle", True)
        self.noise = attributes.boolean("noise", True)
        self.given_noise_level_db = attributes.number("noise_level_db", None, **LEVELS_DB)
        self.water = attributes.object(mi.Medium, None)
        if not hasattr(self.water, "profile"):
            raise attributes.error('it must hold the water it works in: <medium type="seawater"/>.')
        attributes.finish()
        self.provenance = None            # file, resolved text and parameters, told by `mitsonar.load_file`
        super().__init__(props)
        if not hasattr(self.film(), "window"):
            raise attributes.error('it must hold the record it makes: <film type="sonar_film"/>.')

    def sonar(self, head_depth):
        """The sonar as the head meets the water at a depth [m]: a `Sidescan`."""
        speed = self.sound_speed or float(self.water.profile.at(head_depth))
        wavelength = speed / self.frequency
        faces = [Aperture(length=length_for_beam_width(along, wavelength),
                          height=length_for_beam_width(across, wavelength))
                 for along, across in (self.transmit_widths, self.receive_widths)]
        return Sidescan(frequency=self.frequency, source_level_db=self.source_level_db, pulse_length=self.pulse_length,
                        transmit=faces[0], receive=faces[1], depression_angle=self.depression_angle, sound_speed=speed)

    def plan(self, geometry, origin=None, crs=""):
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
        voyage : Voyage
            The pings' track, and the trajectory it lies on.
        sonar : Sidescan
        depth_below : (P,) [m]
            Seabed below the sonar.

        Raises
        ------
        ValueError
            If the track leaves the seabed, the water, or the recorded span.
        """
        voyage, below = self._voyage(geometry, origin, crs)
        return voyage, self.sonar(float(np.mean(-voyage.track.position[:, 2]))), below

    def _voyage(self, geometry, origin, crs):
        # the slowest water makes the longest wait
        slowest = self.sound_speed or float(np.min(self.water.profile.sound_speed))
        return self.platform.plan(geometry, self.film().window(slowest)[0][1], origin, crs)

    def array_plan(self, geometry, origin=None, crs=""):
        """Plan the same run with each side's faces as elements, port and starboard: an `ArrayPlan`.

        The pulse is a cw of the sidescan's effective length. A face hears nothing from behind its own plane.
        """
        voyage, below = self._voyage(geometry, origin, crs)
        sonar = self.sonar(float(np.mean(-voyage.track.position[:, 2])))
        sine, cosine = np.sin(sonar.depression_angle), np.cos(sonar.depression_angle)
        transmit, receive = (element_array(
            np.zeros((2, 3)), normal=[[0, -cosine, sine], [0, cosine, sine]], along="forward", length=face.length,
            height=face.height, pattern="rectangular", baffle="hard") for face in (sonar.transmit, sonar.receive))
        # each face has the source level, and a direction hears one of them: both together would make twice the pressure
        return ArrayPlan(voyage=voyage, depth_below=below,
                         sound_speed=sonar.sound_speed, transmit=transmit, receive=receive,
                         pulse=cw(sonar.frequency, sonar.pulse_length), bins_are_samples=False,
                         source_level_db=sonar.source_level_db + db_from_amplitude(2.0))

    def noise_level_db(self):
        """Noise spectrum level [dB re 1 µPa²/Hz] in the water."""
        if self.given_noise_level_db is not None:
            return self.given_noise_level_db
        return self.water.noise_level_db(self.frequency)

    # What Mitsuba asks of a sensor that no camera ray leaves
    def traverse(self, callback):
        super().traverse(callback)

    def sample_ray(self, time, wavelength_sample, position_sample, aperture_sample, active=True):
        raise ValueError("a sidescan sends sound; render it with the integrator sonar_path")

    def bbox(self):
        return mi.ScalarBoundingBox3f()

    def to_string(self):
        return f"Sidescan[{self.frequency / 1000:g} kHz, {self.platform.pings} pings]"


mi.register_sensor("sidescan", SidescanSensor)
