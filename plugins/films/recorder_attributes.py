"""Recorder of an instrument: it makes the counts in the instrument's file, variable `recorded`, of the levels.

`level` stays that of the sonar equation. The recorder adds the instrument's gain, noise, stripes and faults, detects,
smooths and converts to whole counts; `mitsonar.imaging.recorded_levels` converts counts to levels. Pictures are drawn
from counts where they are asked for: `--tvg counts` of `plot`, `labels` and `convert`. `recorder` names a class of
instruments, which has a value for every attribute here; each can be overridden.
"""
from collections.abc import Mapping
from typing import Any

import numpy as np

from mitsonar.imaging.recorder import (
    LAWS,
    MOST_BITS,
    MOST_SAMPLES,
    MOST_TAP,
    Converter,
    Detector,
    Electronics,
    PingFaults,
    Recorder,
    TimeVariedGain,
)
from mitsonar.sonar.preset_tables import recorders
from mitsonar.units import db_from_power

from ..attributes import Attribute, Attributes, Boolean, Choice, FromTable, Group, Integer, Number, Numbers
from ..sensors.sonar_sensor import HIGHEST_DB, LOWEST_DB, power_of

CLASS = FromTable(table=recorders(), by="recorder")
SPEED, BED_DB = 1500.0, -40.0      # [m/s], [dB]: of the bed that the default full scale is set for
SHARE_DB = {"default": CLASS, "minimum": LOWEST_DB, "maximum": 20, "unit": "dB re full scale"}

RECORDER = Group(title="Recorder", module="films.recorder_attributes", attributes=(
    Number("recorder_full_scale_db", default=None, minimum=LOWEST_DB, maximum=HIGHEST_DB, unit="dB re 1 µPa",
           otherwise="by `recorder_headroom_db`", formerly="full_scale_db",
           text="level after the gain that is the highest count; louder echoes saturate"),
    Number("recorder_headroom_db", default=CLASS, minimum=-100, maximum=100, unit="dB",
           text="full scale above the echo of a bed of -40 dB strength on the axis of beams as wide, from pulses as "
                "long and as loud, after a gain of 30 dB per factor of 10"),
    Integer("recorder_bits", default=CLASS, minimum=0, maximum=MOST_BITS, formerly="adc_bits",
            text="bits of a count; 0: no recorder"),
    Boolean("recorder_dither", default=CLASS, text="noise of one step before the conversion"),
    Choice("recorder_detector", default=CLASS, choices=LAWS,
           text="law by which counts grow with the amplitude; imaging sonars show the root, some heads the logarithm"),
    Number("recorder_log_range_db", default=CLASS, above=0, unit="dB",
           text="range below full scale of a `log` detector, whose counts are even steps of level"),
    Number("recorder_peak", default=CLASS, minimum=0, maximum=MOST_SAMPLES, unit="samples",
           text="window of a detector that takes the highest amplitude in place of the bin's mean: 1 for the bin, more "
                "for windows that overlap and repeat it, 0 for the mean; sonars other than `sidescan` round it to "
                "whole samples"),
    Number("recorder_low_pass", default=CLASS, minimum=0, maximum=MOST_TAP,
           text="low pass behind the detector: share of each neighbour in range; 0.05 to 0.17 in sidescans"),
    Number("recorder_along_track", default=CLASS, minimum=0, below=1,
           text="share of the ping before in every ping, as displays smooth; 0: none"),
    Integer("recorder_decimation", default=CLASS, minimum=1, maximum=1000,
            text="one of so many samples is kept, and repeated in place of the others"),
    Integer("recorder_interpolation", default=CLASS, minimum=1, maximum=1000,
            text="one of so many beams is formed, and those between are interpolated"),
    Number("recorder_tvg", default=CLASS, minimum=0, maximum=60, unit="dB",
           text="gain per factor of 10 in range; 30 evens out a bed, 40 a target, 0: no gain"),
    Number("recorder_tvg_absorption_db", default=None, minimum=0, unit="dB/m", otherwise="the water's",
           text="one-way absorption that the gain makes up for, if there is a gain"),
    Number("recorder_tvg_start", default=CLASS, above=0, unit="m", text="range before which the gain is constant"),
    Number("recorder_tvg_end", default=None, above=0, unit="m", otherwise="none",
           text="range after which the gain is constant"),
    Number("recorder_tvg_step_db", default=CLASS, minimum=0, unit="dB", text="step of the gain; 0: smooth"),
    Numbers("recorder_sectors_db", default=CLASS, unit="dB",
            text="further gains of equal parts of the beams, as of the sectors of a swath, or of port and starboard"),
    Number("recorder_noise_db", **SHARE_DB, text="noise behind the gain, of each side or beam"),
    Number("recorder_noise_edge_db", default=CLASS, minimum=-40, maximum=40, unit="dB",
           text="how much louder that noise is in the outermost beams than in the middle, as the square between"),
    Number("recorder_noise_rows_db", default=CLASS, minimum=0, maximum=20, unit="dB",
           text="rms difference of the noises of sides or beams: noisy beams"),
    Number("recorder_noise_ranges_db", default=CLASS, minimum=0, maximum=20, unit="dB",
           text="rms difference of the noises of samples: noise at fixed ranges"),
    Number("recorder_common_noise_db", **SHARE_DB, text="the same noise in all sides or beams"),
    Number("recorder_crosstalk_db", default=CLASS, minimum=LOWEST_DB, maximum=0, unit="dB",
           text="mean echo of all beams in each, for sonars with beams"),
    Number("recorder_line_db", **SHARE_DB, text="line of the transmission at range zero"),
    Number("recorder_line_ms", default=CLASS, minimum=0, unit="ms", text="length of that line"),
    Number("recorder_ringing_ms", default=CLASS, minimum=0, unit="ms", formerly="ringing_ms",
           text="time after it in which the ringing falls by 60 dB"),
    Number("recorder_row_gain_db", default=CLASS, minimum=0, maximum=20, unit="dB",
           text="rms difference of the gains of sides or beams: stripes across a fan"),
    Number("recorder_stripe_db", default=CLASS, minimum=0, maximum=20, unit="dB",
           text="rms difference of the gains of samples: stripes at fixed ranges"),
    Number("recorder_interference_hz", default=CLASS, minimum=0, maximum=1000, unit="Hz",
           text="rate at which another sonar pings; 0: none"),
    Number("recorder_interference_db", **SHARE_DB, text="level of its pulses"),
    Number("recorder_interference_ms", default=CLASS, minimum=0, unit="ms", text="length of its pulses"),
    Number("recorder_ping_gain_db", default=CLASS, minimum=0, maximum=20, unit="dB",
           text="rms difference of the gains of pings"),
    Number("recorder_lost", default=CLASS, minimum=0, maximum=1, text="share of pings that are lost, written as 0"),
    Number("recorder_repeated", default=CLASS, minimum=0, maximum=1,
           text="share of pings in whose place the one before is written again"),
    Number("recorder_bright", default=CLASS, minimum=0, maximum=1, text="share of pings that are brighter"),
    Number("recorder_bright_db", default=CLASS, minimum=-40, maximum=40, unit="dB", text="by how much these are"),
    Integer("recorder_serial", default=0, minimum=0, maximum=(1 << 32) - 1,
            text="number of the instrument, which draws the gains of its beams and samples"),
))


