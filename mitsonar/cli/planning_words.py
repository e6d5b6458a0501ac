"""What `plan` says of a survey: the text for those who sail it."""
from typing import Any

MOST_LINES = 60                    # listed


def subtitle(numbers: dict[str, Any]) -> str:
    """Return the plan in one line, for the head of its map."""
    return (f"{_count(len(numbers['lines']), 'line')}, {_distance(numbers['length_m']['all'])} and "
            f"{_clock(numbers['time_s']['all'])} in all at {numbers['speed_knots']:.3g} knots; "
            f"{_share(numbers['coverage_percent']['once'])} % covered")


def report(numbers: dict[str, Any]) -> str:
    """Return the plan as text."""
    return "\n".join([*_head(numbers), "", *_lines(numbers), "", *_sums(numbers), *_coverage(numbers),
                      *_refraction(numbers)])


def _head(numbers):
    area, sonar = numbers["area"], numbers["sonar"]
    why = {"given": "as asked", "contours": "along the contours", "area": "along the area"}[numbers["heading_by"]]
    name = f"{sonar['name']}: " if sonar["name"] else ""
    yield (f"area      {_surface(area['size_m2'])}, {area['shoalest_m']:.1f} to {area['deepest_m']:.1f} m deep, mean "
           f"{area['mean_m']:.1f} m")
    yield (f"sonar     {name}{sonar['beams']} beams over {sonar['swath_deg']:g} degrees, even in {sonar['even']}, "
           f"head at {sonar['head_depth_m']:g} m")
    yield f"heading   {numbers['heading_deg']:.1f} degrees and back, {why}"


def _lines(numbers):
    some = numbers["lines"]
    yield " line  heading   length   depth  swath min/mean   ping every    turn"
    for line in some[:MOST_LINES]:
        turn = "-" if line["turn_m"] is None else f"{line['turn_m']:.0f} m"
        swath = f"{line['swath_m']['least']:.0f}/{line['swath_m']['mean']:.0f} m"
        yield (f"{line['line']:5d}  {line['heading_deg']:7.1f} {line['length_m']:6.0f} m {line['mean_m']:5.1f} m "
               f"{swath:>15} {line['ping_every_m']:10.2f} m {turn:>7}")
    if len(some) > MOST_LINES:
        yield f"      ... and {len(some) - MOST_LINES} more; --json lists all"


def _sums(numbers):
    length, time = numbers["length_m"], numbers["time_s"]
    yield (f"length    {_distance(length['all'])}: lines {_distance(length['lines'])}, run-ins "
           f"{_distance(length['run_ins'])}, turns {_distance(length['turns'])}")
    yield (f"time      {_clock(time['all'])} at {numbers['speed_knots']:.3g} knots, {_clock(time['lines'])} of it on "
           "lines")
    yield f"soundings {numbers['soundings']:,} in {numbers['pings']:,} pings"
    rare = next(name for name in numbers["density_per_m2"] if name != "mean")
    yield (f"density   {numbers['density_per_m2']['mean']:.2g} a square metre; less than "
           f"{numbers['density_per_m2'][rare]:.2g} on {rare.rpartition('_')[2]} % of what is covered")


def _coverage(numbers):
    covered, gaps = numbers["coverage_percent"], numbers["gaps"]
    yield f"coverage  {_share(covered['once'])} %, by two lines or more {_share(covered['twice'])} %"
    if gaps["number"]:
        largest = gaps["largest"][0]
        where = f"x {largest['x']:.0f}, y {largest['y']:.0f}"
        yield (f"gaps      {gaps['number']}, {_surface(gaps['size_m2'])} together; the largest has "
               f"{_surface(largest['size_m2'])} at {where}")
    else:
        yield f"gaps      none of a node of the bathymetry ({max(numbers['area']['cell_m']):.3g} m) or more"


def _refraction(numbers):
    if not numbers["refraction"]:
        return
    yield f"depth errors by the other profile, against S-44 order {numbers['order']} (TVU, 95 %, all causes together)"
    for one in numbers["refraction"]:
        outer = one["outer_beam_error_m"]
        if outer is None:
            what = "the outermost beams are lost: their rays turn back upwards"
        else:
            share = 100 * abs(outer) / one["allowed_m"]
            what = f"outermost beams {outer:+.2f} m ({share:.0f} % of {one['allowed_m']:.2f} m)"
        nadir = one["nadir_error_m"]
        half = 0.5 * numbers["sonar"]["swath_deg"]
        within = one["within_order_to_deg"]
        whole = within >= half - 1e-3
        reach = "all beams within the order" if whole else f"within the order to {within:.1f} degrees a side"
        yield f"  at {one['depth_m']:6.1f} m: {what}, nadir {nadir or 0.0:+.2f} m; {reach}"


def _count(number, what):
    return f"{number} {what}{'' if number == 1 else 's'}"


def _distance(metres):
    return f"{metres / 1000:.2f} km ({metres / 1852:.2f} NM)" if metres >= 1000 else f"{metres:.0f} m"


def _surface(square_metres):
    return f"{square_metres / 1e6:.3f} km²" if square_metres >= 1e5 else f"{square_metres:,.0f} m²"


def _share(percent):
    """Per cent that say 100 only where nothing is missing."""
    return "100" if percent == 100 else f"{min(percent, 99.99):.2f}"


def _clock(seconds):
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60:02d} min" if minutes >= 60 else f"{minutes} min"
