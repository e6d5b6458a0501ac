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
from mitsonar.sonar.presets import presets
from mitsonar.units import hertz_from_khz

from .sonar_sensor import LEVELS_DB, SonarSensor

WIDTHS = ("beam_width_deg", "vertical_beam_width_deg")
NARROWEST_DEG = 0.01, 0.1          # what the integrals over the beam resolve
SHORTEST_MS = 1e-6


class Sidescan(SonarSensor):
    """See the module's text; `mitsonar.survey.sidescan` plans its run and makes its picture."""

    kind = "sidescan"

    def read(self, attributes: Attributes) -> None:
        """Read the sonar's own attributes, over those of its preset."""
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
        self.speckle = attributes.boolean("speckle", True)


mi.register_sensor("sidescan", Sidescan)
