"""Dataset of a line of soundings, simulated or read from an instrument's file.

Dimensions: ``ping``, ``beam`` (soundings of a ping, padded), ``transmission`` (sectors of a ping), ``motion`` (samples
of the motion sensors), ``node`` (of the cast), ``axis`` (forward, starboard, down) and, where present, ``true_node``
(of the true sound speed profile), ``column_beam`` and ``column_sample`` of the water column and ``snippet_sample``.

Scene frame: x east, y north of the origin, depth positive down from the surface, or from the datum of a ``tide``. Body
frame: x forward, y starboard, z down. Positions of the arrays are lever arms from the reference point, whose track is
``motion_x``, ``motion_y``, ``motion_depth``. Across and along track distances are from the reference point at the
transmission, along its heading.

Heights count upwards from the ellipsoid WGS 84. `ping_height` is that of the reference point, waves and tide included;
`separation` is that of the vertical datum at the same place: the reference point is ``separation - ping_height`` below
the datum. Attribute ``vertical_datum`` names the datum; ``heights`` is "gnss" where depths were reduced by
`ping_height` and `separation`, and "tide" or absent where by heave, draft and tide. With "gnss", `tide` is the water
level that follows, ``ping_height - separation`` plus the depth of the reference point below the surface.

A sounding is the intersection of two cones at a travel time:

    sin(transmit_angle) = a_t·l_t        sin(angle) = a_r·l_r

a_t, a_r -> unit vectors along the transmit and the receive array (forward and starboard if mounted straight); l_t, l_r
-> unit vectors towards the sounding at transmission and at reception.
"""
from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import xarray as xr

from mitsonar.device.record_table import RecordTable, rows

__all__ = ["BY_AMPLITUDE", "BY_PHASE", "NOT_DETECTED", "VARIABLES", "as_written", "check", "joined",
           "variable"]

NOT_DETECTED, BY_AMPLITUDE, BY_PHASE = 0, 1, 2        # values of ``detection``
_WRITTEN = {"backscatter_db": "written_backscatter_db", "snippet_db": "written_snippet_db",
            "column_level_db": "column_recorded_db"}
_PING, _BEAM, _SECTOR = ("ping",), ("ping", "beam"), ("ping", "transmission")

