"""Scene after a recorded line: its track, its water, its sonar settings, and a bed of its soundings.

    line.all  ->  scene.xml, scene_track.csv, scene_cast.csv, scene_bed.tif, scene_backscatter.csv, scene_pattern.csv

Of several casts, each is a file, scene_cast_2.csv and so on, and scene_casts.csv is their list: a ping has the latest
one, as the sounder had.

The bed is the mean depth of the soundings in a cell, interpolated over empty cells and continued level beyond the edges
of the swath as far as a beam may reach. The track is the recorded motion, smoothed by least-squares splines with a knot
every half second (`survey_lines.motion.smoothed`), with the dates of the line. The water takes the head's sound speed
as a node if the line's soundings were made so (`instrument_rules`). The bed's backscatter is the line's, by grazing
angle; recorded levels are seldom calibrated, so only its shape is reliable. Where strengths of a sector or a side
differ from that curve by a decibel or more, the differences are the pattern with which the sonar writes strengths.
Settings that the file lacks, such as beam widths, are those of the preset with the nearest frequencies.
"""
from __future__ import annotations

import os
import re
from collections.abc import Callable, Sequence
from datetime import datetime, timedelta, timezone
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath, check_writable, replacing_all
from mitsonar.hydrography.gridding import gridded
from mitsonar.io.records import geotiff
from mitsonar.io.survey_lines import reading
from mitsonar.io.survey_lines.assembly import LineCast
from mitsonar.io.survey_lines.motion import smoothed
from mitsonar.io.survey_lines.places import across_and_along, levelled
from mitsonar.sonar.preset_tables import classes
from mitsonar.units import db_from_power, deg_from_radians, power_from_db

from .instrument_rules import rules_of
from .like_settings import Settings, settings_of

MOST_CELLS = 4_000_000
WIDE, NARROW = 1.25, 0.5                               # [degrees] about a grazing angle of the strength table
ANGLES = ([(angle, (WIDE,)) for angle in np.arange(10.0, 79.0, 2.5)]          # with their widths; near nadir strengths
          + [(angle, (NARROW, WIDE)) for angle in np.arange(80.0, 90.1)])     # may change by 3 dB a degree
ALIKE = 9                                              # soundings over which a bed's slope is taken
PATTERN_STEP, LEAST_PATTERN = 5.0, 1.0                  # [degrees], [dB]: the largest difference of a pattern worth it
FEWEST = 10                                            # soundings per strength
LOUDEST_DB, QUIETEST_DB = -4.0, -70.0                  # limits of a bed strength
BEYOND = 0.25                                          # share of the depth by which the bed exceeds the soundings
AROUND = 5.0                                           # [s] of motion before the first ping and after the last
LISTENS = 0.9                                          # share of the ping interval that the track adds at its end
STEP, WAY_STEP = 0.5, 2.0                              # [s] between spline knots: of attitude and depth, of position
EVERY = 0.1                                            # [s] between records of the track
NAMES = ("x", "y", "depth", "roll", "pitch", "heading")
NOT_TAKEN = ("pulse forms, depth modes and other settings of the run, the antenna's lever arm and tides are not in the "
             "scene")
SHALLOWEST = 0.05                                      # [m]: least depth of the sonar
REACH = 1.2                                            # times the longest echo


