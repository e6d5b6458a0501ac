"""Multibeam echo sounder (`multibeam`): a swath across the track, a sounding a beam.

A transmit line along the track and a receive line across it (a Mills cross) make narrow beams together. A ping has
one or more transmissions, one for each sector of the swath. Each sector has its own frequency, pulse, level, direction
and time, and the absorption of its frequency. A beam receives the transmission of its own sector.

These attributes are lists with one number for each sector, from port to starboard, or one number for all sectors:
``frequency_khz``, ``source_level_db``, ``pulse_ms``, ``bandwidth_khz``, ``sector_tilt_deg``, ``sector_delay_ms``.
``sector_edges_deg`` are the limits between sectors; leave it out for a single sector. With ``swaths`` of 2 a ping
sends all sectors twice, one step apart along the track, and has twice the beams.

Roll, pitch and yaw are compensated as in real instruments: beams are steered for the roll at the reception of their
echo, transmissions for pitch and yaw at the transmission. Write two heads, or two swaths of different settings, as two
sensors; the second one takes the track of the first by ``<ref id="..."/>``. ``mounting_deg`` turns a head.

``head_speed_error`` and the errors of the motion sensors (``roll_bias_deg`` and the attributes after it) change
soundings. They do not change pictures.

`mitsonar.render` makes the picture of the water column: `level` over (ping, beam, range), with its truth.
`mitsonar.soundings` and ``mitsonar soundings`` make the soundings.

.. code-block:: xml

    <sensor type="multibeam">
        <string name="preset" value="shallow_300khz_three_sectors"/>
        <point name="start" x="0" y="0" z="-2"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="120"/></film>
    </sensor>
"""
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.device.rotations import mounting_matrix
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import line_array
from mitsonar.sonar.arrays.sectors import SPACINGS, Sector, beam_angles, elements_for_beam_width
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.sonar.preset_tables import presets
from mitsonar.sonar.pulses.pulses import PULSES
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Boolean, Choice, FromTable, Integer, Number, Numbers, Preset, Text
from ..films.recorder_attributes import read_recorder, recorder_of
from ..films.strength_attributes import WRITTEN_STRENGTHS, read_strength_writing
from .array_attributes import MOST_ELEMENTS
from .array_reading import nominal_sound_speed
from .motion_errors import DEPTH_GATE, MOTION_ERRORS, depth_gate, motion_errors
from .platform import ROUTE, pings
from .pulse_attributes import make_pulse
from .sonar_sensor import (
    HIGHEST_DB,
    LOWEST_DB,
    NESTED,
    NOISE,
    PASS,
    RECEIVE_FLAWS,
    SELF_NOISE,
    SOUND_SPEED,
    SonarSensor,
)

PRESETS = presets("multibeam")
PRESET = FromTable(table=PRESETS, by="preset")
OVERLAP = 1.5                      # beam width of a transmit face at -3 dB, in widths of its sector
MOST_SECTORS = 16
STEEPEST_DEG = 89.0
FARTHEST = 1000.0                  # [m]: greatest distance of a line from the sonar, longer than any ship
LISTS = ("source_level_db", "pulse_ms", "bandwidth_khz", "sector_tilt_deg", "sector_delay_ms")

