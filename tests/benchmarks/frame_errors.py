"""How far pictures in the beam domain are off: against brute force, closed forms, the element chain and rays.

    python tests/benchmarks/frame_errors.py                       all tables
    python tests/benchmarks/frame_errors.py points bed            some of them
    python tests/benchmarks/frame_errors.py --quick               with fewer frames

points      point targets against a sum over elements in NumPy (`tests/inputs/brute_force_beams.py`), still, under way
            and turning: worst sample of any beam and its magnitude [dB re the peak nearby]
bed         mean level of a level bed against an integral of the sonar equation
speckle     moments and correlations of a level bed's speckle against theory and the element chain, by scatterers a cell
coherence   of complex frames as the sonar moves, ahead and to starboard, against the element chain
kinds       energies and labels of kinds of beds, water and objects against those that rays find
"""
import argparse
import sys
import tempfile
from pathlib import Path

import measuring
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "inputs"))

from mitsonar.imaging import fan  # noqa: E402  (after measuring has found the checkout)
from mitsonar.validation import scenes  # noqa: E402  (likewise)

KNOT = 0.514444
SOUND_SPEED, CARRIER, BANDWIDTH, LONG, SOURCE_DB, LOSS_DB = 1500.0, 300e3, 20e3, 0.5e-3, 205.0, 0.03
WAVELENGTH = SOUND_SPEED / CARRIER
LINE = {"frequency_khz": CARRIER / 1e3, "pulse": "lfm", "bandwidth_khz": BANDWIDTH / 1e3, "pulse_ms": LONG * 1e3,
        "pulse_window": "hann", "source_level_db": SOURCE_DB, "transmit": "point", "transmit_normal": "forward",
        "transmit_baffle": "hard", "receive": "line", "receive_elements": 32, "receive_normal": "forward",
        "receive_baffle": "hard", "receive_shading": "hamming"}


def main(argv=None):
    """Print the tables asked for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("tables", nargs="*", metavar="table", help=", ".join(TABLES))
    parser.add_argument("--quick", action="store_true", help="fewer frames")
    arguments = parser.parse_args(argv)
    unknown = sorted(set(arguments.tables) - set(TABLES))
    if unknown:
        parser.error(f"there is no table {unknown[0]!r}; there are {', '.join(TABLES)}")
    print(measuring.machine())
    for name in arguments.tables or TABLES:
        print(f"\n{name}", flush=True)
        TABLES[name](arguments.quick)


def planned(shapes, *, depth=16.0, film=None, water=None, integrator=None, beams=41, width=80.0, steps="sine",
            **sensor):
    """Return the survey of a line's pings, and angles and directions of its beams."""
    from mitsonar.survey.pressure.signals import LEAD
    from mitsonar.verbs.images import opened

    scene, sensor, path = opened(scenes.array_sonar(shapes, depth=depth, sensor={**LINE, **sensor}, water=water,
                                                    film=film, integrator=integrator))
    survey = path.array_survey(scene, sensor, LEAD)
    return survey, fan.fan_directions(survey.receive, beams, np.deg2rad(width), steps)


def in_beam_domain(survey, direction, *, ping=0, per_cell=5.0):
    """Beams (B, S) and truth of a frame."""
    from mitsonar.survey.beam_domain.frames import Frames

    return Frames(survey, direction, per_cell=per_cell).frame(ping, 1)


def of_elements(survey, direction, *, ping=0):
    """Beams (B, S) of the element chain."""
    from mitsonar.survey.pressure.pressure import PressureRecord
    from mitsonar.survey.pressure.signals import received_signals

    return fan.formed(received_signals(PressureRecord(survey, seed=1), [ping]), survey.pulse, direction)[0]


def sweep():
    """The line's pulse."""
    import brute_force_beams

    return brute_force_beams.Sweep(frequency=CARRIER, bandwidth=BANDWIDTH, duration=LONG)


def distance_of(survey):
    """Slant ranges of the picture's samples (S,) [m]."""
    return 0.5 * SOUND_SPEED * survey.time[survey.lead:]


# ---- point targets