VARIABLES = RecordTable([
    *rows("line", ("node",), True,
          ("cast_depth", "f8", "m", "depth of the cast's nodes, increasing"),
          ("cast_sound_speed", "f8", "m/s", "sound speed there, as the soundings were made with")),
    *rows("line", ("axis",), True,
          ("transmit_offset", "f8", "m", "transmit array from the reference point, body frame"),
          ("receive_offset", "f8", "m", "receive array likewise"),
          ("transmit_mounting", "f8", "rad", "roll, pitch and heading of the transmit array in the body"),
          ("receive_mounting", "f8", "rad", "the same of the receive array")),
    *rows("line", ("receive_head", "axis"), False,
          ("head_receive_offset", "f8", "m", "receive_offset of each of several heads"),
          ("head_receive_mounting", "f8", "rad", "receive_mounting of each")),
    *rows("motion", ("motion",), True,
          ("motion_time", "f8", "s", "after the line's start"),
          ("motion_x", "f8", "m", "reference point, east"),
          ("motion_y", "f8", "m", "reference point, north"),
          ("motion_depth", "f8", "m", "reference point below the still surface: heave, and where it is mounted; below "
                                      "the datum if the line has a tide"),
          ("motion_roll", "f8", "rad", "starboard down"),
          ("motion_pitch", "f8", "rad", "bow up"),
          ("motion_heading", "f8", "rad", "clockwise from north")),
    *rows("ping", _PING, True,
          ("ping_time", "f8", "s", "of the first transmission, after the line's start"),
          ("ping_x", "f8", "m", "reference point then, east"),
          ("ping_y", "f8", "m", "north"),
          ("ping_depth", "f8", "m", "below the still surface"),
          ("ping_roll", "f8", "rad", "starboard down"),
          ("ping_pitch", "f8", "rad", "bow up"),
          ("ping_heading", "f8", "rad", "clockwise from north"),
          ("head_sound_speed", "f8", "m/s", "at the arrays, by the head's own sensor")),
    *rows("ping", _PING, False,
          ("tide", "f8", "m", "water level above the datum, by which depths below the surface were reduced"),
          ("true_tide", "f8", "m", "water level above the datum, as the echoes met it"),
          ("ping_height", "f8", "m", "reference point above the ellipsoid, as satellites place it"),
          ("separation", "f8", "m", "vertical datum above the ellipsoid, as used"),
          ("true_separation", "f8", "m", "vertical datum above the ellipsoid, where the bed truly lies below it")),
    *rows("ping", _PING, False,
          ("normal_incidence_db", "f8", "dB re 1", "strength at normal incidence that angle corrections assume: BSn"),
          ("oblique_incidence_db", "f8", "dB re 1", "at oblique incidence, without Lambert's law: BSo"),
          ("crossover_angle", "f8", "rad", "incidence between the two"),
          ("written_gain_db", "f8", "dB", "gain step of the operator, in written strengths")),
    *rows("ping", _PING, False, ("head", "i4", "1", "number of the receiving head where there are several")),
    *rows("sector", _SECTOR, True,
          ("sector_frequency", "f8", "Hz", "middle of the band"),
          ("sector_delay", "f8", "s", "of the transmission after the ping's first"),
          ("sector_angle", "f8", "rad", "transmit_angle that the sector is steered to"),
          ("sector_pulse_length", "f8", "s", "whole length"),
          ("sector_bandwidth", "f8", "Hz", "of the pulse"),
          ("sector_source_level_db", "f8", "dB re 1 µPa @ 1 m", "on the axis"),
          ("sector_absorption_db", "f8", "dB/m", "that backscatter was corrected with")),
    *rows("sector", ("ping", "transmission", "axis"), False,
          ("sector_offset", "f8", "m", "of a sector's own part of the transmit array from transmit_offset")),
    *rows("sounding", _BEAM, True,
          ("valid", "bool", "1", "whether there is a sounding"),
          ("travel_time", "f8", "s", "from the sector's transmission to the reception, both ways"),
          ("angle", "f8", "rad", "asin(a_r·l_r), positive to starboard: of the receiving beam"),
          ("transmit_angle", "f8", "rad", "asin(a_t·l_t), positive forward: of the transmission"),
          ("sector", "i4", "1", "number of the sector, from 0"),
          ("depth", "f8", "m", "below the still surface"),
          ("x", "f8", "m", "east"),
          ("y", "f8", "m", "north"),
          ("across_track", "f8", "m", "from the reference point, starboard"),
          ("along_track", "f8", "m", "from the reference point, forward")),
    *rows("sounding", _BEAM, False,
          ("detection", "u1", "1", "0 none, 1 by amplitude, 2 by phase"),
          ("quality", "f4", "1", "depth over its spread by detection, as log10: 2 is 1 % (Lurton and Augustin 2010)"),
          ("uncertainty", "f4", "m", "of the depth, standard deviation"),
          ("horizontal_uncertainty", "f4", "m", "of x and y, standard deviation of the distance"),
          ("backscatter_db", "f4", "dB re 1", "bottom backscattering strength; attrs say the corrections"),
          ("written_backscatter_db", "f4", "dB re 1", "backscatter_db as the instrument writes it: with its angle "
                                                      "correction and with written_error_db"),
          ("grazing", "f4", "rad", "at the bed, were it level")),
    *rows("truth", _BEAM, False,
          ("true_depth", "f8", "m", "of the bed at x, y"),
          ("error", "f8", "m", "depth - true_depth: the sum of its causes, the next ones"),
          ("error_detection", "f8", "m", "by the echo's time and the beam's footprint"),
          ("error_refraction", "f8", "m", "by the profile and the head's sound speed used"),
          ("error_motion", "f8", "m", "by what the motion sensors say and where arrays are said to be"),
          ("error_tide", "f8", "m", "by the tide used"),
          ("error_separation", "f8", "m", "by the separation used"),
          ("written_error_db", "f4", "dB", "in written strengths, by what the instrument assumes, and by gain steps"),
          ("footprint_across", "f4", "m", "of the beam, -3 dB, or of the pulse where that is shorter"),
          ("footprint_along", "f4", "m", "of the transmitted beam, -3 dB"),
          ("label", "u4", "1", "instance that most of the echo at the sounding is of; 0 none"),
          ("true_backscatter_db", "f4", "dB re 1", "strength of the seabed's law at the grazing angle there")),
    *rows("truth", ("true_node",), False,
          ("true_cast_depth", "f8", "m", "depth of the nodes of the water's own profile, increasing"),
          ("true_cast_sound_speed", "f8", "m/s", "sound speed there, as the echoes travelled")),
    *rows("column", ("ping", "column_beam"), False,
          ("column_angle", "f8", "rad", "as angle"),
          ("column_sector", "i4", "1", "number of the sector"),
          ("column_start", "f8", "s", "of the first sample, after the sector's transmission"),
          ("column_rate", "f8", "Hz", "samples a second")),
    *rows("column", ("ping", "column_beam", "column_sample"), False,
          ("column_level_db", "f4", "dB re 1 µPa", "echo level; NaN where there is no sample"),
          ("column_recorded_db", "f4", "dB re 1 µPa", "level of the counts that the instrument writes, without gain")),
    *rows("snippet", _PING, False, ("snippet_rate", "f8", "Hz", "samples of snippets a second")),
    *rows("snippet", _BEAM, False, ("snippet_start", "f8", "s", "of the first sample, as of travel_time")),
    *rows("snippet", ("ping", "beam", "snippet_sample"), False,
          ("snippet_db", "f4", "dB re 1", "backscattering strength sample by sample; NaN where there is none"),
          ("written_snippet_db", "f4", "dB re 1", "snippet_db as the instrument writes it")),
])


def variable(name: str, values: np.ndarray) -> xr.Variable:
    """Return a variable of the record, with its dimensions, type, unit and meaning.

    Raises
    ------
    ValueError
        If the values have a wrong number of dimensions.
    """
    return VARIABLES.variable(name, values)


def check(soundings: xr.Dataset, what: str = "the soundings") -> None:
    """Check that a dataset is a line of soundings.

    Raises
    ------
    ValueError
        If a needed variable is missing, or if a variable has wrong dimensions or holds no numbers.
    """
    VARIABLES.check(soundings, what, "mitsonar.soundings")


def as_written(soundings: xr.Dataset) -> xr.Dataset:
    """Return a line with the strengths, snippets and water column that its instrument writes, under their usual names.

    Where a line has no written ones, as a recorded line, it is returned as it is.
    """
    found = {name: written for name, written in _WRITTEN.items() if written in soundings.variables}
    return soundings.drop_vars([name for name in found if name in soundings.variables]).rename(
        {written: name for name, written in found.items()})


def joined(blocks: Iterable[xr.Dataset]) -> xr.Dataset:
    """Join blocks of pings of one line; variables without pings are those of the first block."""
    some = list(blocks)
    if not some:
        raise ValueError("there are no soundings: no ping was given.")
    return xr.concat(some, "ping", data_vars="minimal", coords="minimal", compat="override", join="override",
                     combine_attrs="override")
