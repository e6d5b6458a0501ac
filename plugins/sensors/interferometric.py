"""Interferometric sidescan (`interferometric`): bathymetry by the phases of rows of receivers on either side.

Each side has a transmitter and two or more rows of receivers, one above the other, on a face that is tilted down. The
rows are long along the track. Every range bin has a level, as in a sidescan. The phases between the rows give the angle
of its echo: the angle that fits all rows best. Close rows resolve the ambiguity of distant rows
(`mitsonar.hydrography.detection.row_angles`). If several echoes arrive at the same time, the angle lies between theirs.

`mitsonar.render` makes `level`, `phase`, `coherence`, `angle` and `measured_depth`, `measured_x` and `measured_y` over
(ping, side, range), with the true `depth`, `error` and the labels of a sidescan. `mitsonar.soundings` and ``mitsonar
soundings`` make a sounding of every coherent bin, with its uncertainty and its error by cause, in the file formats of
the multibeam.

Below the sonar a face also receives the bed of the other side, weakened by its baffle: soundings are few and poor
there. Waves are plane over the rows, even from near by.

.. code-block:: xml

    <sensor type="interferometric">
        <string name="preset" value="four_rows_250khz"/>
        <point name="start" x="0" y="0" z="-2"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="60"/><integer name="bins" value="600"/></film>
    </sensor>
"""
import mitsuba as mi
import numpy as np

from mitsonar.hydrography.detection.row_angles import ReceiverRows, sector_of
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.sonar.preset_tables import presets
from mitsonar.sonar.pulses.pulses import PULSES
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Choice, FromTable, Number, Numbers, Preset
from ..films.recorder_attributes import read_recorder, recorder_of
from .array_reading import nominal_sound_speed
from .motion_errors import DEPTH_GATE, MOTION_ERRORS, depth_gate, motion_errors
from .platform import ROUTE, pings
from .pulse_attributes import make_pulse
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, SELF_NOISE, SOUND_SPEED, SonarSensor

PRESETS = presets("interferometric")
PRESET = FromTable(table=PRESETS, by="preset")
MOST_ROWS = 64
FARTHEST = 100.0                   # [wavelengths], [m]: of a row or a face from the others

ATTRIBUTES = (
    Preset("preset", default="four_rows_250khz", choices=tuple(PRESETS),
           text="source of the defaults marked *preset*"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="centre frequency"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level of each side, on its axis"),
    Choice("pulse", default=PRESET, choices=tuple(PULSES), text="waveform: one frequency, or a sweep"),
    Number("pulse_ms", default=PRESET, above=0, maximum=10_000, unit="ms", text="pulse length"),
    Number("bandwidth_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="bandwidth of a sweep"),
    Angle("beam_width_deg", default=PRESET, minimum=0.05, maximum=90,
          text="beam width of transmitters and rows along the track, full width at -3 dB one way"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=1, maximum=180,
          text="beam width of the transmitters across the track"),
    Angle("row_vertical_width_deg", default=PRESET, minimum=1, maximum=180,
          text="beam width of each row across the track"),
    Numbers("rows", default=PRESET, unit="wavelengths",
            text="places of the rows on the face, from the lowest row upwards"),
    Angle("tilt_deg", default=PRESET, minimum=0, maximum=80, text="tilt of the faces below the horizontal"),
    Numbers("face_place", default=(0.0, 0.1, 0.0), count=3, unit="m",
            text='"forward, starboard, down" of the middle of the starboard rows from the sonar; the port rows '
                 'mirror it'),
    Numbers("transmitter_place", default=(0.0, 0.1, 0.0), count=3, unit="m",
            text='"forward, starboard, down" of the starboard transmitter from the sonar; the port one mirrors it'),
    Number("looks", default=8.0, minimum=1, maximum=10_000, unit="range cells",
           text="least number of range cells over which phases are averaged; a longer bin is averaged whole"),
    Number("least_coherence", default=0.85, minimum=0, maximum=1,
           text="least coherence between the rows of a valid sounding"),
    Number("head_speed_error", default=0.0, minimum=-100, maximum=100, unit="m/s",
           text="error of the head's own sound-speed sensor: reading minus true value"),
    *recorder_of(PRESETS), DEPTH_GATE, SOUND_SPEED, *NOISE, SELF_NOISE, MOTION_ERRORS, pings(100), ROUTE, *NESTED,
)


class Interferometric(SonarSensor):
    """Interferometric sensor; `mitsonar.survey.interferometric.kind` plans its run, makes its picture and soundings."""

    kind, declared, two_sided = "interferometric", ATTRIBUTES, True

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the faces and the settings of the phase measurement."""
        self.preset = attributes.preset
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, attributes.self_noise_db
        self.pulse = make_pulse(attributes, self.frequency, attributes.pulse_ms / 1000,
                                float(hertz_from_khz(attributes.bandwidth_khz)))
        self.tilt = attributes.tilt_deg
        self.looks, self.least_coherence = attributes.looks, attributes.least_coherence
        self.head_speed_error, self.depth_gate = attributes.head_speed_error, depth_gate(attributes)
        self.motion_errors = motion_errors(attributes)
        wavelength = nominal_sound_speed(self.sound_speed, self.water, self.route) / self.frequency
        self.transmit, self.receive = _faces(attributes, wavelength)
        self.recorder = read_recorder(attributes, source_level_db=self.source_level_db, width=attributes.beam_width_deg,
                                      pulse_length=self.pulse.compressed_length())

    def to_string(self) -> str:
        rows = self.receive[0].elements
        return f"Interferometric[{self.frequency / 1000:g} kHz, 2 x {rows} rows, {self.route.pings} pings]"


def _faces(attributes: Attributes, wavelength: float) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return the transmitters and the rows of port and starboard."""
    place, tilt = np.asarray(attributes.rows, float), attributes.tilt_deg
    if not 2 <= len(place) <= MOST_ROWS or not (np.abs(place) <= FARTHEST).all() or not (np.diff(place) > 0).all():
        raise attributes.error(f"rows is {place.tolist()}; give 2 to {MOST_ROWS} places [wavelengths] that rise, "
                               f"within {FARTHEST:g}.")
    for name in ("face_place", "transmitter_place"):
        if np.abs(getattr(attributes, name)).max() > FARTHEST:
            raise attributes.error(f"{name} is {getattr(attributes, name).tolist()}; give at most {FARTHEST:g} m "
                                   "either way.")
    length = length_for_beam_width(attributes.beam_width_deg, wavelength)
    transmit, receive = [], []
    try:
        ReceiverRows(place=place, sector=sector_of(tilt))
        for side in (-1.0, 1.0):
            mirror = np.array([1.0, side, 1.0])
            normal = mirror * [0.0, np.cos(tilt), np.sin(tilt)]
            up = mirror * [0.0, np.sin(tilt), -np.cos(tilt)]
            lowest_first = (place - place.mean())[:, None] * wavelength * up
            for faces, middle, position, width in (
                    (transmit, attributes.transmitter_place, np.zeros((1, 3)), attributes.vertical_beam_width_deg),
                    (receive, attributes.face_place, lowest_first, attributes.row_vertical_width_deg)):
                faces.append(element_array(mirror * middle + position, normal=normal, along="forward", length=length,
                                           height=length_for_beam_width(width, wavelength), pattern="rectangular",
                                           baffle="hard"))
        return (transmit[0], transmit[1]), (receive[0], receive[1])
    except ValueError as error:
        raise attributes.error(error) from None


mi.register_sensor("interferometric", Interferometric)
