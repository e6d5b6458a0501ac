"""Echo sounder (`echo_sounder`): a single beam that looks down, of a scientific or a navigation sounder.

The face is a disc or a square that sends and receives. With ``split_beam`` it receives by four quadrants: the phases
between their halves give the direction of every echo. ``mounting_deg`` turns the face away from straight down.

`mitsonar.render` makes an echogram over (ping, range): `level`, calibrated strengths of targets and of volumes by the
sonar equation, angles along and athwart the ship, a depth for every ping, and the truth of every bin.

The quadrants of a disc have its centroids and widths, and the shape of squares. A face is in its own far field at any
distance.

.. code-block:: xml

    <sensor type="echo_sounder">
        <string name="preset" value="scientific_120khz"/>
        <point name="start" x="0" y="0" z="-3"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="60"/><integer name="bins" value="600"/></film>
    </sensor>
"""
import mitsuba as mi
import numpy as np

from mitsonar.device.rotations import mounting_matrix
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array, planar_array
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.sonar.preset_tables import presets
from mitsonar.sonar.pulses.pulses import PULSES
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Boolean, Choice, FromTable, Number, Numbers, Preset, Text
from ..films.recorder_attributes import read_recorder, recorder_of
from .array_reading import nominal_sound_speed
from .motion_errors import DEPTH_GATE, depth_gate
from .platform import ROUTE, pings
from .pulse_attributes import make_pulse
from .sonar_sensor import HIGHEST_DB, LOWEST_DB, NESTED, NOISE, PASS, SOUND_SPEED, SonarSensor

PRESETS = presets("echo_sounder")
PRESET = FromTable(table=PRESETS, by="preset")
HALF_POWER = 0.51450               # x of a disc's beam of half power: 2 J1(πx)/(πx) = √½, x = D sin(Δ/2) / λ
# x and y of a quarter disc of radius 1 from the disc's centre; side of a square as wide as the quarter disc
CENTROID = 4 / (3 * np.pi)
SQUARE = np.sqrt(12 * (0.25 - CENTROID ** 2))

ATTRIBUTES = (
    Preset("preset", default="scientific_120khz", choices=tuple(PRESETS),
           text="source of the defaults marked *preset*"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="centre frequency"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level on the axis of the beam, rms over the pulse"),
    Choice("pulse", default=PRESET, choices=tuple(PULSES), text="waveform: one frequency, or a sweep"),
    Number("pulse_ms", default=PRESET, above=0, maximum=10_000, unit="ms", text="pulse length"),
    Number("bandwidth_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="bandwidth of a sweep"),
    Text("pulse_window", default="tukey 0.2", text='window over the pulse, such as "boxcar", "hann" or "tukey 0.2"'),
    Choice("face", default=PRESET, choices=("circular", "square"), text="shape of the face, which sends and receives"),
    Angle("beam_width_deg", default=PRESET, minimum=0.5, maximum=90,
          text="beam width of the face, full width at -3 dB one way; of a square along its sides"),
    Boolean("split_beam", default=PRESET,
            text="true: four quadrants receive, and their phases give angles along and athwart the ship"),
    Numbers("mounting_deg", default=(0.0, 0.0, 0.0), count=3, unit="degrees",
            text='"roll, pitch, heading" of the face in the body; with a roll above 0 the face looks to port, with a '
                 'pitch above 0 ahead'),
    DEPTH_GATE,
    Number("bottom_level_db", default=-50.0, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 m⁻¹",
           text="least volume strength of an echo that counts as the bed"),
    *recorder_of(PRESETS), SOUND_SPEED, *NOISE,
    Number("self_noise_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa²/Hz",
           text="self-noise of the whole face; that of a single quadrant is 6 dB higher"),
    pings(200), PASS, ROUTE, *NESTED,
)


class EchoSounder(SonarSensor):
    """Echo sounder sensor; `mitsonar.survey.echo_sounder.kind` plans its run and makes its picture."""

    kind, declared = "echo_sounder", ATTRIBUTES

    def look_directions(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return four directions a beam width off the axis; see `SonarSensor.look_directions`."""
        normal, along = self.receive.normal[0], self.receive.along[0]
        aside = np.stack([along, -along, np.cross(normal, along), -np.cross(normal, along)])
        return np.cos(self.beam_width) * normal + np.sin(self.beam_width) * aside, None

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the face and the settings of the bottom detection."""
        self.read_transmission(attributes)
        self.preset = attributes.preset
        self.pulse = make_pulse(attributes, self.frequency, attributes.pulse_ms / 1000,
                                float(hertz_from_khz(attributes.bandwidth_khz)), attributes.pulse_window)
        self.depth_gate, self.bottom_level_db = depth_gate(attributes), attributes.bottom_level_db
        self.beam_width = attributes.beam_width_deg
        wavelength = nominal_sound_speed(self.sound_speed, self.water, self.route) / self.frequency
        self.transmit, self.quadrants = _faces(attributes, wavelength)
        self.receive = self.transmit
        self.recorder = read_recorder(attributes, source_level_db=self.source_level_db, width=attributes.beam_width_deg,
                                      pulse_length=self.pulse.compressed_length())


def _faces(attributes: Attributes, wavelength: float) -> tuple[Array, Array | None]:
    """Return the whole face and, of a split beam, its quadrants."""
    turned = mounting_matrix(*np.deg2rad(attributes.mounting_deg))
    looks = {"normal": turned[:, 2], "baffle": "hard"}
    circular, width = attributes.face == "circular", attributes.beam_width_deg
    size = length_for_beam_width(width, wavelength, *[HALF_POWER] * circular)
    shape = {"pattern": "circular"} if circular else {"pattern": "rectangular", "height": size}
    whole = element_array([0.0, 0.0, 0.0], along=turned[:, 0], length=size, **shape, **looks)
    if not attributes.split_beam:
        return whole, None
    apart, side = (CENTROID * size, 0.5 * SQUARE * size) if circular else (0.5 * size, 0.5 * size)
    if apart < 0.5 * wavelength:
        raise attributes.error(f"the quadrants of a face of {np.rad2deg(width):g} degrees lie {apart / wavelength:.2g} "
                               "wavelengths apart, less than half of one; make beam_width_deg smaller, or split_beam "
                               "false.")
    return whole, planar_array(2, 2, apart, axis=turned[:, 0], length=side, height=side, pattern="rectangular", **looks)


mi.register_sensor("echo_sounder", EchoSounder)
