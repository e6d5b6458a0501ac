"""Scene with the track of a vehicle's bag: another scene's world and sonar, sailed as the vehicle sailed.

    run.mcap + scene.xml  ->  twin.xml, twin_track.csv

The first sensor of the scene loses its route and takes the track; its ``offset`` remains, the lever arm from the
vehicle's reference point. Files that the scene names are copied to the twin's folder. If the bag has images of a
sonar, the twin pings at their mean rate, from the first to the last.
"""
from __future__ import annotations

import os
import re
from collections.abc import Sequence
from datetime import datetime, timezone
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from mitsonar.device.files import FilePath, checked_suffix, replacing_all
from mitsonar.io.bags import recorded
from mitsonar.io.scene_files import scenes
from mitsonar.io.scene_files.portable import bring
from mitsonar.io.tracks.navigation import Navigation
from mitsonar.plugins import reference
from mitsonar.survey.voyage import MOST_PINGS
from mitsonar.units import deg_from_radians

ROUTE = "Track and motion"         # title of the group of a sensor's attributes that a track replaces


def like_bag(bag: FilePath, like: str, scene: FilePath, *, topic: str | None = None,
             shift: Sequence[float] = (0.0, 0.0, 0.0)) -> tuple[str, ...]:
    """Write a scene like another one with the track of a bag, and return the paths of all files written.

    ``shift`` [m] is the place of the track's origin in the scene: east, north, up.
    """
    checked_suffix(scene, (".xml",), what="the scene")
    path = scenes.find(like)
    root = scenes.root(path)
    sensor = root.find("sensor")
    if sensor is None:
        raise ValueError(f"{like} has no sensor; give a scene with a sonar.")
    above = any(child.get("name") == "altitude" for child in sensor)
    recorded_track = recorded.read_track(bag, topic=topic)
    deep = recorded_track.z is not None
    track = _shifted(recorded_track, shift, above, bag)
    pings, rate = recorded.image_times(bag), 0.0
    if pings.size > 1 and pings[-1] > pings[0]:
        # a little less, so that rounding makes no interval shorter than the echoes
        rate = (pings.size - 1) / (pings[-1] - pings[0]) * (1 - 1e-5)
        track = _between(track, pings[0], pings[-1] + 0.5 / rate, 1 / rate)
    table = f"{os.path.splitext(os.fspath(scene))[0]}_track.csv"
    folder = os.path.dirname(os.path.abspath(scene))
    gone = _route(sensor) - (set() if deep else {"altitude"}) - (set() if rate else {"ping_rate_hz"})
    parameters = {f"${one.get('name')}": one for one in root.iter("default")}
    for child in [child for child in sensor if child.get("name") in gone]:
        value = child.get("value", "")
        if child.get("name") == "pings" and value in parameters:
            parameters[value].set("value", str(MOST_PINGS))        # so that -D pings=N still limits them
        else:
            sensor.remove(child)
    if os.path.dirname(os.path.abspath(path)) != folder:
        bring(root, path, folder, reference.input_files)
    ElementTree.SubElement(sensor, "string", {"name": "track", "value": os.path.basename(table)})
    if rate:
        ElementTree.SubElement(sensor, "float", {"name": "ping_rate_hz", "value": f"{rate:.6g}"})
    root.insert(0, ElementTree.Comment(re.sub("-(?=-)", "- ", f" Track of {os.path.basename(os.fspath(bag))}. ")))
    ElementTree.indent(root, "    ")
    with replacing_all((scene, table)) as (scene_file, track_file):
        scene_file.write_text(f"{ElementTree.tostring(root, encoding='unicode')}\n", encoding="utf-8")
        _write(track, track_file)
    return os.fspath(scene), table


def _route(sensor: ElementTree.Element) -> set[str]:
    """Return the names of a sensor's attributes that a recorded track replaces: its route without the lever arm."""
    kind = sensor.get("type", "")
    groups = [group for group in (reference.declared(kind) if kind in reference.plugins() else ())
              if getattr(group, "title", "") == ROUTE]
    if not groups:
        raise ValueError(f"the scene's first sensor is of the type {kind!r}, which sails no track; give a scene whose "
                         "first sensor is a sonar.")
    return {"pings", *(one.name for one in reference.flat(tuple(groups)))} - {"offset"}


def _shifted(track: Navigation, shift: Sequence[float], above: bool, bag: FilePath) -> Navigation:
    """Return a track in the scene; raise `ValueError` if it is above the sea surface, or has no depth.

    ``above`` is True for a scene that states the height above its bed, which replaces all depths.
    """
    if track.geographic and any(shift[:2]):
        raise ValueError("--shift moves tracks in metres, and this one is in latitude and longitude; give 0 0 UP.")
    if track.z is None and not above and not shift[2] < 0:
        raise ValueError(f"the fixes of {bag} do not say how deep the sonar is; give --shift 0 0 -DEPTH, or a scene "
                         "whose sensor has an altitude.")
    z = (np.zeros(track.time.size) if track.z is None else track.z) + shift[2]
    if z.max() > 0:
        raise ValueError(f"the track of {bag} rises to z = {z.max():.3g} m, above the sea surface; give the place of "
                         "its origin, such as --shift 0 0 -20.")
    return Navigation(**{**vars(track), "x": track.x + shift[0], "y": track.y + shift[1], "z": z})


def _between(track: Navigation, start: float, end: float, most: float) -> Navigation:
    """Return a track between two times [s], continued at both ends by at most ``most`` [s]."""
    start, end = max(start, track.time[0] - most), min(end, track.time[-1] + most)
    if end <= start:
        return track
    time = np.concatenate([[start], track.time[(track.time > start) & (track.time < end)], [end]])
    at = np.clip(np.searchsorted(track.time, time, side="right") - 1, 0, track.time.size - 2)
    share = (time - track.time[at]) / (track.time[at + 1] - track.time[at])
    return Navigation(**{**{name: value[at] + share * (value[at + 1] - value[at])
                            if isinstance(value, np.ndarray) else value for name, value in vars(track).items()},
                         "time": time})


def _write(track: Navigation, path: Path) -> None:
    """Write a track as a table."""
    places = {"longitude": track.x, "latitude": track.y} if track.geographic else {"x": track.x, "y": track.y}
    assert track.z is not None
    columns = {**places, "z": track.z, "roll_deg": deg_from_radians(track.roll),
               "pitch_deg": deg_from_radians(track.pitch),
               **({} if track.heading is None else {"heading_deg": deg_from_radians(track.heading)})}
    digits = {name: 9 if name in ("longitude", "latitude") else 5 for name in columns}
    rows = (",".join([f"{datetime.fromtimestamp(time, timezone.utc):%Y-%m-%dT%H:%M:%S.%f}Z",
                      *(f"{column[number]:.{digits[name]}f}" for name, column in columns.items())])
            for number, time in enumerate(track.time))
    path.write_text("\n".join((",".join(("time", *columns)), *rows)) + "\n", encoding="utf-8")