def like(line: FilePath, scene: FilePath, *, cell: float | None = None,     # [m]
         pings: slice | None = None, say: Callable[[str], object] | None = None) -> tuple[str, ...]:
    """Write a scene after a recorded line, and return the paths of all files written."""
    stem, suffix = os.path.splitext(os.fspath(scene))
    if suffix.lower() != ".xml":
        raise ValueError(f"cannot write {scene}: a scene's name ends in .xml.")
    check_writable(scene)
    soundings = reading.read(line, pings=pings, water_column=False)
    _check(soundings, line)
    settings = settings_of(soundings, classes("multibeam"))
    rules, of_mode = rules_of(soundings), soundings.isel(ping=settings.chosen)
    strengths = _strengths(of_mode)
    pattern = None if strengths is None else _pattern(of_mode, settings, *strengths)
    track, smoothing = _track(soundings, settings.ping_rate)
    words = (*settings.words, *(text for text in (str(soundings.attrs.get("left_out", "")), smoothing) if text),
             *rules.words, NOT_TAKEN)
    names = {"track": f"{stem}_track.csv", "cast": f"{stem}_cast.csv", "bed": f"{stem}_bed.tif"}
    if strengths is not None:
        names["backscatter"] = f"{stem}_backscatter.csv"
    if pattern is not None:
        names["pattern"] = f"{stem}_pattern.csv"
    several = _several_casts(line)
    if several:
        names |= {f"cast_{k}": f"{stem}_cast_{k}.csv" for k in range(2, len(several) + 1)}
        names["casts"] = f"{stem}_casts.csv"
    inside = {name: os.path.basename(path) for name, path in names.items()}
    texts = {"track": track, "cast": _table("depth,sound speed", soundings["cast_depth"].values,
                                            soundings["cast_sound_speed"].values)}
    if several:
        kinds = ["cast", *(f"cast_{k}" for k in range(2, len(several) + 1))]
        texts |= {kind: _table("depth,sound speed", *one.nodes.T) for kind, one in zip(kinds, several)}
        texts["casts"] = "file,time\n" + "".join(
            f"{inside[kind]},{datetime.fromtimestamp(one.time, timezone.utc):%Y-%m-%dT%H:%M:%S.%f}Z\n"
            for kind, one in zip(kinds, several))
    if strengths is not None:
        texts["backscatter"] = _table("grazing angle,strength", *strengths)
    if pattern is not None:
        texts["pattern"] = _table("sector,angle,level", *pattern.T)
    with replacing_all((scene, *names.values())) as (scene_file, *rest):
        parts = dict(zip(names, rest))
        for name, text in texts.items():
            parts[name].write_text(text, encoding="utf-8")
        geotiff.write(_bed(soundings, cell), parts["bed"])
        scene_file.write_text(_scene(soundings, settings, inside, os.path.basename(os.fspath(line)), words, rules.node),
                              encoding="utf-8")
    if say is not None:
        for text in words:
            say(text)
    return (os.fspath(scene), *names.values())


def _several_casts(line: FilePath) -> list[LineCast]:
    """Return the casts of a line in the order of time, if it has several different ones; none if it has one."""
    kept: list[LineCast] = []
    for one in sorted(reading.line_casts(line), key=lambda cast: cast.time):
        if kept and kept[-1].time == one.time:
            kept.pop()
        if not kept or not np.array_equal(kept[-1].nodes, one.nodes):
            kept.append(one)
    return kept if len(kept) > 1 else []


def _check(soundings, line):
    """Raise `ValueError` if the line cannot make a scene."""
    if soundings.sizes["ping"] < 2:
        raise ValueError(f"{line} has {soundings.sizes['ping']} ping; a track takes two or more.")
    valid = soundings["valid"].values
    if not np.isfinite(soundings["travel_time"].values[valid]).any() or not np.isfinite(
            soundings["angle"].values[valid]).any():
        raise ValueError(f"{line} has no travel times or no angles, which a scene needs; choose another line.")


def _table(head, *columns):
    return "\n".join((head, *(",".join(f"{value:.6g}" for value in row) for row in zip(*columns)))) + "\n"


def _track(soundings: xr.Dataset, ping_rate: float) -> tuple[str, str]:
    """Return the track of the transmit array from the first ping to the last echo, and a clause on its smoothing.

    The reference point may be above the water. Pings outside the motion records have their own positions.
    """
    sent, time = soundings["ping_time"].values, soundings["motion_time"].values
    inside = (time > sent[0] - AROUND) & (time < sent[-1] + AROUND)
    alone = np.unique(sent, return_index=True)[1]
    if inside.sum() > 1:
        alone = alone[(sent[alone] < time[inside][0]) | (sent[alone] > time[inside][-1])]
    times = np.concatenate([time[inside], sent[alone]])
    order = np.argsort(times, kind="stable")
    values = np.concatenate([np.stack([soundings[f"{source}_{name}"].values[used] for name in NAMES], -1)
                             for source, used in (("motion", inside), ("ping", alone))])[order]
    times, values[:, 5] = times[order], np.unwrap(values[:, 5])
    interval, end = float(np.median(np.diff(times))), sent[-1] + LISTENS / ping_rate
    splines = [(columns, smoothed(times, values[:, columns], max(step, interval), end))
               for columns, step in ((slice(0, 2), WAY_STEP), (slice(2, 6), STEP))]
    residual = np.sqrt(np.mean((np.concatenate([spline(times) for _, spline in splines], -1) - values) ** 2, axis=0))
    when = np.linspace(sent[0], end, 1 + int(np.ceil((end - sent[0]) / EVERY)))
    x, y, depth, roll, pitch, heading = np.concatenate([spline(when) for _, spline in splines], -1).T
    arm = levelled(soundings["transmit_offset"].values, roll, pitch)
    x, y = across_and_along(x, y, heading, arm[:, 1], arm[:, 0])
    depth = np.maximum(depth + arm[:, 2], SHALLOWEST)
    start = datetime.fromisoformat(str(soundings.attrs["start"]).removesuffix("Z"))
    rows = zip(when, x, y, -depth, *map(deg_from_radians, (roll, pitch, heading)))
    text = "time,x,y,z,roll_deg,pitch_deg,heading_deg\n" + "".join(
        ",".join([f"{(start + timedelta(seconds=row[0])).isoformat(timespec='microseconds')}Z",
                  *(f"{value:.5f}" for value in row[1:])]) + "\n" for row in rows)
    angles = ", ".join(f"{value:.2g}" for value in deg_from_radians(residual[3:]))
    return text, (f"the track is the recorded motion, {times.size} records {interval:.2g} s apart, smoothed by splines "
                  f"with a knot every {STEP:g} s (positions: {WAY_STEP:g} s); this removes "
                  f"{np.hypot(*residual[:2]):.2g} m of position, {residual[2]:.2g} m of depth and {angles} degrees of "
                  "roll, pitch and heading (rms)")


