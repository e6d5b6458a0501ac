"""Numbers of a plan, with the unit in each name: as a JSON file, and as text for the crew.

The fields of the text templates name the numbers; the formats ``distance``, ``surface``, ``clock`` and ``share`` extend
Python's own.
"""
from __future__ import annotations

import json
import string
from dataclasses import asdict
from typing import Any

import numpy as np

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath, replacing
from mitsonar.units import KNOT

from .line_files import on_earth
from .plan import SurveyPlan
from .uncertainty.cast_errors import CastError
from .uncertainty.error_budget import HITS, SwathBudget, along_track

MOST_GAPS = 20                     # listed in the file
MOST_LINES = 60                    # listed in the text

_HEAD = """\
area      {area[size_m2]:surface}, {area[shoalest_m]:.1f} to {area[deepest_m]:.1f} m deep, mean {area[mean_m]:.1f} m
sonar     {name}{sonar[beams]} beams over {sonar[swath_deg]:g} degrees, even in {sonar[even]}, head at \
{sonar[head_depth_m]:g} m
heading   {heading_deg:.1f} degrees and back, {why}

 line  heading   length   depth  swath min/mean   ping every    turn"""
_LINE = """\
{line:5d}  {heading_deg:7.1f} {length_m:6.0f} m {mean_m:5.1f} m {swath:>15} {ping_every_m:10.2f} m {turn:>7}"""
_SUMS = """
length    {length_m[all]:distance}: lines {length_m[lines]:distance}, run-ins {length_m[run_ins]:distance}, turns \
{length_m[turns]:distance}
time      {time_s[all]:clock} at {speed_knots:.3g} knots, {time_s[lines]:clock} of it on lines
soundings {soundings:,} in {pings:,} pings
density   {density_per_m2[mean]:.2g} per square metre; less than {density_per_m2[percentile_5]:.2g} on \
5 % of the covered area
coverage  {coverage_percent[once]:share} %, by two lines or more {coverage_percent[twice]:share} %"""
_GAPS = """\
gaps      {number}, {size_m2:surface} together; the largest has {largest[0][size_m2]:surface} at x \
{largest[0][x]:.0f}, y {largest[0][y]:.0f}"""
_NO_GAP = "gaps      none as large as a node of the bathymetry ({:.3g} m)"
_CROSS = """\
crossing  {number} of the lines, {length_m:distance}: {percent_of_lines:.1f} % of the length of the others"""
_ALONG = """\
along     pings at most {spacing:.2g} m apart"""
_FOOTPRINT = """\
; beams straight below cover {footprint:.2g} m: no gaps up to {knots:.3g} knots"""
_FEATURE = """\

features  {hits:.2g} pings or more on a feature of {feature:.2g} m, {least} up to {feature_knots:.3g} knots"""
_UNCERTAINTY = """\
uncertainty of all causes together (95 %), compared with S-44 order {}"""
_BUDGET = """\
  at {depth_m:6.1f} m: TVU {nadir[tvu_m]:.2f} to {outer[tvu_m]:.2f} m of {allowed_tvu_m:.2f} m, \
THU {nadir[thu_m]:.2f} to {outer[thu_m]:.2f} m of {allowed_thu_m:.2f} m, outermost most by {outer[main_cause]}; \
{reach}"""
_REFRACTION = """\
depth errors from the other profile, compared with S-44 order {} (TVU, 95 %, all causes together)"""
_SUBTITLE = """\
{lines}, {length_m[all]:distance} and {time_s[all]:clock} in all at {speed_knots:.3g} knots; \
{coverage_percent[once]:share} % covered"""


class _Words(string.Formatter):
    """Formatter with formats for distances, areas, times and shares."""

    def format_field(self, value: Any, format_spec: str) -> str:
        if format_spec == "distance":
            return f"{value / 1000:.2f} km ({value / 1852:.2f} NM)" if value >= 1000 else f"{value:.0f} m"
        if format_spec == "surface":
            return f"{value / 1e6:.3f} km²" if value >= 1e5 else f"{value:,.0f} m²"
        if format_spec == "clock":
            minutes = round(value / 60)
            return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
        if format_spec == "share":                     # 100 only for complete coverage
            return "100" if value == 100 else f"{min(value, 99.99):.2f}"
        return super().format_field(value, format_spec)