def points(quick):
    """Print errors of point targets."""
    rows = []
    for name, speed, turning in (("still", 0.0, 0.0), ("3 knots", 3.0, 0.0), ("3 knots, 12 degrees/s", 3.0, 12.0)):
        for elements in (32,) if quick else (32, 100, 200):
            for where, *errors in point_errors(elements, speed * KNOT, np.deg2rad(turning)):
                rows.append([f"{name}, {elements} elements", where, *(f"{error:.3f}" for error in errors[:2]),
                             *(f"{error:.1f}" for error in errors[2:])])
    measuring.table(["point targets", "range [m]", "peak, beams [dB]", "elements", "worst, beams [dB]", "elements",
                     "magnitude, beams", "elements"], rows)


def point_errors(elements, speed, turn_rate, *, chain=True, ranges=(5.0, 14.0, 27.0, 55.0)):
    """Yield range, errors of peaks [dB] and worst samples [dB], of beam domain and element chain in turn."""
    import brute_force_beams

    bearings = np.deg2rad([-31.0, -2.0, 24.0])
    start = np.array([0.0, 1.0 if speed else 0.0, -16.0])
    places = np.array([[R * np.sin(b), start[1] + R * np.cos(b), -16.6 - 0.1 * k] for R in ranges
                       for k, b in enumerate(bearings)])
    strength = np.repeat(40 * np.log10(np.array(ranges) / 5), len(bearings))
    shapes = {f"p{k}": scenes.point_target(place, level) for k, (place, level) in enumerate(zip(places, strength))}
    with tempfile.TemporaryDirectory() as folder:
        where = {}
        if speed or turn_rate:
            t = np.arange(-4, 4, 0.1)
            heading = np.rad2deg(turn_rate) * t
            track = np.stack([t + 4, 0 * t, start[1] + speed * t, 0 * t + start[2], 0 * t, 0 * t, heading], 1)
            where = {"track": str(Path(folder) / "track.csv"), "pings": 2, "ping_rate_hz": 0.25}
            np.savetxt(where["track"], track, delimiter=",", header="time,x,y,z,roll,pitch,heading", comments="",
                       fmt="%.12g")
        survey, (_, direction) = planned(
            {"seabed": scenes.buried_bed(60.0), **shapes}, beams=61, width=120.0, film={"range": max(ranges) + 2,
                                                                                       "range_min": 3.0},
            receive_elements=elements, **where)
    ping = survey.track.pings - 1 if where else 0
    course = brute_force_beams.Course(start=survey.track.position[ping], velocity=np.array([0.0, speed, 0.0]),
                                      heading=turn_rate * (survey.track.time[ping] - 4), turn_rate=turn_rate)
    exact = brute_force_beams.beams_of_points(
        places, strength, course=course, sweep=sweep(), elements=survey.receive.position, weight=survey.receive.weight,
        directions=direction, time=survey.time[survey.lead:], sound_speed=SOUND_SPEED, absorption_db=LOSS_DB,
        source_level_db=SOURCE_DB)
    made = [in_beam_domain(survey, direction, ping=ping)[0]]
    if chain:
        made.append(of_elements(survey, direction, ping=ping))
    for R in ranges:
        some = np.abs(distance_of(survey) - R) < 1.5
        peak = np.abs(exact[:, some]).max()
        yield (R, *(decibels(np.abs(one[:, some]).max() / peak) for one in made),
               *(decibels(np.abs(one - exact)[:, some].max() / peak) for one in made),
               *(decibels(np.abs(np.abs(one) - np.abs(exact))[:, some].max() / peak) for one in made))


def decibels(amplitude):
    """20 log10."""
    return float(20 * np.log10(max(amplitude, 1e-30)))


# ---- a level bed

def level_bed(start=(0.0, 0.0), **more):
    """Return survey and directions of a line 4 m above a level bed, and the expected powers (B, S) [µPa²]."""
    import brute_force_beams

    more = {"film": {"range": 12.0, "range_min": 8.0}, "integrator": {"cell": 0.03}, **more}
    shapes = {"seabed": scenes.bed(20.0, size=110.0)}
    survey, (_, direction) = planned(shapes, start=[start[1], start[0], -16.0], **more)
    R = distance_of(survey)
    nodes = np.linspace(R[0], R[-1], 40)
    power = brute_force_beams.beam_power_of_bed(
        nodes, direction[:, 1], altitude=4.0, lambert_db=-27.0, sweep=sweep(),
        place=survey.receive.position[:, 1] / WAVELENGTH, weight=survey.receive.weight, sound_speed=SOUND_SPEED,
        absorption_db=LOSS_DB, source_level_db=SOURCE_DB, pattern=lambda sight: (sight[..., 0] > 0) * 1.0)
    return survey, direction, np.exp([np.interp(R, nodes, row) for row in np.log(power)])


