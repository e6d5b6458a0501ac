"""Rays: exact eigenrays against closed forms and 34-digit arithmetic, and traced hits against exact eigenrays."""
import numpy as np

from mitsonar.propagation.numpy_rays.eigenrays import eigenray, eigenrays
from mitsonar.water.profile import SoundSpeedProfile

from ..case import Case, Compared, Curve, Panel, Table, worst

GRADIENTS = (-5.0, -0.5, -0.05, -1e-6, 1e-6, 0.05, 0.5, 4.0)         # [1/s]
SIX_NODES = SoundSpeedProfile([0, 5, 12, 25, 40, 60], [1508, 1507.5, 1499, 1491, 1489.5, 1490.5])
SIX_NODE_RAYS = (  # source, target depth [m], range [m], time [s], length [m], launch, arrival [deg], spreading [dB]
    (3, 60, 15.1185743954816716, 0.0394868384425980718, 58.9709623060490129, 75, 75.1750699161581081, 35.32797754),
    (3, 60, 55.9396193437220304, 0.0534764226065878517, 79.8643829953378224, 45, 45.6499636561698523, 37.93293208),
    (3, 60, 95.1653998648636735, 0.0742772126360826264, 110.93196597588887, 30, 31.11346236072382, 40.72665717),
    (3, 60, 188.080543048526316, 0.131585352253516346, 196.543361047942971, 15, 17.2719164968948663, 45.42134942),
    (3, 60, 255.19279681796611, 0.175062613732832263, 261.522806739642341, 10, 13.2014903727212212, 47.58822793),
    (20, 50, 17.2647476890350169, 0.023223081675100254, 34.6131725930382944, 60, 60.0902244756625727, 30.76076381),
    (20, 50, 158.008718872220353, 0.107906172323895977, 160.832681742427327, 10, 10.8508738058798026, 43.84174576))
TURNED = (  # gradient [1/s], launch [deg], range back to the depth of the source [m], time [s]
    (0.5, 5, 524.931981155544031, 0.349509743848134232), (0.016, 3, 9826.45861557022576, 6.54797732084540427),
    (5, 20, 218.382140559721417, 0.142551401889779994))
SUMMER = SoundSpeedProfile([0, 4, 8, 11, 14, 17, 20, 25, 32, 40],
                           [1513.2, 1513.0, 1511.6, 1506.4, 1500.8, 1496.6, 1494.2, 1492.9, 1492.3, 1492.2])
SONAR_DEPTH, BED_DEPTH = 10.3, 45.0


def _closed_forms():
    """Yield rows of waters of one gradient, where rays are circles, for 50 pairs of points each."""
    rng = np.random.default_rng(20240611)
    for gradient in GRADIENTS:
        water = SoundSpeedProfile([0.0, 200.0], [1500.0, 1500.0 + 200 * gradient])
        source, target, across = rng.uniform(90, 110, (3, 50))
        ray = eigenray(water, source, target, across)
        start, end = 1500 + gradient * source, 1500 + gradient * target
        distance = np.hypot(across, target - source)
        half = gradient * distance / (2 * np.sqrt(start * end))
        yield worst(f"time, {gradient:g} 1/s", ray.travel_time, 2 / gradient * np.arcsinh(half), 1e-15, "s")
        # a chord of a circle of radius 1 / (p g)
        bend = 0.5 * ray.ray_parameter * gradient * distance
        yield worst(f"arc length, {gradient:g} 1/s", ray.arc_length, distance * np.arcsin(bend) / bend, 1e-11, "m")
        area = distance ** 2 * (1 + half ** 2) * end / start
        yield worst(f"spreading, {gradient:g} 1/s", 10 * np.log10(ray.spreading_area), 10 * np.log10(area), 1e-8, "dB")


def _printed():
    source, target, across, time, length, launch, arrival, spreading = np.transpose(SIX_NODE_RAYS)
    ray = eigenray(SIX_NODES, source, target, across)
    yield worst("six nodes: time", ray.travel_time, time, 1e-15, "s")
    yield worst("six nodes: arc length", ray.arc_length, length, 1e-11, "m")
    yield worst("six nodes: launch angle", np.degrees(ray.launch_angle), launch, 1e-11, "deg")
    yield worst("six nodes: arrival angle", np.degrees(ray.arrival_angle), arrival, 1e-11, "deg")
    yield worst("six nodes: spreading", 10 * np.log10(ray.spreading_area), spreading, 6e-9, "dB")
    for gradient, angle, back, time in TURNED:
        water = SoundSpeedProfile([0.0, 200.0], [1500.0, 1500.0 + 200 * gradient])
        ray = eigenray(water, 0.0, 0.0, back)
        yield Compared(f"turned ray, {gradient:g} 1/s: time", float(ray.travel_time), time, 2e-15 * max(1, 10 * time),
                       "s")
        yield Compared(f"turned ray, {gradient:g} 1/s: launch angle", float(np.degrees(ray.launch_angle)), angle, 1e-11,
                  "deg")