def summary(plan: SurveyPlan, frame: Frame) -> dict[str, Any]:
    """Return the numbers of a plan."""
    layout, sonar, covered = plan.layout, plan.sonar, plan.coverage
    surveyed = sum(line.length for line in plan.sailed)
    crossed = sum(line.length for line in plan.cross_lines)
    turns = sum(line.turn.length for line in plan.sailed if line.turn is not None)
    run_ins = layout.run_in * len(plan.sailed)
    pings = sum(plan.pings(line) for line in plan.sailed)
    # the size of a polygon is exact, a count of nodes is not
    size = (np.count_nonzero(covered.wanted) * plan.bed.step[0] * plan.bed.step[1] if plan.area is None else
            plan.area.area * (1 - plan.unknown - plan.shoal))
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
        "lines": [_line(plan, number, frame) for number in range(len(plan.sailed))],
        "length_m": {"lines": surveyed, "run_ins": run_ins, "turns": turns, "all": surveyed + run_ins + turns},
        "speed_knots": layout.speed / KNOT,
        "time_s": {"lines": surveyed / layout.speed, "all": (surveyed + run_ins + turns) / layout.speed},
        "pings": pings,
        "soundings": pings * sonar.beams,
        "density_per_m2": {"mean": float(seen.mean()), "percentile_5": float(np.percentile(seen, 5))},
        "coverage_percent": {"once": 100 * covered.share(), "twice": 100 * covered.share(2)},
        "gaps": {"number": len(plan.gaps), "size_m2": float(sum(gap.area for gap in plan.gaps)),
                 "largest": [{"size_m2": gap.area, **_place(frame, gap.x, gap.y)} for gap in plan.gaps[:MOST_GAPS]]},
        "cross_lines": {"number": len(plan.cross_lines), "length_m": crossed,
                        "percent_of_lines": 100 * crossed / (surveyed - crossed)},
        "order": plan.order.name,
        "along_track": asdict(along_track([line.track for line in plan.lines], sonar, plan.order, layout.speed)),
        "uncertainty": [_uncertainty(budget) for budget in plan.budgets],
        "refraction": [_refraction(error) for error in plan.refraction]}


def _line(plan: SurveyPlan, number: int, frame: Frame) -> dict[str, Any]:
    line = plan.sailed[number]
    width = line.track.edges.width
    return {"line": line.number, "kind": "cross" if line in plan.cross_lines else "main",
            "heading_deg": _degrees(line.heading), "length_m": line.length,
            "start": _place(frame, *line.start), "end": _place(frame, *line.end),
            "shoalest_m": float(line.track.depth.min()), "mean_m": float(line.track.depth.mean()),
            "swath_m": {"least": float(width.min()), "mean": float(width.mean()), "most": float(width.max())},
            "ping_every_m": plan.layout.speed / float(line.track.rate.mean()), "pings": plan.pings(line),
            "turn_m": None if line.turn is None else line.turn.length}


def _uncertainty(budget: SwathBudget) -> dict[str, Any]:
    beams = {name: {"tvu_m": float(budget.vertical[beam]), "thu_m": float(budget.horizontal[beam]),
                    "main_cause": budget.main_cause(beam)} for name, beam in (("nadir", 0), ("outer", -1))}
    return {"depth_m": budget.depth, "allowed_tvu_m": budget.allowed_vertical,
            "allowed_thu_m": budget.allowed_horizontal, "within_order_to_deg": _degrees(budget.good_angle), **beams,
            "by_angle": [{"angle_deg": _degrees(float(angle)), "tvu_m": float(budget.vertical[beam]),
                          "thu_m": float(budget.horizontal[beam]),
                          "parts_m": {name: [float(side[beam]) for side in sides]
                                      for name, sides in budget.parts.items()}}
                         for beam, angle in enumerate(budget.angle) if beam % 8 == 0]}


def _refraction(errors: CastError) -> dict[str, Any]:
    worst = np.nanmax(np.abs(errors.error)) if np.isfinite(errors.error).any() else np.nan
    return {"depth_m": errors.depth, "allowed_m": errors.allowed, "outer_beam_error_m": _finite(errors.outer),
            "nadir_error_m": _finite(float(errors.error[0])), "largest_error_m": _finite(float(worst)),
            "within_order_to_deg": _degrees(errors.good_angle),
            "by_angle": [[_degrees(float(angle)), _finite(float(error))]
                         for angle, error in zip(errors.angle[::8], errors.error[::8])]}


