"""Sidescan sonar (`sidescan`): port and starboard faces on a platform that follows a straight or recorded track.

.. code-block:: xml

    <sensor type="sidescan">
        <string name="preset" value="towed_400khz"/>
        <integer name="pings" value="500"/>
        <float name="altitude" value="15"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="75"/></film>
    </sensor>

Shadows are filled by side lobes (`sidelobe_db`), by echoes of the other side (`back_db`, `crosstalk_db`) and by noise
(`self_noise_db`). A value of -200 leaves any of them out. `mean_level` contains all echoes without noise; `level` has
speckle and noise; `recorded` are the counts that the preset's recorder makes of it.
"""
import mitsuba as mi

from mitsonar.sonar.preset_tables import presets
from mitsonar.survey.sidescan.jitter import Jitter
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Boolean, Number, Preset, SameAs
from ..films.recorder_attributes import read_recorder, recorder_of
from .platform import ROUTE, pings
from .sidescan_attributes import FACES, PRESET, RECEIVERS, read_faces, read_leakage
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, SOUND_SPEED, SonarSensor, read_self_noise_db

NARROWEST_DEG, NARROWEST_VERTICAL_DEG = 0.01, 0.1          # what the integrals over the beam resolve
SHORTEST_MS, LOWEST_KHZ = 1e-6, 0.001

ATTRIBUTES = (
    Preset("preset", default="towed_400khz", choices=tuple(presets()), text="source of the defaults marked *preset*"),
    Number("frequency_khz", default=PRESET, minimum=LOWEST_KHZ, maximum=10_000, unit="kHz", text="centre frequency"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level on the axis of a face, rms over the pulse"),
    Number("pulse_ms", default=PRESET, minimum=SHORTEST_MS, unit="ms",
           text="effective pulse length after compression; its inverse is the bandwidth"),
    Angle("beam_width_deg", default=PRESET, minimum=NARROWEST_DEG, maximum=180,
          text="beam width of the transmit face along the track, full width at -3 dB one way; 180: a point"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=NARROWEST_VERTICAL_DEG, maximum=180,
          text="beam width of the transmit face across the track"),
    Angle("receive_beam_width_deg", default=SameAs("beam_width_deg"), minimum=NARROWEST_DEG, maximum=180,
          text="beam width of the receive face along the track"),
    Angle("receive_vertical_beam_width_deg", default=SameAs("vertical_beam_width_deg"),
          minimum=NARROWEST_VERTICAL_DEG, maximum=180, text="beam width of the receive face across the track"),
    Angle("depression_deg", default=PRESET, minimum=-90, maximum=90,
          text="angle of the faces' normals below the horizontal"),
    *FACES, *RECEIVERS, *recorder_of(presets()), SOUND_SPEED,
    Boolean("speckle", default=True, text="true: complex Gaussian echoes, one per resolution cell; false: mean levels"),
    Angle("yaw_jitter_deg", default=PRESET, minimum=0, maximum=10,
          text="rms error of the beam's heading from ping to ping, within the attitude's tolerance, which no record "
               "has: pings have less speckle in common, and the same mean levels; 0 to a quarter of the beam width"),
    Angle("phase_jitter_deg", default=PRESET, minimum=0, maximum=90,
          text="rms error σ of phase over each face that changes from ping to ping: the speckle that pings have in "
               "common falls to exp(-2 σ²) of its amplitude; 0 to 30"),
    *NOISE, pings(400), ROUTE, *NESTED,
)


class Sidescan(SonarSensor):
    """Sidescan sensor; `mitsonar.survey.sidescan.kind` plans its run and makes its picture."""

    kind, declared, two_sided = "sidescan", ATTRIBUTES, True

    def read(self, attributes: Attributes) -> None:
        """Read the attributes of a sidescan."""
        self.preset = attributes.preset
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.pulse_length = attributes.source_level_db, attributes.pulse_ms / 1000
        self.chirp_length = max(attributes.chirp_ms, attributes.pulse_ms) / 1000
        self.transmit_face, self.receive_face = read_faces(attributes)
        self.depression_angle, self.speckle = attributes.depression_deg, attributes.speckle
        self.jitter = Jitter(yaw=attributes.yaw_jitter_deg, phase=attributes.phase_jitter_deg)
        self.leakage, self.self_noise_db = read_leakage(attributes), read_self_noise_db(attributes)
        self.recorder = read_recorder(attributes, source_level_db=self.source_level_db,
                                      width=attributes.beam_width_deg, pulse_length=self.pulse_length)


mi.register_sensor("sidescan", Sidescan)
