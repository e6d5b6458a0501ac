"""A scene like a recorded line: its track, its water, its sounder's settings, and a bed of its own soundings.

    line.all  ->  scene.xml, scene_track.csv, scene_cast.csv, scene_bed.tif, scene_backscatter.csv

The bed is the mean depth of the soundings in a cell, laid straight over cells without any and level beyond the swath's
edges, as far as a beam may see. Its backscatter is the line's own by grazing angle; recorded levels are seldom
calibrated, so its shape is the line's and its level what the recorder said. Settings that a file does not tell, such as
the widths of beams, are those of the preset whose frequencies are nearest.
"""
from __future__ import annotations

import os
from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

import numpy as np
import xarray as xr

from ..hydrography.gridding import gridded
from ..sonar.presets import presets
from ..units import deg_from_radians
from . import geotiff
from .files import FilePath, check_writable, replacing_all
from .like_settings import Settings, settings_of
from .survey_lines import reading
from .survey_lines.places import across_and_along, levelled

__all__ = ["like"]

MOST_CELLS = 4_000_000
ANGLES = np.arange(10.0, 90.1, 2.5)                    # [degrees] of grazing, that strengths are given at
FEWEST = 10                                            # soundings behind a strength
LOUDEST_DB, QUIETEST_DB = -4.0, -70.0                  # of a bed
BEYOND = 0.25                                          # of the depth, that the bed goes on beyond the soundings
AFTER = 5.0                                            # [s] of motion behind the last ping
SHALLOWEST = 0.05                                      # [m] that the sonar may be
REACH = 1.2                                            # of the longest echo


def like(line: FilePath, scene: FilePath, *, cell: float | None = None,
         pings: slice | None = None) -> tuple[str, ...]:
    """Write a scene like a line.

    Parameters
    ----------
    line : str or path
        A file that `mitsonar.read` opens as a line of soundings.
    scene : str or path
        The scene's XML file; what it names is written beside it, under its name.
    cell : float [m] or None
        Of the bed's grid; None: as fine as the soundings are.
    pings : slice or None
        Of the line; None: all.

    Returns
    -------
    tuple of str
        What was written, the scene first.

    Raises
    ------
    ValueError
        If the line cannot be read, has no times and angles, or fewer than two pings; or ``scene`` does not end in .xml.
    FileNotFoundError, PermissionError, OSError
        If a file cannot be read, or written there.
    """
    stem, suffix = os.path.splitext(os.fspath(scene))
    if suffix.lower() != ".xml":
        raise ValueError(f"cannot write {scene}: a scene's name ends in .xml.")
    check_writable(scene)
    soundings = reading.read(line, pings=pings, water_column=False)
    _check(soundings, line)
    settings = settings_of(soundings, presets("multibeam"))
    strengths = _strengths(soundings)
    names = {"track": f"{stem}_track.csv", "cast": f"{stem}_cast.csv", "bed": f"{stem}_bed.tif"}
    if strengths is not None:
        names["backscatter"] = f"{stem}_backscatter.csv"
    inside = {name: os.path.basename(path) for name, path in names.items()}
    texts = {"track": _track(soundings), "cast": _table("depth,sound speed", soundings["cast_depth"].values,
                                                        soundings["cast_sound_speed"].values)}
    if strengths is not None:
        texts["backscatter"] = _table("grazing angle,strength", *strengths)
    with replacing_all((scene, *names.values())) as (whole, *rest):
        parts = dict(zip(names, rest))
        for name, text in texts.items():
            parts[name].write_text(text, encoding="utf-8")
        geotiff.write(_bed(soundings, cell), parts["bed"])
        whole.write_text(_scene(soundings, settings, inside, os.path.basename(os.fspath(line))), encoding="utf-8")
    return (os.fspath(scene), *names.values())


def _check(soundings, line):
    """Refuse what makes no scene."""
    if soundings.sizes["ping"] < 2:
        raise ValueError(f"{line} has {soundings.sizes['ping']} ping; a track takes two or more.")
    valid = soundings["valid"].values
    if not np.isfinite(soundings["travel_time"].values[valid]).any() or not np.isfinite(
            soundings["angle"].values[valid]).any():
        raise ValueError(f"{line} has no travel times and angles, so that nothing is known of its beams.")


def _table(head, *columns):
    return "\n".join((head, *(",".join(f"{value:.6g}" for value in row) for row in zip(*columns)))) + "\n"