def _place(frame: Frame, x: float, y: float) -> dict[str, float]:
    """Return a point with its latitude and longitude if the coordinate system is known."""
    place = {"x": float(x) + frame.origin[0], "y": float(y) + frame.origin[1]}
    if frame.crs:
        latitude, longitude = on_earth(frame, np.array([[x, y]]))[0]
        place |= {"latitude": round(float(latitude), 9), "longitude": round(float(longitude), 9)}
    return place


def _degrees(angle: float) -> float:
    return round(float(np.rad2deg(angle)), 6)


def _finite(value: float) -> float | None:
    """Return a number for JSON: None for infinity and NaN."""
    return float(value) if np.isfinite(value) else None


def write(numbers: dict[str, Any], path: FilePath) -> None:
    """Write the numbers as JSON."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(numbers, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def subtitle(numbers: dict[str, Any]) -> str:
    """Return the plan in one line, as the subtitle of its map."""
    count = len(numbers["lines"])
    return _Words().format(_SUBTITLE, **numbers | {"lines": f"{count} line{'' if count == 1 else 's'}"})


def report(numbers: dict[str, Any]) -> str:
    """Return the plan as text."""
    words, lines, gaps = _Words(), numbers["lines"], numbers["gaps"]
    name = f"{numbers['sonar']['name']}: " if numbers["sonar"]["name"] else ""
    why = {"given": "as asked", "contours": "along the contours", "area": "along the area"}[numbers["heading_by"]]
    rows = [words.format(_HEAD, name=name, why=why, **numbers)]
    rows += [words.format(_LINE, **line, swath=words.format("{least:.0f}/{mean:.0f} m", **line["swath_m"]),
                          turn="-" if line["turn_m"] is None else f"{line['turn_m']:.0f} m")
             for line in lines[:MOST_LINES]]
    if len(lines) > MOST_LINES:
        rows.append(f"      ... and {len(lines) - MOST_LINES} more; --json lists all")
    rows.append(words.format(_SUMS, **numbers))
    rows.append(words.format(_GAPS, **gaps) if gaps["number"] else _NO_GAP.format(max(numbers["area"]["cell_m"])))
    if numbers["cross_lines"]["number"]:
        rows.append(words.format(_CROSS, **numbers["cross_lines"]))
    rows.append(_along_words(numbers["along_track"]))
    half = 0.5 * numbers["sonar"]["swath_deg"]
    rows.append(_UNCERTAINTY.format(numbers["order"]))
    rows += [_BUDGET.format(**budget, reach=_reach(budget["within_order_to_deg"], half))
             for budget in numbers["uncertainty"]]
    if numbers["refraction"]:
        rows.append(_REFRACTION.format(numbers["order"]))
    return "\n".join([*rows, *(_error_words(errors, half) for errors in numbers["refraction"])])


def _error_words(errors: dict[str, Any], half_swath_deg: float) -> str:
    outer, allowed, within = errors["outer_beam_error_m"], errors["allowed_m"], errors["within_order_to_deg"]
    words = ("the outermost beams are lost: their rays turn back upwards" if outer is None else
             f"outermost beams {outer:+.2f} m ({100 * abs(outer) / allowed:.0f} % of {allowed:.2f} m)")
    return (f"  at {errors['depth_m']:6.1f} m: {words}, nadir {errors['nadir_error_m'] or 0.0:+.2f} m; "
            f"{_reach(within, half_swath_deg)}")


def _reach(within: float, half_swath_deg: float) -> str:
    return ("all beams within the order" if within >= half_swath_deg - 1e-3 else
            f"within the order to {within:.1f} degrees a side")


def _along_words(along: dict[str, Any]) -> str:
    words = _ALONG.format(**along)
    if along["footprint"] is not None:
        words += _FOOTPRINT.format(**along, knots=along["gapless_speed"] / KNOT)
    if along["feature"] is not None:
        words += _FEATURE.format(**along, least=HITS, feature_knots=along["feature_speed"] / KNOT)
    return words
