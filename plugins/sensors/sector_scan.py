"""Sector scan (`sector_scan`): a mechanically rotating head with one beam, on a vehicle, a pole or a tripod.

The head turns from ping to ping, and also during reception: the beam of an echo differs between its transmission and
its reception. The head moves with its platform; for a tripod, write ``start`` and a ``speed_knots`` of 0. The picture
has a row for each ping, with its ``bearing`` and ``turn``.

Bearings count clockwise: with ``mount`` ``down`` or ``up`` from the bow, seen from above; with ``forward`` from
straight up, seen looking ahead.

.. code-block:: xml

    <sensor type="sector_scan">
        <string name="preset" value="head_750khz"/>
        <float name="tilt_deg" value="5"/>
        <point name="start" x="0" y="0" z="-10"/>
        <float name="speed_knots" value="0"/>
        <medium type="seawater"/>
        <film type="sonar_film"><float name="range" value="30"/><integer name="bins" value="1200"/></film>
    </sensor>
"""
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.sonar.motion.rotating_head import MOUNTS, HeadSweep, RotatingHead
from mitsonar.sonar.preset_tables import presets
from mitsonar.sonar.pulses.pulses import cw, lfm
from mitsonar.units import hertz_from_khz

from ..attributes import Angle, Attributes, Boolean, Choice, FromTable, Integer, Number, Preset
from ..films.recorder_attributes import read_recorder, recorder_of
from .platform import MOST_PINGS, ROUTE
from .sonar_sensor import (
    HIGHEST_DB,
    LOWEST_DB,
    NESTED,
    NOISE,
    PASS,
    SELF_NOISE,
    SOUND_SPEED,
    VERTICAL_SIDELOBE,
    SonarSensor,
    power_of,
    read_self_noise_db,
)

PRESETS = presets("sector_scan")
PRESET = FromTable(table=PRESETS, by="preset")
WINDOW = ("tukey", 0.2)            # over sweeps: without it their ends ring

ATTRIBUTES = (
    Preset("preset", default="head_750khz", choices=tuple(PRESETS), text="source of the defaults marked *preset*"),
    Number("frequency_khz", default=PRESET, above=0, maximum=10_000, unit="kHz", text="centre frequency"),
    Number("source_level_db", default=PRESET, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa @ 1 m",
           text="source level on the axis of the beam, rms over the pulse"),
    Number("pulse_ms", default=PRESET, above=0, maximum=10_000, unit="ms", text="pulse length"),
    Number("bandwidth_khz", default=PRESET, minimum=0, unit="kHz",
           text="bandwidth of a linear sweep, compressed on reception; 0: a pulse of one frequency"),
    Angle("beam_width_deg", default=PRESET, minimum=0.01, maximum=180,
          text="beam width in the plane of rotation, full width at -3 dB one way"),
    Angle("vertical_beam_width_deg", default=PRESET, minimum=0.1, maximum=180,
          text="beam width across that plane, full width at -3 dB one way"),
    replace(VERTICAL_SIDELOBE, default=PRESET,
            text=VERTICAL_SIDELOBE.text.replace("across the fan, of each face", "across that plane")),
    Choice("mount", default="down", choices=tuple(MOUNTS),
           text="direction of the head's axis: the beam turns about the vertical or, as in a pipe profiler, about "
                "the forward direction"),
    Angle("tilt_deg", default=0.0, minimum=-90, maximum=90,
          text="tilt of the beam out of the plane of rotation, towards the direction of `mount`"),
    Angle("step_deg", default=PRESET, minimum=0.01, maximum=90, text="step from ping to ping"),
    Angle("sector_deg", default=360.0, above=0, maximum=360, text="scanned sector; 360: a full circle"),
    Angle("first_bearing_deg", default=None, minimum=-360, maximum=360, otherwise="half the sector to port",
          text="bearing of the first ping; the sector lies clockwise from it"),
    Boolean("back_and_forth", default=None, otherwise="true but in a full circle",
            text="true: the head reverses at either end of the sector, where it stays for two pings; false: it goes "
                 "on round a full circle, or jumps back to the beginning of a sector"),
    Boolean("turns_while_listening", default=True,
            text="true: the head turns evenly, also during reception; false: it stands during a ping, and turns "
                 "between pings"),
    *recorder_of(PRESETS), SOUND_SPEED,
    Choice("picture", default=None, choices=("beams", "elements"), otherwise="beams where that can be done",
           text="method: `beams` weighs the echoes of scatterers, as few as the resolution needs, by the beam; "
                "`elements` takes the signals of the head as one element, and takes a hundred times as long"),
    *NOISE,
    replace(SELF_NOISE, default=PRESET, otherwise="*preset*; none without `noise`", text="self-noise of the receiver"),
    Integer("pings", default=400, minimum=1, maximum=MOST_PINGS, otherwise="one turn, or way across the sector",
            text="number of pings; for a recorded track or way points, all if not written"),
    PASS, ROUTE, *NESTED,
)


class SectorScan(SonarSensor):
    """Sector scan sensor; `mitsonar.survey.sector_scan.kind` plans its run and makes its picture."""

    kind, declared = "sector_scan", ATTRIBUTES

    def read(self, attributes: Attributes) -> None:
        """Read the pulse, the beam and the rotation of the head."""
        self.preset = attributes.preset
        self.frequency = float(hertz_from_khz(attributes.frequency_khz))
        self.source_level_db, self.self_noise_db = attributes.source_level_db, read_self_noise_db(attributes)
        self.picture = attributes.picture
        self.beam_widths = attributes.beam_width_deg, attributes.vertical_beam_width_deg
        self.vertical_floor = power_of(attributes.vertical_sidelobe_db)
        self.pulse = _pulse(attributes, self.frequency)
        self.recorder = read_recorder(attributes, source_level_db=self.source_level_db, width=self.beam_widths[0],
                                      pulse_length=self.pulse.compressed_length())
        self.head = RotatingHead(mount=attributes.mount, tilt=attributes.tilt_deg, sweep=_sweep(attributes),
                         turns_on=attributes.turns_while_listening)
        if not attributes.given("pings"):
            self.route = replace(self.route, pings=self.head.sweep.pings_per_turn)

    def look_directions(self) -> tuple[np.ndarray, np.ndarray | None]:
        """Return the direction of the beam, as the track has its attitude; see `SonarSensor.look_directions`."""
        return np.array([[1.0, 0.0, 0.0]]), np.zeros(1)


def _pulse(attributes, frequency):
    duration, bandwidth = attributes.pulse_ms / 1000, float(hertz_from_khz(attributes.bandwidth_khz))
    try:
        return lfm(frequency, bandwidth, duration, WINDOW) if bandwidth else cw(frequency, duration)
    except ValueError as error:
        raise attributes.error(error) from None


def _sweep(attributes):
    step, sector, first = attributes.step_deg, attributes.sector_deg, attributes.first_bearing_deg
    if step > sector:
        raise attributes.error(f"step_deg is {np.rad2deg(step):g} and sector_deg {np.rad2deg(sector):g}; a step cannot "
                               "be wider than the sector, take a smaller one.")
    whole = sector >= 2 * np.pi * (1 - 1e-12)
    return HeadSweep(first=-0.5 * sector if first is None else first, step=step, sector=sector,
                 back_and_forth=not whole if attributes.back_and_forth is None else attributes.back_and_forth)


mi.register_sensor("sector_scan", SectorScan)