ATTRIBUTES = (
    Preset("preset", default="shallow_400khz", choices=tuple(PRESETS),
           text="source of the defaults marked *preset*"),
    Numbers("frequency_khz", default=PRESET, unit="kHz", text="carrier frequency of each sector"),
    Numbers("source_level_db", default=PRESET, unit="dB re 1 µPa @ 1 m",
            text="source level of each transmission, on its axis"),
    Choice("pulse", default=PRESET, choices=tuple(PULSES), text="waveform: one frequency, or a sweep"),
    Numbers("pulse_ms", default=PRESET, unit="ms", text="pulse length of each sector"),
    Numbers("bandwidth_khz", default=PRESET, unit="kHz", text="bandwidth of each sector's sweep"),
    Integer("beams", default=PRESET, minimum=2, maximum=100_000, text="number of beams of a swath"),
    Angle("swath_deg", default=PRESET, above=0, maximum=178, text="swath width, from the first to the last beam"),
    Angle("swath_middle_deg", default=0.0, minimum=-80, maximum=80,
          text="angle of the swath's middle from the vertical, to starboard, for a head that looks aside"),
    Choice("beam_spacing", default=PRESET, choices=SPACINGS,
           text="quantity that grows by equal steps from beam to beam: the angle, or the distance on a level bed"),
    Numbers("sector_edges_deg", default=PRESET, unit="degrees", text="limits between sectors, from port to starboard"),
    Numbers("sector_tilt_deg", default=(0.0,), unit="degrees",
            text="forward tilt of each transmission out of the plane across the track"),
    Numbers("sector_delay_ms", default=PRESET, unit="ms",
            text="delay of each transmission after the first one of the ping"),
    Integer("swaths", default=PRESET, minimum=1, maximum=2, text="number of swaths of a ping, one ahead of the other"),
    Angle("swath_step_deg", default=PRESET, minimum=0, maximum=20, text="angle between two swaths, along the track"),
    Angle("transmit_beam_width_deg", default=PRESET, minimum=0.1, maximum=90,
          text="beam width of the transmit line along the track, full width at -3 dB one way, at the first frequency"),
    Angle("receive_beam_width_deg", default=PRESET, minimum=0.1, maximum=90,
          text="beam width of the receive line across the track, full width at -3 dB one way, at the first frequency "
               "and normal to the line"),
    Angle("receive_along_width_deg", default=30.0, minimum=0.5, maximum=180,
          text="beam width of the receivers along the track"),
    Number("element_spacing", default=0.5, above=0, maximum=10, unit="wavelengths",
           text="distance between elements of both lines, at the highest frequency"),
    Text("transmit_shading", default="taylor 4 30",
         text='window over the transmit elements, such as "taylor 4 30" or "boxcar"'),
    Text("receive_shading", default="taylor 4 30",
         text="window over the receive elements; each of the two halves whose phases are compared has its part of "
              "the window"),
    replace(RECEIVE_FLAWS, default=PRESET,
            text="rms error of each receiver's amplitude [1] and phase [rad], after calibration of the halves: side "
                 "lobes of twice its square over the number of receivers"),
    Numbers("transmit_place", default=(0.0, 0.0, 0.0), count=3, unit="m",
            text='"forward, starboard, down" of the transmit line from the sonar'),
    Numbers("receive_place", default=(0.0, 0.0, 0.0), count=3, unit="m",
            text='"forward, starboard, down" of the receive line from the sonar'),
    Numbers("mounting_deg", default=(0.0, 0.0, 0.0), count=3, unit="degrees",
            text='"roll, pitch, heading" of the head in the body; with a roll above 0 the head looks to port, and '
                 '`swath_middle_deg` turns with it'),
    Boolean("roll_stabilised", default=True, text="true: beams keep their angles from the vertical"),
    Boolean("pitch_stabilised", default=True,
            text="true: transmissions keep their angles from the vertical plane across the course"),
    Boolean("yaw_stabilised", default=False, text="true: that plane stays across the course, sector by sector"),
    Number("head_speed_error", default=0.0, minimum=-100, maximum=100, unit="m/s",
           text="error of the head's own sound-speed sensor: reading minus true value"),
    *recorder_of(PRESETS),
    Boolean("recorded_column", default=False,
            text="true: soundings' water column has `column_recorded_db` too, the levels of the recorder's counts"),
    WRITTEN_STRENGTHS, DEPTH_GATE, SOUND_SPEED, *NOISE, SELF_NOISE, MOTION_ERRORS, pings(20),
    PASS, ROUTE, *NESTED,
)