def elsewhere(count):
    """Places (count, 2) [m] ahead and to starboard, whose frames share no resolution cell as they see it."""
    return np.stack([-2.0 * np.arange(1, count + 1), 3.0 * np.arange(1, count + 1)], 1) * 8 / max(count, 8)


def bed(quick):
    """Print mean levels of a bed against the integral."""
    count, film, edges = 4 if quick else 12, {"range": 24.0, "range_min": 5.0}, (6, 8, 11, 15, 19, 23)
    powers = []
    for start in elsewhere(count):
        survey, direction, expected = level_bed(start, film=film)
        powers.append(np.abs(in_beam_domain(survey, direction)[0]) ** 2 / expected)
    R, mean = distance_of(survey), np.mean(powers, axis=0)
    rows = []
    for near, far in zip(edges[:-1], edges[1:]):
        some = mean[:, (R > near) & (R < far)]
        rows.append([f"{near} to {far} m", *(f"{10 * np.log10(part.mean()):.2f}" for part in
                                             (some, some[:14], some[14:27], some[27:]))])
    measuring.table(["mean |beam|² [dB re integral]", "all beams", "port", "middle", "starboard"], rows)


# ---- speckle

def speckle(quick):
    """Print moments and correlations."""
    import speckle as statistics

    lags, later = (1, 2, 3), (1, 2, 3, 4)
    rows, count = [], 3 if quick else 8
    for name, per_cell in (("q = 4", 4.0), ("q = 5", 5.0), ("q = 8", 8.0), ("element chain", None)):
        frames = []
        for start in elsewhere(count):
            survey, direction, mean = level_bed(start)
            frames.append(of_elements(survey, direction) if per_cell is None
                          else in_beam_domain(survey, direction, per_cell=per_cell)[0])
        rows.append([name, f"{10 * np.log10(np.mean([np.mean(np.abs(one) ** 2 / mean) for one in frames])):.2f}",
                     f"{statistics.second_moment(frames, mean):.2f}",
                     *(f"{one:.2f}" for one in statistics.correlation(frames, mean, lags, 0)),
                     *(f"{one:.2f}" for one in statistics.correlation(frames, mean, later, 1))])
    gap = direction[1, 1] - direction[0, 1]
    place, weight = survey.receive.position[:, 1] / WAVELENGTH, survey.receive.weight
    rows.append(["theory", "0.00", "2.00", *(f"{statistics.correlation_of_line(place, weight, k * gap):.2f}"
                                             for k in lags),
                 *(f"{one:.2f}" for one in statistics.correlation_of_pulse(sweep().compressed(survey.sampling_rate),
                                                                           np.array(later)))])
    measuring.table(["speckle", "level [dB]", "<I²>/<I>²", *(f"beam +{k}" for k in lags),
                     *(f"sample +{k}" for k in later)], rows)


def coherence(quick):
    """Print how alike frames are as the sonar moves."""
    import speckle as statistics

    moves = [(0.05, 0), (0.1, 0), (0.3, 0), (1, 0), (0, 0.05), (0, 0.1), (0, 0.3), (0, 1)][::3 if quick else 1]
    rows = []
    for name, per_cell in (("q = 1", 1.0), ("q = 4", 4.0), ("q = 5", 5.0), ("q = 8", 8.0), ("element chain", None)):
        def frame(move, per_cell=per_cell):
            survey, direction, _ = level_bed(move)
            made = of_elements(survey, direction) if per_cell is None else in_beam_domain(
                survey, direction, per_cell=per_cell)[0]
            return made, distance_of(survey), direction[:, 1]

        first, R, sines = frame((0.0, 0.0))
        known = {"distance": R, "sines": sines, "altitude": 4.0, "wavenumber": 2 * np.pi / WAVELENGTH}
        alike = [statistics.coherence(first, frame(move)[0], moved=np.array(move), **known) for move in moves]
        rows.append([name, *(f"{one:.2f}" for one in alike)])
    measuring.table(["coherence of registered frames", *(f"{a:g} m ahead" if a else f"{b:g} m aside"
                                                         for a, b in moves)], rows)


