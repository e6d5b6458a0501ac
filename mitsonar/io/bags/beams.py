"""Directions of a record's beams, and the frame of its sonar, by the coordinates that the record has.

    fan             û = n cos ψ + a sin ψ: z along n, y along a                 (beams ahead: x up, y starboard)
    rotating head   z along bearing 0, y where it turns; the beam moves from ping to ping
    others          z down, y starboard, x forward

A multibeam steadies its beams: their directions are those in a level body, and are turned into the rolling one.
"""
from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np
import xarray as xr

from mitsonar.device.rotations import mounting_matrix, rotation_matrix
from mitsonar.sonar.motion.rotating_head import MOUNTS
from mitsonar.sonar.preset_tables import TABLES, presets
from mitsonar.units import radians_from_deg

from . import axes

# attributes of a sensor: width of what it transmits, across the beams, and of what it receives, by kind of sonar
WIDTHS = {"multibeam": ("transmit_beam_width_deg", "receive_beam_width_deg"),
          "echo_sounder": ("beam_width_deg", "beam_width_deg")}
OTHER_WIDTHS = "vertical_beam_width_deg", "beam_width_deg"


@dataclass(frozen=True, kw_only=True, eq=False)
class SonarBeams:
    """Frame of a sonar in its body, and the directions of its beams there."""

    frame: np.ndarray  # (3, 3): columns x, y, z in the body's frame
    directions: Callable[[xr.Dataset], np.ndarray]  # of a record of one ping: (B, 3), body frame
    offset: np.ndarray  # (3,) [m]: from the reference point, body frame


def beams_of(record: xr.Dataset) -> SonarBeams:
    """Return the beams of an image or of soundings."""
    nowhere = np.zeros(3)
    if "transmit_mounting" in record:
        frame = mounting_matrix(*record["transmit_mounting"].values) @ axes.BELOW
        return SonarBeams(frame=frame, directions=_cones, offset=np.asarray(record["transmit_offset"].values, float))
    if "beam_x" in record.coords:
        fixed = np.stack([np.asarray(record[f"beam_{axis}"].values, float) for axis in "xyz"], -1)
        angle = np.asarray(record["bearing" if "bearing" in record.coords else "beam"].values, float)
        level = record.attrs.get("sonar") == "multibeam"

        def directions(ping: xr.Dataset) -> np.ndarray:
            return fixed @ _levelled(ping) if level else fixed
        return SonarBeams(frame=_fan_frame(fixed, angle), directions=directions, offset=nowhere)
    if "bearing" in record.coords:
        columns, sign = MOUNTS[str(record.attrs.get("mount", "down"))]
        ahead, aside = columns[:, 0], sign * columns[:, 1]
        tilt = float(record.attrs.get("tilt", 0.0))

        def turned(ping: xr.Dataset) -> np.ndarray:
            bearing = float(ping["bearing"].values.reshape(-1)[0])
            across = np.cos(bearing) * ahead + np.sin(bearing) * aside
            return (np.cos(tilt) * across + np.sin(tilt) * columns[:, 2])[None]
        return SonarBeams(frame=np.stack([np.cross(aside, ahead), aside, ahead], -1), directions=turned, offset=nowhere)
    if "side" in record.dims:
        below = float(record.attrs.get("depression_angle", record.attrs.get("tilt", 0.0)))
        sides = np.array([[0.0, -np.cos(below), np.sin(below)], [0.0, np.cos(below), np.sin(below)]])
        return SonarBeams(frame=axes.BELOW, directions=lambda _: sides, offset=nowhere)
    return SonarBeams(frame=axes.BELOW, directions=lambda _: np.array([[0.0, 0.0, 1.0]]), offset=nowhere)


def beam_widths(attrs: Mapping[str, Any]) -> dict[str, list[float]]:
    """Return the beam widths [rad] of a record as fields of PingInfo, by its scene's sensor or preset; or none."""
    kind = str(attrs.get("sonar", ""))
    known = _widths(kind, str(attrs.get("scene", "")), str(attrs.get("preset", "")))
    return {field: [] if width is None else [radians_from_deg(width)]
            for field, width in zip(("tx_beamwidths", "rx_beamwidths"), known)}


@functools.lru_cache(maxsize=8)
def _widths(kind: str, scene: str, preset: str) -> tuple[float | None, float | None]:
    """Return the widths [degrees] on transmission and reception that a scene's only sensor of a kind states."""
    try:
        sensors = [one for one in ElementTree.fromstring(scene).iter("sensor") if one.get("type") == kind]
    except ElementTree.ParseError:
        sensors = []
    written = {child.get("name"): child.get("value", "") for child in sensors[0]} if len(sensors) == 1 else {}
    table = presets(kind) if kind in TABLES else {}
    values = {**table.get(written.get("preset", preset), {}), **written}
    transmitted, received = WIDTHS.get(kind, OTHER_WIDTHS)
    return _number(values.get(transmitted)), _number(values.get(received))


def _number(value: object) -> float | None:
    try:
        return float(value)                            # pyright: ignore[reportArgumentType]  what is none raises
    except (TypeError, ValueError):
        return None


def _fan_frame(direction: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return the columns x, y, z of the frame of a fan of directions (B, 3) at angles (B,) [rad] from its middle."""
    if angle.size < 2:
        middle = direction[0]
        aside = np.array([0.0, 1.0, 0.0]) if abs(middle[1]) < 0.9 else np.array([-1.0, 0.0, 0.0])
    else:
        middle, aside = np.linalg.lstsq(np.stack([np.cos(angle), np.sin(angle)], -1), direction, rcond=None)[0]
    middle = middle / np.linalg.norm(middle)
    aside = aside - (aside @ middle) * middle
    aside /= np.linalg.norm(aside)
    return np.stack([np.cross(aside, middle), aside, middle], -1)


def _levelled(ping: xr.Dataset) -> np.ndarray:
    """Return the matrix (3, 3) that takes rows of a level body at a ping's heading to its rolling body."""
    roll, pitch, heading = (float(ping[name].values.reshape(-1)[0]) for name in ("roll", "pitch", "heading"))
    return rotation_matrix(0.0, 0.0, heading).T @ rotation_matrix(roll, pitch, heading)


def _cones(ping: xr.Dataset) -> np.ndarray:
    """Return the directions of soundings in the frame of their arrays, where both cones of a beam meet below."""
    forward, starboard = np.sin(ping["transmit_angle"].values[0]), np.sin(ping["angle"].values[0])
    down = np.sqrt(np.maximum(1 - forward ** 2 - starboard ** 2, 0))
    return np.stack([forward, starboard, down], -1) @ mounting_matrix(*ping["transmit_mounting"].values).T