def recorder_of(presets: Mapping[str, Mapping[str, Any]] | None = None) -> tuple[Attribute | Group, ...]:
    """Return the attributes of a recorder, whose class is that of a kind's presets, if it has any."""
    default = "none" if presets is None else FromTable(table=presets, by="preset")
    return (
        Choice("recorder", default=default, choices=tuple(recorders()),
               text="class of instruments whose recorder writes `recorded`; `none`: there is no such variable"),
        RECORDER)


def read_recorder(attributes: Attributes, *, source_level_db: float, width: float, pulse_length: float
                  ) -> Recorder | None:
    """Return the recorder of a sonar with a width of its beams [rad] and a compressed pulse [s], or None without one.

    Its full scale is A = SL + 10 log(θ c τ / 2) + S + headroom, where it is not written: the level after 30 log R of
    the reverberation of a bed from a cell R θ wide (Urick 1983, ch. 8), c of 1500 m/s.
    """
    bits = attributes.recorder_bits
    written = attributes.given(*(name for one in RECORDER.attributes for name in (one.name, one.formerly)))
    if attributes.recorder == "none" and written and (bits or not {*written} <= {"recorder_bits", "adc_bits"}):
        raise attributes.error(f"{written[0]} is given, but the recorder is none; leave it out, or give the class of a "
                               "recorder.")
    if not bits or attributes.recorder == "none":
        return None
    full_scale_db = attributes.recorder_full_scale_db
    if full_scale_db is None:
        cell = min(width, 2 * np.pi) * 0.5 * SPEED * pulse_length
        full_scale_db = source_level_db + float(db_from_power(cell)) + BED_DB + attributes.recorder_headroom_db
    shares = {name: power_of(getattr(attributes, f"recorder_{name}_db"))
              for name in ("noise", "common_noise", "crosstalk", "line", "interference")}
    absorption, end = attributes.recorder_tvg_absorption_db, attributes.recorder_tvg_end
    try:
        return Recorder(
            converter=Converter(bits=bits, full_scale_db=full_scale_db, dither=attributes.recorder_dither),
            gain=TimeVariedGain(
                spreading=attributes.recorder_tvg, start=attributes.recorder_tvg_start, absorption_db=absorption,
                end=float("inf") if end is None else end, step_db=attributes.recorder_tvg_step_db,
                sectors_db=tuple(map(float, attributes.recorder_sectors_db))),
            detector=Detector(law=attributes.recorder_detector, range_db=attributes.recorder_log_range_db,
                              peak=attributes.recorder_peak,
                              low_pass=attributes.recorder_low_pass, along_track=attributes.recorder_along_track,
                              decimation=attributes.recorder_decimation),
            electronics=Electronics(
                **shares, noise_edge_db=attributes.recorder_noise_edge_db,
                noise_rows_db=attributes.recorder_noise_rows_db, noise_ranges_db=attributes.recorder_noise_ranges_db,
                line_length=attributes.recorder_line_ms / 1000,
                ringing=attributes.recorder_ringing_ms / 1000, row_gain_db=attributes.recorder_row_gain_db,
                stripe_db=attributes.recorder_stripe_db, interference_rate=attributes.recorder_interference_hz,
                interference_length=attributes.recorder_interference_ms / 1000),
            faults=PingFaults(gain_db=attributes.recorder_ping_gain_db, lost=attributes.recorder_lost,
                              repeated=attributes.recorder_repeated, bright=attributes.recorder_bright,
                              bright_db=attributes.recorder_bright_db),
            interpolation=attributes.recorder_interpolation, serial=attributes.recorder_serial)
    except ValueError as error:
        raise attributes.error(error) from None