# ---- kinds of scenes, against rays

def kinds(quick):
    """Print energies and labels by instance, of the beam domain against those that rays find."""
    from mitsonar.survey.energy import energy
    from mitsonar.survey.fan.beams import Beams

    rows = []
    for name, (shapes, more) in list(scenes_of_kinds().items())[:3 if quick else None]:
        survey, directions = planned(shapes, film={"range": 14.0, "range_min": 5.0}, steps="angle",
                                     integrator={"rays": 200_000}, **{"transmit_normal": "1, 0, 0.2", **more})
        _, truth = in_beam_domain(survey, directions[1], per_cell=8.0)
        beams = Beams(survey, *directions)
        rays = energy.record(survey, beams, 5)
        shown = beams.shown(rays.intensity[0])
        for number, instance in survey.labels.items():
            mine, theirs = truth.truth.share[:, number - 1], rays.truth.share[0][:, number - 1]
            level = (truth.intensity * mine).sum() / max((shown * theirs).sum(), 1e-30)
            dark, true_dark = truth.truth.object_shadow == number, rays.truth.object_shadow[0] == number
            rows.append([name, instance, f"{10 * np.log10(level):.2f}", f"{overlap(mine > 0.5, theirs > 0.5):.2f}",
                         f"{overlap(dark, true_dark):.2f}" if true_dark.any() else ""])
    measuring.table(["scene", "instance", "energy [dB re rays]", "label IoU", "shadow IoU"], rows)


def overlap(a, b):
    """Intersection over union."""
    return (a & b).sum() / max((a | b).sum(), 1)


def scenes_of_kinds():
    """Shapes and attributes by name."""
    from mitsonar.scene.loading import prepare

    prepare()
    import mitsuba as mi

    turned = mi.ScalarTransform4f

    def box(x, y, z, size, turn=0.0):
        return {"type": "cube", "bsdf": scenes.lambert(-10.0),
                "to_world": turned().translate([x, y, z]).rotate([0, 0, 1], turn).scale(size)}

    flat, boxes = scenes.bed(20.0, size=60.0), {"box": box(-2, 7, -19.6, [0.5, 0.3, 0.4], 20),
                                                "pipe": box(3, 9, -19.8, [2, 0.2, 0.2], -15)}
    grid = {"type": "seabed", "depth": 20.0, "length": 40.0, "width": 40.0, "spacing": 0.1, "bsdf": scenes.lambert()}
    ripples = {**grid, "ripple_wavelength": 1.2, "ripple_height": 0.08}
    north = turned().translate([0, 0, -20]).rotate([1, 0, 0], 30).scale([30, 30, 1])
    return {
        "boxes on a rectangle": ({"seabed": flat, **boxes}, {}),
        "boxes on ripples": ({"seabed": ripples, **boxes}, {}),
        "rough": ({"seabed": {**grid, "fractal_rms": 0.25, "fractal_gamma": 3.2, "fractal_outer_scale": 20.0}}, {}),
        "summer cast": ({"seabed": ripples, **boxes}, {"water": {"profile": "0:1520, 12:1519, 18:1500, 40:1495"}}),
        "duct": ({"seabed": ripples, **boxes}, {"water": {"profile": "0:1510, 10:1480, 16:1470, 22:1482, 60:1500"}}),
        "30 degrees aside": ({"seabed": scenes.bed(20.0, size=60.0, tilt=np.deg2rad(30))}, {}),
        "30 degrees ahead": ({"seabed": {"type": "rectangle", "to_world": north, "bsdf": scenes.lambert()}}, {}),
        "sphere": ({"seabed": flat, "ball": {"type": "sphere", "center": [-2, 7, -19.5], "radius": 0.5,
                                             "bsdf": scenes.lambert(-10.0)}}, {}),
        "sea surface": ({"seabed": flat, "sea_surface": {"type": "sea_surface", "wind_speed": 8.0}},
                        {"depth": 8.0, "transmit_normal": "forward"})}


TABLES = {"points": points, "bed": bed, "speckle": speckle, "coherence": coherence, "kinds": kinds}

if __name__ == "__main__":
    main()