class Multibeam(SonarSensor):
    """Multibeam sensor; `mitsonar.survey.multibeam.kind` plans its run and makes its picture and soundings."""

    kind, declared, two_sided = "multibeam", ATTRIBUTES, True

    def read(self, attributes: Attributes) -> None:
        """Read the sectors, their beams and the arrays."""
        self.preset = attributes.preset
        self.self_noise_db = attributes.self_noise_db
        self.stabilised = (attributes.roll_stabilised, attributes.pitch_stabilised, attributes.yaw_stabilised)
        self.receive_flaws = attributes.receive_flaws
        self.head_speed_error = attributes.head_speed_error
        self.depth_gate = depth_gate(attributes)
        self.nominal_sound_speed = nominal_sound_speed(self.sound_speed, self.water, self.route)
        for name, most, unit in (("transmit_place", FARTHEST, "m"), ("receive_place", FARTHEST, "m"),
                                 ("mounting_deg", 360.0, "degrees")):
            if np.abs(getattr(attributes, name)).max() > most:
                raise attributes.error(f"{name} is {getattr(attributes, name).tolist()}; give at most {most:g} {unit} "
                                       "either way.")
        self.mounting = np.deg2rad(attributes.mounting_deg)
        self.sectors = _sectors(attributes)
        self.strength_writing = read_strength_writing(attributes, len(self.sectors))
        self.pulse = self.sectors[0].pulse
        self.frequency = self.pulse.frequency
        self.recorder = read_recorder(
            attributes, source_level_db=max(sector.source_level_db for sector in self.sectors),
            width=attributes.transmit_beam_width_deg, pulse_length=self.pulse.compressed_length())
        highest = max(sector.pulse.frequency for sector in self.sectors)
        if attributes.recorded_column and self.recorder is None:
            raise attributes.error("recorded_column is true, but the sonar has no recorder; give it one, such as "
                                   "water_column_8bit.")
        self.column_recorder = self.recorder if attributes.recorded_column else None
        self.transmit, self.receive = _lines(attributes, self.sectors, self.nominal_sound_speed / highest)
        self.transmit_place, self.receive_place = attributes.transmit_place, attributes.receive_place
        self.motion_errors = motion_errors(attributes)

    def look_directions(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return both sides, which end at the outermost beams; see `SonarSensor.look_directions`."""
        widest = max(float(np.abs(sector.beams).max()) for sector in self.sectors)
        return super().look_directions()[0], np.full(2, max(np.pi / 2 - widest, 0.0))

    def to_string(self) -> str:
        return f"Multibeam[{self.frequency / 1000:g} kHz, {sum(len(sector.beams) for sector in self.sectors)} beams]"


def _sectors(attributes: Attributes) -> tuple[Sector, ...]:
    """Return the transmissions of a ping, swath after swath."""
    frequency = hertz_from_khz(attributes.frequency_khz)
    count = len(frequency)
    if not 1 <= count <= MOST_SECTORS or not (frequency > 0).all():
        raise attributes.error(f"frequency_khz is {attributes.frequency_khz.tolist()}; give 1 to {MOST_SECTORS} "
                               "numbers above 0, one a sector.")
    columns = {name: _column(attributes, name, count) for name in LISTS}
    middle, half = np.rad2deg(attributes.swath_middle_deg), 0.5 * np.rad2deg(attributes.swath_deg)
    if abs(middle) + half > STEEPEST_DEG:
        raise attributes.error(f"swath_deg and swath_middle_deg make a swath from {middle - half:g} to "
                               f"{middle + half:g} degrees; it must end within {STEEPEST_DEG:g}.")
    edges = np.concatenate([[middle - half], attributes.sector_edges_deg, [middle + half]])
    if len(edges) != count + 1 or not (np.diff(edges) > 0).all():
        raise attributes.error(f"sector_edges_deg is {attributes.sector_edges_deg.tolist()}; {count} sectors need "
                               f"{count - 1} numbers, rising, within the swath of {middle - half:g} to "
                               f"{middle + half:g} degrees.")
    for name, low, high in (("source_level_db", LOWEST_DB, HIGHEST_DB), ("pulse_ms", 1e-4, 1e4),
                            ("sector_delay_ms", 0, 1e4), ("sector_tilt_deg", -45, 45)):
        if not ((columns[name] >= low) & (columns[name] <= high)).all():
            raise attributes.error(f"{name} is {columns[name].tolist()}; expected numbers from {low:g} to {high:g}.")
    try:
        angles = beam_angles(attributes.beams, attributes.swath_deg, attributes.beam_spacing,
                             attributes.swath_middle_deg)
    except ValueError as error:
        raise attributes.error(error) from None
    which = np.clip(np.searchsorted(np.deg2rad(edges), angles, side="right") - 1, 0, count - 1)
    sectors = []
    for swath in range(attributes.swaths):
        forward = (swath - 0.5 * (attributes.swaths - 1)) * attributes.swath_step_deg
        later = swath * (columns["sector_delay_ms"].max() + columns["pulse_ms"].max())
        for k in range(count):
            if not (which == k).any():
                raise attributes.error(f"no beam lies in sector {k}, {edges[k]:g} to {edges[k + 1]:g} degrees; move "
                                       "the edges, or take more beams.")
            sectors.append(Sector(
                pulse=make_pulse(attributes, float(frequency[k]), float(columns["pulse_ms"][k]) / 1000,
                                 float(hertz_from_khz(columns["bandwidth_khz"][k]))),
                source_level_db=float(columns["source_level_db"][k]),
                delay=float(columns["sector_delay_ms"][k] + later) / 1000,
                tilt=float(np.deg2rad(columns["sector_tilt_deg"][k]) + forward), beams=angles[which == k],
                first=float(np.deg2rad(edges[k])), last=float(np.deg2rad(edges[k + 1]))))
    return tuple(sectors)


def _column(attributes: Attributes, name: str, count: int) -> np.ndarray:
    """Return the numbers of a list, one for each sector."""
    values = np.asarray(getattr(attributes, name), float)
    if len(values) not in (1, count):
        raise attributes.error(f"{name} has {len(values)} numbers; give one, or one for each of the {count} sectors of "
                               "frequency_khz.")
    return np.broadcast_to(values, (count,))


def _lines(attributes: Attributes, sectors: tuple[Sector, ...],
           finest: float) -> tuple[tuple[Array, ...], Array]:
    """Return the transmit lines, one for each sector, and the receive line; `finest` is the shortest wavelength [m]."""
    turned = mounting_matrix(*np.deg2rad(attributes.mounting_deg))
    highest = max(sector.pulse.frequency for sector in sectors)
    pitch = attributes.element_spacing * finest
    # widths are those of the first sector's frequency
    relative = attributes.element_spacing * sectors[0].pulse.frequency / highest
    try:
        counts = [elements_for_beam_width(width, relative, window) for width, window in (
            (attributes.transmit_beam_width_deg, attributes.transmit_shading),
            (attributes.receive_beam_width_deg, attributes.receive_shading))]
        if max(counts) > MOST_ELEMENTS:
            raise ValueError(f"beams as narrow take lines of {max(counts)} elements, and {MOST_ELEMENTS} are the most; "
                             "take wider beams")
        along, across = turned[:, 0], turned[:, 1]
        transmit = []
        for sector in sectors:
            wavelength = finest * highest / sector.pulse.frequency
            width = min(OVERLAP * (sector.last - sector.first), np.pi)
            looks = turned @ np.array([0.0, np.sin(sector.middle), np.cos(sector.middle)])
            line = line_array(counts[0], pitch, axis=along, normal=looks, length=pitch,
                              height=length_for_beam_width(width, wavelength), pattern="rectangular", baffle="hard")
            transmit.append(line.shaded(attributes.transmit_shading).moved(attributes.transmit_place))
        height = length_for_beam_width(attributes.receive_along_width_deg, finest)
        receive = line_array(counts[1], pitch, axis=across, normal=turned[:, 2], length=pitch, height=height,
                             pattern="rectangular", baffle="hard")
        return tuple(transmit), receive.shaded(attributes.receive_shading).moved(attributes.receive_place)
    except ValueError as error:
        raise attributes.error(error) from None


mi.register_sensor("multibeam", Multibeam)
