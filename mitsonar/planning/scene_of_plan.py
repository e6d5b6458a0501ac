"""Scene of a survey plan: a multibeam sonar that sails the planned lines over their bed.

Its way points are the starts and ends of all lines over known bed, in the order of sailing, without turns. Its
parameter ``line`` chooses one line. If the way between lines leaves the known bed, the scene sails the longest line
unless another is chosen. A line that crosses a hole of the bathymetry keeps its longest piece. All lines have the same
scatterers.

`write_sweep` writes the plan of a sweep that sounds all lines, each into a file.
"""
from __future__ import annotations

import json
import os
import textwrap
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath, checked_suffix, replacing
from mitsonar.io.scene_files.portable import beside
from mitsonar.sonar.preset_tables import presets
from mitsonar.units import KNOT

from .plan import SurveyLine, SurveyPlan

ROOM = 1.25                        # range of the film, in slant ranges of the farthest beam
FIRST_PINGS = 200
MOST_PINGS = 1_000_000             # of a sensor
WHOLE = 0.999                      # least weight of known nodes around a point
DEFAULT_PRESET = "shallow_400khz"


@dataclass(frozen=True, kw_only=True)
class BedFile:
    """Input files of a plan; without a bathymetry the bed is level, without a cast the sound speed is 1500 m/s."""

    bathymetry: str | None = None
    vertical: str = "auto"
    resolution: float | None = None
    crs: str | None = None
    cast: str | None = None


def write(plan: SurveyPlan, path: FilePath, frame: Frame, files: BedFile) -> None:
    """Write the scene of a plan."""
    check(path)
    root = _scene(plan, frame, files, os.path.dirname(os.path.abspath(path)))
    ElementTree.indent(root, "    ")
    with replacing(path) as temporary:
        temporary.write_text(f"{ElementTree.tostring(root, encoding='unicode')}\n", encoding="utf-8")


def write_sweep(plan: SurveyPlan, path: FilePath, scene: FilePath) -> None:
    """Write the plan of a sweep that sounds all lines of a scene that `write` has made."""
    check(path, ".toml")
    lines = textwrap.fill(", ".join(map(str, _sailed(plan))), 100, initial_indent="    ", subsequent_indent="    ")
    name = os.path.relpath(os.path.abspath(scene), os.path.dirname(os.path.abspath(path)))
    text = (f'scene = {json.dumps(name)}\n'
            'output = "line_{line:04}.nc"                       # or .gsf, .kmall, .s7k, .csv, .las\n\n'
            f'[set]\npings = {MOST_PINGS}                                    # to the end of each line\n\n'
            f'[grid]\nline = [\n{lines}\n]\n\n'
            '[soundings]                                        # profile, tide, separation, heights, ...\n')
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def check(path: FilePath, suffix: str = ".xml") -> None:
    """Raise `ValueError` if a name has another suffix."""
    checked_suffix(path, (suffix,), what="the scene" if suffix == ".xml" else "the plan of the sweep")


def _sailed(plan: SurveyPlan) -> dict[int, np.ndarray]:
    """Return the ends (2, 2) of the lines over known bed by their numbers."""
    lines = {line.number: ends for line in plan.sailed if (ends := _over_bed(plan, line)) is not None}
    if not lines:
        raise ValueError("no planned line lies over a bed of known depth; plan lines over surveyed bed.")
    return lines


def _scene(plan: SurveyPlan, frame: Frame, files: BedFile, folder: str) -> ElementTree.Element:
    origin = np.asarray(frame.origin) if files.bathymetry is not None else np.zeros(2)
    lines = _sailed(plan)
    places = np.concatenate(list(lines.values()))
    joined = bool(_known(plan, _between(plan, places)).all())
    root = ElementTree.Element("scene", {"version": "3.0.0"})
    notes = [f" {'All planned lines' if joined else 'The longest planned line'}. -D line=N sails one:",
             *(f"         line {number}: {_points(ends + origin)}" for number, ends in lines.items())]
    # two hyphens would end the comment
    root.append(ElementTree.Comment("\n".join(notes).replace("--", "- -") + " "))
    longest = max(lines, key=lambda number: float(np.hypot(*(lines[number][1] - lines[number][0]))))
    texts = [_points(lines[line.number] + origin) if line.number in lines else "" for line in plan.sailed]
    for name, value in (("line", 0 if joined else longest), ("waypoints", " | ".join(texts)), ("pings", FIRST_PINGS),
                        ("rays", 100_000)):
        _add(root, "default", name, value)
    integrator = ElementTree.SubElement(root, "integrator", {"type": "sonar_path"})
    _add(integrator, "integer", "rays", "$rays")
    _add(integrator, "integer", "ground_seed", 0)
    _sensor(root, plan, files, folder)
    _add(ElementTree.SubElement(root, "bsdf", {"type": "lambert", "id": "sand"}), "float", "mu_db", -25)
    bed = ElementTree.SubElement(root, "shape", {"type": "seabed" if files.bathymetry is None else "bathymetry",
                                                 "id": "seabed"})
    if files.bathymetry is None:
        reach = np.abs([*plan.bed.x[[0, -1]], *plan.bed.y[[0, -1]]]) + float(plan.rays.reach.max()) + 50
        for name, value in (("depth", plan.depths[0]), ("length", 2 * reach[2:].max()), ("width", 2 * reach[:2].max()),
                            ("spacing", max(plan.bed.step))):
            _add(bed, "float", name, f"{value:.3f}")
    else:
        _add(bed, "string", "filename", beside(files.bathymetry, folder))
        _add(bed, "string", "vertical", files.vertical)
        if files.crs is not None:
            _add(bed, "string", "crs", files.crs)
        if files.resolution is not None:
            _add(bed, "float", "resolution", files.resolution)
    ElementTree.SubElement(bed, "ref", {"id": "sand"})
    return root