def _track(soundings: xr.Dataset) -> str:
    """Give the way of the transmit array, about the time of the pings: the reference point may be out of the water."""
    sent, time = soundings["ping_time"].values, soundings["motion_time"].values
    around = {name: soundings[f"motion_{name}"].values for name in ("x", "y", "depth", "roll", "pitch", "heading")}
    if time.size < 2 or time[0] > sent[0] + 1 or time[-1] < sent[-1] - 1:       # no motion about the pings
        time, around = sent, {name: soundings[f"ping_{name}"].values for name in around}
    around["heading"] = np.unwrap(around["heading"])
    when = np.concatenate([[sent[0]], time[(time > sent[0]) & (time < sent[-1] + AFTER)]])
    x, y, depth, roll, pitch, heading = (np.interp(when, time, around[name]) for name in (
        "x", "y", "depth", "roll", "pitch", "heading"))
    arm = levelled(soundings["transmit_offset"].values, roll, pitch)
    x, y = across_and_along(x, y, heading, arm[:, 1], arm[:, 0])
    depth = np.maximum(depth + arm[:, 2], SHALLOWEST)
    rows = zip(when - sent[0], x, y, -depth, *(deg_from_radians(one) for one in (
        roll, pitch, heading)))
    return "time,x,y,z,roll_deg,pitch_deg,heading_deg\n" + "".join(
        ",".join(f"{value:.5f}" for value in row) + "\n" for row in rows)


def _bed(soundings: xr.Dataset, cell: float | None) -> xr.Dataset:
    """Lay the soundings on a grid without holes, with a margin."""
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
        straight = LinearNDInterpolator(points, grid["depth"].values[known])(columns, rows)
        values = np.where(np.isfinite(straight) & ~known, straight, values)
    values = np.where(away * cell > margin, np.nan, values)
    return grid[["depth"]].assign(depth=(("y", "x"), values.astype(np.float32), grid["depth"].attrs))


def _strengths(soundings: xr.Dataset) -> tuple[np.ndarray, np.ndarray] | None:
    """Give grazing angles [degrees] and the median strength [dB] about them; None where there is none."""
    if "backscatter_db" not in soundings:
        return None
    level = soundings["backscatter_db"].values
    grazing = 90.0 - np.abs(deg_from_radians(np.arctan2(
        soundings["across_track"].values, soundings["depth"].values - soundings["ping_depth"].values[:, None])))
    some = np.isfinite(level) & np.isfinite(grazing)
    found = [(angle, np.median(level[near])) for angle in ANGLES
             if (near := some & (np.abs(grazing - angle) <= 1.25)).sum() >= FEWEST]
    if len(found) < 3:
        return None
    angles, strengths = np.array(found).T
    return angles, np.clip(strengths, QUIETEST_DB, LOUDEST_DB)


def _scene(soundings: xr.Dataset, settings: Settings, files: dict[str, str], line: str) -> str:
    """Write the scene."""
    speed = float(np.median(soundings["head_sound_speed"].values))
    depth = settings.head_depth
    longest = float(np.nanmax(soundings["travel_time"].values))
    reach = 0.5 * speed * max(min(REACH * longest, 0.98 / settings.ping_rate), 1.01 * longest)
    bsdf = _element("string", "filename", "$backscatter") if "backscatter" in files else _element("float", "mu_db", -24)
    defaults = [*files.items(), ("pings", settings.pings), ("range", f"{reach:.5g}"), ("preset", settings.preset)]
    sensor = [_element("string", "preset", "$preset"), *(_element(*row) for row in settings.rows),
              _element("string", "track", "$track"), _element("integer", "pings", "$pings"),
              _element("float", "ping_rate_hz", f"{settings.ping_rate:.6g}")]
    water = [_element("string", "cast", "$cast"), _element("float", "head_sound_speed", f"{speed:.6g}"),
             _element("float", "head_depth", f"{max(depth, 0.0):.5g}")]
    origin = soundings.attrs.get("origin")
    local = [] if origin is None else [_element("string", "local_origin", f"{origin[0]:.10g}, {origin[1]:.10g}")]
    return "\n".join((
        '<?xml version="1.0" encoding="utf-8"?>',
        f"<!-- Like {line.replace('--', '- -')}: {soundings.attrs['sonar']}, {soundings.attrs['start']}. -->",
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


def _element(kind, name, value):
    return f'<{kind} name="{name}" value={quoteattr(str(value))}/>'


def _indented(lines: Sequence[str], depth: int) -> list[str]:
    return ["    " * depth + line for line in lines]
