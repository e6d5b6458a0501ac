"""The numbers of a plan, as its JSON file holds them: in the units that their names say."""
from __future__ import annotations

import json
from typing import Any

import numpy as np

from mitsonar.device.files import FilePath, replacing
from mitsonar.io.tracks.navigation import Frame
from mitsonar.units import KNOT

from .errors import CastError
from .line_files import on_earth
from .plan import Plan

MOST_GAPS = 20                     # listed
RARE_PERCENT = 5.0                 # of the area, that is sounded less densely than the number given


def summary(plan: Plan, frame: Frame) -> dict[str, Any]:
    """Return the numbers of a plan."""
    layout, sonar, covered = plan.layout, plan.sonar, plan.coverage
    surveyed = sum(line.length for line in plan.lines)
    turns = sum(line.turn.length for line in plan.lines if line.turn is not None)
    run_ins = layout.run_in * len(plan.lines)
    pings = sum(plan.pings(line) for line in plan.lines)
    # a polygon's own size is exact, that of nodes is not
    size = (np.count_nonzero(covered.wanted) * plan.bed.step[0] * plan.bed.step[1] if plan.area is None else
            plan.area.size * (1 - plan.unknown - plan.shoal))
    seen = covered.density[covered.wanted & (covered.times > 0)]
    seen = seen if seen.size else np.zeros(1)
    shoalest, mean, deepest = plan.depths
    return {
        "sonar": {"name": sonar.name or None, "swath_deg": _degrees(sonar.swath), "beams": sonar.beams,
                  "even": sonar.even, "rate_hz": _finite(sonar.rate), "head_depth_m": sonar.head_depth,
                  "max_range_m": _finite(sonar.max_range)},
        "area": {"size_m2": float(size), "cell_m": list(plan.bed.step),
                 "without_depth_percent": 100 * plan.unknown,
                 "left_out_shoal_percent": 100 * plan.shoal, "least_depth_m": plan.least_depth,
                 "shoalest_m": shoalest, "mean_m": mean, "deepest_m": deepest, "crs": frame.crs or None},
        "heading_deg": _degrees(plan.frame.heading),
        "heading_by": {None: "given", True: "contours", False: "area"}[plan.contours],
        "lines": [_line(plan, number, frame) for number in range(len(plan.lines))],
        "length_m": {"lines": surveyed, "run_ins": run_ins, "turns": turns, "all": surveyed + run_ins + turns},
        "speed_knots": layout.speed / KNOT,
        "time_s": {"lines": surveyed / layout.speed, "all": (surveyed + run_ins + turns) / layout.speed},
        "pings": pings,
        "soundings": pings * sonar.beams,
        "density_per_m2": {"mean": float(seen.mean()), f"percentile_{RARE_PERCENT:g}": float(
            np.percentile(seen, RARE_PERCENT))},
        "coverage_percent": {"once": 100 * covered.share(), "twice": 100 * covered.share(2)},
        "gaps": {"number": len(plan.gaps), "size_m2": float(sum(gap.area for gap in plan.gaps)),
                 "largest": [{"size_m2": gap.area, **_place(frame, gap.x, gap.y)} for gap in plan.gaps[:MOST_GAPS]]},
        "order": plan.order.name,
        "refraction": [_refraction(one) for one in plan.refraction]}


def _line(plan: Plan, number: int, frame: Frame) -> dict[str, Any]:
    line = plan.lines[number]
    width = line.track.edges.width
    return {"line": line.number, "heading_deg": _degrees(line.heading), "length_m": line.length,
            "start": _place(frame, *line.start), "end": _place(frame, *line.end),
            "shoalest_m": float(line.track.depth.min()), "mean_m": float(line.track.depth.mean()),
            "swath_m": {"least": float(width.min()), "mean": float(width.mean()), "most": float(width.max())},
            "ping_every_m": plan.layout.speed / float(line.track.rate.mean()), "pings": plan.pings(line),
            "turn_m": None if line.turn is None else line.turn.length}


def _refraction(one: CastError) -> dict[str, Any]:
    worst = np.nanmax(np.abs(one.error)) if np.isfinite(one.error).any() else np.nan
    return {"depth_m": one.depth, "allowed_m": one.allowed, "outer_beam_error_m": _finite(one.outer),
            "nadir_error_m": _finite(float(one.error[0])), "largest_error_m": _finite(float(worst)),
            "within_order_to_deg": _degrees(one.good_angle),
            "by_angle": [[_degrees(float(angle)), _finite(float(error))]
                         for angle, error in zip(one.angle[::8], one.error[::8])]}


def _place(frame: Frame, x: float, y: float) -> dict[str, float]:
    """A place, also on Earth where it is known."""
    found = {"x": float(x) + frame.origin[0], "y": float(y) + frame.origin[1]}
    if frame.crs:
        latitude, longitude = on_earth(frame, np.array([[x, y]]))[0]
        found |= {"latitude": round(float(latitude), 9), "longitude": round(float(longitude), 9)}
    return found


def _degrees(angle: float) -> float:
    return round(float(np.rad2deg(angle)), 6)


def _finite(value: float) -> float | None:
    """A number as JSON takes it: nothing for none, and for one without end."""
    return float(value) if np.isfinite(value) else None


def write(numbers: dict[str, Any], path: FilePath) -> None:
    """Write the numbers as JSON."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(numbers, indent=1, allow_nan=False) + "\n", encoding="utf-8")
