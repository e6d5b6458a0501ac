"""Writers of survey lines: CSV, GeoJSON (WGS 84) and GPX.

    line,point,x,y,latitude,longitude
    1,run-in,431000.000,5200000.000,46.951083000,8.093111000

`tracks` reads the CSV file as way points in the order of sailing: the run-in (if any), start and end of every line.
x and y are eastings and northings; latitudes and longitudes follow if the coordinate system is known. GeoJSON has a
line string for each line, GPX a route.
"""
from __future__ import annotations

import csv
import io
import json
from xml.etree import ElementTree

import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath, checked_suffix, replacing

from .plan import SurveyLine, SurveyPlan

FORMATS = (".csv", ".geojson", ".gpx")
_GPX = "http://www.topografix.com/GPX/1/1"
Points = list[tuple[str, np.ndarray]]


def check(path: FilePath, frame: Frame | None = None) -> str:
    """Return the format of a file of lines; `ValueError` if it is unknown, or needs degrees without a system."""
    suffix = checked_suffix(path, FORMATS)
    if suffix != ".csv" and frame is not None and not frame.crs:
        raise ValueError(f"cannot write {path}: it takes latitudes and longitudes, but the bathymetry names no "
                         "coordinate system; give it by --crs, or write a .csv.")
    return suffix


def write(plan: SurveyPlan, path: FilePath, frame: Frame) -> None:
    """Write the lines of a plan."""
    suffix = check(path, frame)
    text = {".csv": _csv, ".geojson": _geojson, ".gpx": _gpx}[suffix](plan, frame)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8", newline="")


def on_earth(frame: Frame, places: np.ndarray) -> np.ndarray:
    """Return latitudes and longitudes (P, 2) [degrees] of points (P, 2) [m]."""
    return np.stack(frame.on_globe(places)[:2], -1)


def _points(line: SurveyLine) -> Points:
    """Return the named way points of a line."""
    run_in = [] if np.array_equal(line.run_in, line.start) else [("run-in", line.run_in)]
    return [*run_in, ("start", line.start), ("end", line.end)]


def _csv(plan, frame):
    rows = [(line.number, name, place) for line in plan.sailed for name, place in _points(line)]
    places = np.array([place for _, _, place in rows])
    degrees = on_earth(frame, places) if frame.crs else None
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    crossed = [line.number for line in plan.cross_lines]
    table.writerow(["line", "point", "x", "y", *(["latitude", "longitude"] if degrees is not None else []),
                    *(["kind"] if crossed else [])])
    for number, ((line, name, _), (x, y)) in enumerate(zip(rows, places + frame.origin)):
        globe = [] if degrees is None else [f"{value:.9f}" for value in degrees[number]]
        kind = ["cross" if line in crossed else "main"] if crossed else []
        table.writerow([line, name, f"{x:.3f}", f"{y:.3f}", *globe, *kind])
    return text.getvalue()


def _geojson(plan, frame):
    features = []
    for line in plan.sailed:
        degrees = on_earth(frame, np.stack([line.start, line.end]))
        width, depth = line.track.edges.width, line.track.depth
        features.append({
            "type": "Feature",
            "properties": {"line": line.number, "kind": "cross" if line in plan.cross_lines else "main",
                           "heading_deg": round(float(np.rad2deg(line.heading)), 3),
                           "length_m": round(line.length, 2), "mean_depth_m": round(float(depth.mean()), 2),
                           "mean_swath_m": round(float(width.mean()), 2)},
            "geometry": {"type": "LineString",
                         "coordinates": [[round(float(value), 9) for value in place[::-1]] for place in degrees]}})
    return json.dumps({"type": "FeatureCollection", "features": features}, indent=1, allow_nan=False) + "\n"


def _gpx(plan, frame):
    root = ElementTree.Element("gpx", {"version": "1.1", "creator": "mitsonar", "xmlns": _GPX})
    for line in plan.sailed:
        route = ElementTree.SubElement(root, "rte")
        ElementTree.SubElement(route, "name").text = f"{'cross ' if line in plan.cross_lines else ''}line {line.number}"
        ElementTree.SubElement(route, "number").text = str(line.number)
        points = _points(line)
        for (name, _), (latitude, longitude) in zip(points, on_earth(frame, np.array([place for _, place in points]))):
            point = ElementTree.SubElement(route, "rtept", {"lat": f"{latitude:.9f}", "lon": f"{longitude:.9f}"})
            ElementTree.SubElement(point, "name").text = f"{line.number} {name}"
    ElementTree.indent(root)
    return f"<?xml version='1.0' encoding='UTF-8'?>\n{ElementTree.tostring(root, encoding='unicode')}\n"