def _bed(soundings: xr.Dataset, cell: float | None) -> xr.Dataset:
    """Return the soundings on a grid without holes, with a margin."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.ndimage import distance_transform_edt

    valid = soundings["valid"].values
    x, y, depth = (soundings[name].values[valid] for name in ("x", "y", "depth"))
    margin = BEYOND * float(np.median(depth)) + 2.0
    width, height = np.ptp(x) + 2 * margin, np.ptp(y) + 2 * margin
    if cell is None:
        swath = float(np.nanmax(soundings["across_track"].values) - np.nanmin(soundings["across_track"].values))
        sailed = np.hypot(*(np.diff(soundings[name].values) for name in ("ping_x", "ping_y"))).sum()
        cell = float(np.sqrt(max(swath * max(sailed, 1.0), 1.0) / x.size)) * 1.5
    cell = float(f"{max(cell, np.sqrt(width * height / MOST_CELLS)):.2g}")
    origin = soundings.attrs.get("origin") or (0.0, 0.0)
    west, south = x.min() - margin + origin[0], y.min() - margin + origin[1]
    grid = gridded(soundings, cell, bounds=(west, south, west + width, south + height))
    known = np.isfinite(grid["depth"].values)
    columns, rows = np.meshgrid(np.arange(known.shape[1]), np.arange(known.shape[0]))
    away, (row, column) = distance_transform_edt(~known, return_indices=True)
    values = grid["depth"].values[row, column]
    points = np.column_stack([columns[known], rows[known]])
    if min(np.ptp(points, axis=0)) > 0:
        linear = LinearNDInterpolator(points, grid["depth"].values[known])(columns, rows)
        values = np.where(np.isfinite(linear) & ~known, linear, values)
    values = np.where(away * cell > margin, np.nan, values)
    return grid[["depth"]].assign(depth=(("y", "x"), values.astype(np.float32), grid["depth"].attrs))


def _strengths(soundings: xr.Dataset) -> tuple[np.ndarray, np.ndarray] | None:
    """Return grazing angles [degrees] and the strength [dB] near each, or None without enough echoes.

    It is that of the mean intensity, as a law's is: soundings of few looks have a median some decibels lower.
    """
    if "backscatter_db" not in soundings:
        return None
    level, grazing = soundings["backscatter_db"].values, _grazing(soundings)
    usable = np.isfinite(level) & np.isfinite(grazing)
    rows = []
    for angle, widths in ANGLES:
        near = (usable & (np.abs(grazing - angle) <= width) for width in widths)
        if (some := next((part for part in near if part.sum() >= FEWEST), None)) is not None:
            rows.append((angle, db_from_power(float(np.mean(power_from_db(level[some]))))))
    if len(rows) < 3:
        return None
    angles, strengths = np.array(rows).T
    return angles, np.clip(strengths, QUIETEST_DB, LOUDEST_DB)


def _vertical(soundings: xr.Dataset) -> np.ndarray:
    """Return the angles of soundings from the vertical [degrees], positive to starboard."""
    return deg_from_radians(np.arctan2(soundings["across_track"].values,
                                       soundings["depth"].values - soundings["ping_depth"].values[:, None]))


def _grazing(soundings: xr.Dataset) -> np.ndarray:
    """Return the grazing angles [degrees] on the bed as it slopes across the track, over `ALIKE` soundings."""
    from scipy.ndimage import uniform_filter1d

    found = 90.0 - np.abs(_vertical(soundings))
    valid = soundings["valid"].values
    for ping in np.flatnonzero(valid.sum(1) >= ALIKE):
        there = np.flatnonzero(valid[ping])
        there = there[np.argsort(soundings["across_track"].values[ping, there], kind="stable")]
        across, depth = (uniform_filter1d(soundings[name].values[ping, there], ALIKE, mode="nearest")
                         for name in ("across_track", "depth"))
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = np.nan_to_num(np.gradient(depth) / np.gradient(across), posinf=0.0, neginf=0.0)
        found[ping, there] = 90.0 - np.abs(_vertical(soundings.isel(ping=[ping]))[0, there]
                                           + deg_from_radians(np.arctan(slope)))
    return found


def _pattern(soundings: xr.Dataset, settings: Settings, angles: np.ndarray,
             strengths: np.ndarray) -> np.ndarray | None:
    """Return rows (N, 3): sector, angle [degrees], strengths less those of the bed's curve [dB]; None if all are small.

    A second swath has the sectors of the first one.
    """
    level, vertical, sector = soundings["backscatter_db"].values, _vertical(soundings), soundings["sector"].values
    rest = level - np.interp(_grazing(soundings), angles, strengths)
    usable = np.isfinite(rest) & soundings["valid"].values
    rows = [(k, middle, db_from_power(float(np.mean(power_from_db(rest[near])))))
            for k, number in enumerate(settings.sectors) for middle in np.arange(-87.5, 90.0, PATTERN_STEP)
            if (near := usable & (sector == number) & (np.abs(vertical - middle) <= PATTERN_STEP / 2)).sum() >= FEWEST]
    if not rows or np.abs(np.array(rows)[:, 2]).max() < LEAST_PATTERN:
        return None
    pattern = np.array(rows)
    return np.concatenate([pattern + (swath * len(settings.sectors), 0, 0) for swath in range(settings.swaths)])


def _scene(soundings: xr.Dataset, settings: Settings, files: dict[str, str], line: str, notes: Sequence[str],
           node: bool) -> str:
    """Return the XML of the scene."""
    speed = float(np.median(soundings["head_sound_speed"].values))
    depth = settings.head_depth
    longest = float(np.nanmax(soundings["travel_time"].values))
    reach = 0.5 * speed * max(min(REACH * longest, 0.98 / settings.ping_rate), 1.01 * longest)
    bsdf = _element("string", "filename", "$backscatter") if "backscatter" in files else _element("float", "mu_db", -24)
    inputs = [(name, file) for name, file in files.items()
              if not (name.startswith("cast") and "casts" in files) or name == "casts"]
    defaults = [*inputs, ("pings", settings.pings), ("range", f"{reach:.5g}"), ("preset", settings.preset)]
    sensor = [_element("string", "preset", "$preset"), *(_element(*row) for row in settings.rows),
              _element("string", "track", "$track"), _element("integer", "pings", "$pings"),
              _element("float", "ping_rate_hz", f"{settings.ping_rate:.6g}"),
              _element("boolean", "recorded_column", "true")]
    if "pattern" in files:
        sensor.append(_element("string", "written_pattern", "$pattern"))
    water = [_element("string", "cast", "$cast")]
    if "casts" in files:
        water = [_element("string", "casts", "$casts"), _element("string", "casts_by", "time"),
                 _element("string", "casts_rule", "latest")]
    if node:
        water += [_element("float", "head_sound_speed", f"{speed:.6g}"),
                  _element("float", "head_depth", f"{max(depth, 0.0):.5g}")]
    origin = soundings.attrs.get("origin")
    local = [] if origin is None else [_element("string", "local_origin", f"{origin[0]:.10g}, {origin[1]:.10g}")]
    return "\n".join((
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- Like {_comment(line)}: {soundings.attrs['sonar']}, {soundings.attrs['start']}. -->",
        *(f"<!-- {_comment(text)} -->" for text in notes),
        '<scene version="3.0.0">',
        *(f"    <default name={quoteattr(str(name))} value={quoteattr(str(value))}/>" for name, value in defaults),
        '\n    <integrator type="sonar_path"/>\n', '    <sensor type="multibeam" id="sonar">', *_indented(sensor, 2),
        '        <medium type="seawater" id="water">', *_indented(water, 3), "        </medium>",
        '        <film type="sonar_film">', *_indented([_element("float", "range", "$range")], 3), "        </film>",
        "    </sensor>\n",
        '    <shape type="bathymetry" id="seabed">',
        *_indented([_element("string", "filename", "$bed"), _element("string", "vertical", "depth"),
                    _element("boolean", "smooth_normals", "true"), *local], 2),
        f'        <bsdf type="{"empirical" if "backscatter" in files else "lambert"}" id="bed">',
        *_indented([bsdf], 3), "        </bsdf>", "    </shape>", "</scene>", ""))


def _comment(text):
    """Return a text without double hyphens, which would end an XML comment."""
    return re.sub("-(?=-)", "- ", text)


def _element(kind, name, value):
    return f'<{kind} name="{name}" value={quoteattr(str(value))}/>'


def _indented(lines: Sequence[str], depth: int) -> list[str]:
    return ["    " * depth + line for line in lines]