def _sensor(root: ElementTree.Element, plan: SurveyPlan, files: BedFile, folder: str) -> None:
    sonar = plan.sonar
    sensor = ElementTree.SubElement(root, "sensor", {"type": "multibeam", "id": "sonar"})
    preset = sonar.name if sonar.name in presets("multibeam") else DEFAULT_PRESET
    beams = max(sonar.beams // int(presets("multibeam")[preset]["swaths"]), 2)
    for row in (("string", "preset", preset), ("float", "swath_deg", round(float(np.rad2deg(sonar.swath)), 6)),
                ("string", "beam_spacing", sonar.even), ("integer", "beams", beams),
                ("string", "waypoints", "$waypoints"), ("integer", "line", "$line"),
                ("boolean", "georeferenced", "true" if files.bathymetry is not None else "false"),
                ("float", "turn_radius", 0), ("float", "depth", sonar.head_depth),
                ("float", "speed_knots", round(plan.layout.speed / KNOT, 6)), ("integer", "pings", "$pings")):
        _add(sensor, *row)
    if np.isfinite(sonar.rate):
        _add(sensor, "float", "ping_rate_hz", sonar.rate)
    water = ElementTree.SubElement(sensor, "medium", {"type": "seawater", "id": "water"})
    if files.cast is not None:
        _add(water, "string", "cast", beside(files.cast, folder))
    else:
        _add(water, "float", "sound_speed", 1500)
    film = ElementTree.SubElement(sensor, "film", {"type": "sonar_film"})
    swaths = [line.track.edges for line in plan.sailed]
    reach = max(float(side.max()) for swath in swaths for side in (swath.port, swath.starboard))
    _add(film, "float", "range", f"{min(ROOM * float(np.hypot(reach, plan.depths[2])), sonar.max_range):.1f}")


def _over_bed(plan: SurveyPlan, line: SurveyLine) -> np.ndarray | None:
    """Return the ends (2, 2) of the longest piece of a line over known bed, or None."""
    along = _between(plan, np.stack([line.start, line.end]))
    edges = np.flatnonzero(np.diff(np.r_[False, _known(plan, along), False].astype(int))).reshape(-1, 2)
    if not edges.size:
        return None
    begin, end = edges[np.argmax(np.diff(edges, axis=1))]
    return along[[begin, end - 1]] if end - begin > 1 else None


def _between(plan: SurveyPlan, places: np.ndarray) -> np.ndarray:
    """Return points (P, 2) every half node along the straight ways between places."""
    return np.concatenate([np.linspace(start, end, 2 + int(2 * np.hypot(*(end - start)) / min(plan.bed.step)))
                           for start, end in zip(places, places[1:])])


def _known(plan: SurveyPlan, places: np.ndarray) -> np.ndarray:
    """Return a mask of the places where the bed is known all around and deeper than the sonar's head."""
    from scipy.ndimage import map_coordinates

    bed = plan.bed
    weight = map_coordinates(bed.known.astype(np.float32), bed.places(*places.T), order=1, mode="constant")
    return (weight > WHOLE) & (bed.depth_at(*places.T) > plan.sonar.head_depth)


def _points(places: np.ndarray) -> str:
    return ", ".join(f"{x:.3f} {y:.3f}" for x, y in places)


def _add(parent: ElementTree.Element, tag: str, name: str, value: object) -> None:
    ElementTree.SubElement(parent, tag, {"name": name, "value": str(value)})