def _traced(count):
    """Return ranges [m] of traced hits on a rough bed, and their errors of time [s] and spreading [dB]."""
    from mitsonar.scene.loading import prepare

    prepare()
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of, upload
    from mitsonar.scene.geometry import Geometry
    from mitsonar.scene.tracing.tracer import Tracer
    from mitsonar.scene.tracing.water import DeviceWater

    geometry = Geometry(mi.load_dict({"type": "scene", "bed": {
        "type": "seabed", "depth": BED_DEPTH, "length": 400.0, "width": 400.0, "spacing": 1.0, "fractal_rms": 0.6,
        "fractal_gamma": 3.3, "fractal_outer_scale": 60.0}}, optimize=False))
    rng = np.random.default_rng(7)
    azimuth, angle = rng.uniform(0, 2 * np.pi, count), np.radians(rng.uniform(5, 90, count))
    way = np.cos(angle) * np.cos(azimuth), np.cos(angle) * np.sin(azimuth), -np.sin(angle)
    tracer = Tracer(geometry, DeviceWater(SUMMER), max_range=280.0)
    origin = arrays_of(mi.Float).Array3f64(0, 0, -SONAR_DEPTH)
    direction = mi.Vector3f(*(upload(mi.Float, axis.astype(np.float32)) for axis in way))
    hits = tracer.trace(tracer.sources([SONAR_DEPTH]), origin, mi.UInt32(0), direction)
    valid = hits.valid.numpy()
    x, y, z = hits.point.numpy()[:, valid]
    across = np.hypot(x, y)
    exact = eigenrays(SUMMER, SONAR_DEPTH, -z, across)
    # of several arrivals, that with the launch angle nearest to the traced ray's
    nearest = np.nanargmin(np.where(exact.exists, np.abs(exact.launch_angle - angle[valid, None]), np.inf), axis=1)
    arrival = np.arange(len(x)), nearest
    time = hits.travel_time.numpy()[valid] - exact.travel_time[arrival]
    ratio = hits.spreading_area.numpy()[valid] / exact.spreading_area[arrival]
    return across, time, 10 * np.log10(ratio)


def _run(quick):
    across, time, spreading = _traced(4000 if quick else 100_000)
    rows = (*_closed_forms(), *_printed(),
            worst("traced hit, summer cast: time", time, 0.0, 1e-9, "s"),
            Compared("traced hit, summer cast: time, median", float(np.median(np.abs(time))), 0.0, 1e-12, "s"),
            Compared("traced hit, summer cast: spreading, 99 % of hits", float(np.quantile(np.abs(spreading), 0.99)),
                     0.0, 0.005, "dB"))
    depth = np.linspace(0, 60, 241)
    reach = np.linspace(1, 270, 400)
    ray = eigenray(SIX_NODES, 3.0, 60.0, reach)
    some = slice(None, None, max(1, len(across) // 2000))
    return Table(rows, (
        Panel("two of the waters", "sound speed [m/s]", "depth [m]",
              (Curve("six nodes", SIX_NODES.at(depth), -depth), Curve("summer cast", SUMMER.at(depth), -depth))),
        Panel("six nodes, 3 m to 60 m deep", "horizontal range [m]", "spreading less that of a straight line [dB]",
              (Curve("eigenray", reach, 10 * np.log10(ray.spreading_area / (reach ** 2 + 57 ** 2))),
               Curve("printed", [ray[2] for ray in SIX_NODE_RAYS if ray[0] == 3],
                     [ray[7] - 10 * np.log10(ray[2] ** 2 + 57 ** 2) for ray in SIX_NODE_RAYS if ray[0] == 3], "."))),
        Panel("traced hits, summer cast, rough bed", "horizontal range [m]", "error of the time [s]",
              (Curve("", across[some], np.maximum(np.abs(time[some]), 1e-18), "."),), "y")))


CASE = Case(title="Rays: time, length, angles and spreading", run=_run, text=(
    "Eigenrays in water of one gradient g against closed forms, T = (2/g) asinh(g D / (2 √(c₁c₂))), arc length of a "
    "circle of radius 1/(p g), A = (c₂ sinh(g T)/g)² (Jensen, Kuperman, Porter and Schmidt, *Computational Ocean "
    "Acoustics*); in water of six nodes, and after turning, against numbers of 34-digit quadrature of Snell's law. "
    "The allowed errors are a few roundings of double precision, and the last printed digit of spreading. Then rays "
    "traced by Mitsuba on a rough bed 45 m deep through a summer cast, against the exact eigenray to each point hit: "
    "1 ns is 0.0005 cycle at 500 kHz. The error of spreading is largest beside the focus of a node of the cast."))
