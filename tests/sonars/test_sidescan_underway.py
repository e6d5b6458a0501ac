"""A sidescan that moves and turns until its echoes are back, against brute force in water of one speed.

NumPy has its own trajectory, in closed form, which the scene is given as poses 0.02 s apart. An echo of the point I,
sent at t_0 from P(t_0), is back when

    t = (|I - P(t_0)| + |I - P(t)|) / c

and has the transmitting pattern towards I at t_0 and the receiving one towards I from P(t), held as at t.
"""
from dataclasses import dataclass, replace

import mitsuba as mi
import numpy as np
import pytest
from mean_intensity import render
from scipy.integrate import cumulative_trapezoid, trapezoid
from track_files import write_track

from mitsonar.propagation import eigenray, return_time
from mitsonar.survey.energy.energy import record
from mitsonar.survey.energy.sides import Sides
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.units import KNOT
from mitsonar.validation.scenes import bed, buried_bed, sidescan

pytestmark = pytest.mark.filterwarnings("ignore:the track is cut")     # poses go on after the last ping
C, ALPHA = 1500.0, 0.030
INTERVAL = 0.25                                                          # [s] between pings
SUMMER = "0:1508, 5:1507.5, 12:1499, 25:1491, 40:1489.5, 60:1490.5"
OMNI = {"vertical_beam_width_deg": 180.0}


@dataclass
class Way:
    """P = (east, north, up) from coefficients of t, and sines of 2 s period in heave, roll, pitch and yaw."""

    speed: float = 0.0
    turn: float = 0.0
    heave: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0
    arm: tuple = (0.0, 0.0, 0.0)

    def pose(self, t):
        """Position of where the track leads (..., 3), and roll, pitch, heading (..., 3) [rad]."""
        t = np.asarray(t, float)
        swing = np.sin(2 * np.pi * t / 2.0 + 0.3)
        position = np.stack([0 * t, self.speed * t, -20 + self.heave * swing], -1)
        return position, np.stack([self.roll * swing, self.pitch * swing, self.yaw * swing + self.turn * t], -1)

    def sonar(self, t):
        """Position and axes (..., 3, 3) of the sonar: rows forward, starboard, down, in the scene."""
        position, angles = self.pose(t)
        (sr, cr), (sp, cp), (sh, ch) = ((np.sin(a), np.cos(a)) for a in np.moveaxis(angles, -1, 0))
        one, no = np.ones_like(sr), np.zeros_like(sr)

        def matrix(*rows):
            return np.stack([np.stack(row, -1) for row in rows], -2)

        turned = matrix((ch, -sh, no), (sh, ch, no), (no, no, one)) @ matrix((cp, no, sp), (no, one, no), (-sp, no, cp))
        turned = turned @ matrix((one, no, no), (no, cr, -sr), (no, sr, cr))
        axes = np.swapaxes(turned, -1, -2)[..., [1, 0, 2]] * [1, 1, -1]  # north-east-down to east-north-up
        return position + np.einsum("...kx,k->...x", axes, self.arm), axes

    def file(self, path, pings):
        """Write the poses of a second before the first ping to one after the last: the first ping is at that start."""
        t = np.arange(0, INTERVAL * pings + 0.5, 0.02)
        position, angles = self.pose(t)
        rows = np.column_stack([t, position, np.degrees(angles)])
        return write_track(path, rows)


def echoes_of(way, t0, points, signs=(1, 1)):
    """Delay [s], body directions (..., 3) at transmission and reception, and ranges out and back [m], of points.

    A sign of -1 has that leg go by way of the surface, z = 0: towards the point's image.
    """
    origin, axes = way.sonar(t0)
    first, last = (points * [1, 1, sign] for sign in signs)
    out = np.linalg.norm(first - origin, axis=-1)
    delay = 2 * out / C
    for _ in range(3):
        place, then = way.sonar(t0 + delay)
        back = np.linalg.norm(last - place, axis=-1)
        delay = (out + back) / C
    sent = np.einsum("kx,...x->...k", axes, first - origin) / out[..., None]
    heard = np.einsum("...kx,...x->...k", then, last - place) / back[..., None]
    return delay, sent, heard, out, back


def pattern(sonar, sent, heard):
    """Two-way intensity of the faces on the sides that the points are on; 0 where they change the side."""
    sine, cosine = np.sin(sonar.depression_angle), np.cos(sonar.depression_angle)
    product = 1.0
    for face, body in ((sonar.transmit, sent), (sonar.receive, heard)):
        across = body[..., 2] * cosine - np.abs(body[..., 1]) * sine
        product = product * np.sinc(face.length / sonar.wavelength * body[..., 0]) ** 2 * np.sinc(
            face.height / sonar.wavelength * across) ** 2
    return product * (sent[..., 1] * heard[..., 1] > 0)


def fan(way, t0, side, depth):
    """Horizontal ranges (X,), azimuths (A,), and points (A, X, 3) of a flat bed in the beam of a side."""
    origin, axes = way.sonar(t0)
    off = np.linspace(-1, 1, 601)
    azimuth = np.arctan2(axes[0, 0], axes[0, 1]) + (side - 0.5) * np.pi + np.sign(off) * np.abs(off) ** 3 * 1.5
    x = np.linspace(0.5, 110, 800)
    points = np.stack(np.broadcast_arrays(x * np.sin(azimuth)[:, None] + origin[0],
                                          x * np.cos(azimuth)[:, None] + origin[1], -depth), -1)
    return x, azimuth, points


def gated(power, delay, x, azimuth, edges):
    """∫∫ power dA between delays `edges` [s]."""
    total = cumulative_trapezoid(power * x, x, initial=0)
    return trapezoid([np.diff(np.interp(edges, *one)) for one in zip(delay, total)], azimuth, axis=0)


def bed_levels(way, t0, sonar, edges, side, depth=40.0, mu=10 ** -2.7):
    """Intensity [µPa²] in bins between delays `edges` [s] of a flat Lambert bed."""
    x, azimuth, points = fan(way, t0, side, depth)
    delay, sent, heard, out, back = echoes_of(way, t0, points)
    power = (pattern(sonar, sent, heard) * mu * ((depth + way.sonar(t0)[0][2]) / out) ** 2 * out ** -2.0
             * back ** -2.0 * 10 ** (-0.1 * ALPHA * (out + back)))
    share = min(1, sonar.pulse_length / (edges[1] - edges[0]))
    return 10 ** (sonar.source_level_db / 10) * gated(power, delay, x, azimuth, edges) * share


WAYS = {"8 knots": Way(speed=8 * KNOT), "yaw": Way(speed=2.0, yaw=np.radians(4.0)),
        "roll and pitch": Way(roll=np.radians(12.0), pitch=np.radians(5.0)),
        "turning about an arm": Way(speed=2.0, turn=np.radians(-8.0), arm=(-1.0, 0.5, 0.3))}


def scene_of(way, tmp_path, shapes, *, pings=4, sensor=None, **more):
    track = {"track": way.file(tmp_path / "track.csv", pings), "pings": pings, "ping_rate_hz": 1 / INTERVAL,
             "offset": ", ".join(map(str, way.arm)), "beam_width_deg": 1.5}
    return sidescan(shapes, sensor=track | (sensor or {}), **more)


@pytest.mark.parametrize("name", ["yaw", "roll and pitch", "turning about an arm"])
def test_levels_of_a_bed_are_those_of_the_beams_at_transmission_and_reception(name, tmp_path):
    """Gates of 2 m from 28 m on; Monte-Carlo noise is 0.02 dB, 0.05 where the lobes are apart."""
    way = WAYS[name]
    scene = scene_of(way, tmp_path, {"seabed": bed(40.0)}, film={"bins": 50}, rays=400_000)
    dataset, _, _ = render(scene)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    edges = np.arange(51) * 4.0 / C
    found = 10 ** (dataset["mean_level"].values.astype(float) / 10)
    for ping, side in ((0, 0), (1, 1), (3, 1)):
        expected = bed_levels(way, INTERVAL * ping, sonar, edges, side)
        off = 10 * np.log10(found[ping, side, 14:49] / expected[14:49])
        assert np.abs(off).max() < 0.2
        assert abs(off.mean()) < 0.02


def test_eight_knots_cost_a_beam_of_a_degree_and_a_half_what_its_lobes_overlap_less():
    """∫ b_t²(u) b_r²(u + 2v/c) du / ∫ b_t² b_r² du, -0.296 dB at 1500 m/s, of bed and water at all ranges.

    By way of a mirroring surface one leg is that to the image, and the loss that of a sum over the bed.
    """
    shapes = {"seabed": bed(40.0), "sea": {"type": "sea_surface", "wind_speed": 0.0, "size": 800.0}}
    edges = np.array([40.0, 70.0, 100.0]) * 2 / C
    means, mirrored = [], []
    for speed in (0.0, 8.0):
        scene = sidescan(shapes, water={"volume_strength_db": -60.0}, rays=200_000, film={"bins": 200},
                         sensor={"speed_knots": speed, "beam_width_deg": 1.5, "pings": 4, **OMNI})
        survey = replace(scene.integrator().survey(scene, scene.sensors()[0]), max_depth=2)
        power = record(survey, Sides(survey), 3).path_intensity[..., 80:].mean((0, 1), dtype=float)
        means.append(dict(zip(survey.paths.names, power.reshape(len(power), 2, -1).sum(-1))))
        # out straight, back to the image, and the other way round, in time and pattern
        way, total = Way(speed=speed * KNOT), 0.0
        x, azimuth, points = fan(way, 0.0, 1, 40.0)
        for first, last in ((1, -1), (-1, 1)):
            delay, sent, heard, out, back = echoes_of(way, 0.0, points, (first, last))
            power = pattern(survey.sonar, sent, heard) * (out * back) ** -3.0 * 10 ** (-0.1 * ALPHA * (out + back))
            total = total + gated(power, delay, x, azimuth, edges)
        mirrored.append(total)
    u = np.linspace(-0.5, 0.5, 200_001)
    b = [np.sinc(survey.sonar.transmit.length / survey.sonar.wavelength * (u + shift)) ** 2
         for shift in (0, 2 * 8 * KNOT / C)]
    expected = 10 * np.log10((b[0] * b[1]).sum() / (b[0] * b[0]).sum())
    assert expected == pytest.approx(-0.296, abs=0.001)
    loss = {name: 10 * np.log10(means[1][name] / means[0][name]) for name in ("b", "v", "bs")}
    np.testing.assert_allclose(loss["b"], expected, atol=0.01)
    np.testing.assert_allclose(loss["v"], expected, atol=0.02)
    np.testing.assert_allclose(loss["bs"], 10 * np.log10(mirrored[1] / mirrored[0]), atol=0.02)


TARGETS = np.array([(40.0, 0.5, -30.0), (-60.0, 1.0, -25.0), (75.0, -0.5, -38.0)])
RIDES = {**WAYS, "heave": Way(speed=2.0, heave=0.5), "yaw of an arm": Way(yaw=np.radians(4.0), arm=(3.0, 0.0, 1.0))}


@pytest.mark.parametrize("name", RIDES)
def test_delays_and_energies_of_point_targets(name, tmp_path):
    """Delays to 0.1 ns, from phases at 100 kHz, of targets on whose ranges up to 40 µs are lost; energies to 0.01 dB,
    and to the 2 d/D by which the return leg is longer than the way out, whose spreading it is taken to have."""
    way = RIDES[name]
    shapes = {f"ball {i}": {"type": "point_target", "position": list(target), "target_strength_db": 0.0}
              for i, target in enumerate(TARGETS)}
    scene = scene_of(way, tmp_path, {"bed": buried_bed(45.0, size=800.0), **shapes}, film={"bins": 4000}, rays=2000,
                     sensor={"beam_width_deg": 3.0})
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    echoes, seen = record(survey, Sides(survey)), 0
    for ping, target in ((ping, target) for ping in range(4) for target in TARGETS):
        delay, sent, received, out, back = echoes_of(way, INTERVAL * ping, target)
        beam = pattern(survey.sonar, sent, received)
        if beam < 0.01:
            continue
        seen += 1
        bin, row = int((delay - survey.window[0]) / survey.bin_length), (ping, int(target[0] > 0))
        turned = echoes.coherent.pressure[row][bin, 0] * np.exp(2j * np.pi * 1e5 * delay)
        assert abs(np.angle(turned)) < 2 * np.pi * 1e5 * 1e-10
        energy = echoes.coherent.intensity[row][bin - 4:bin + 5].sum() * survey.bin_length
        expected = beam / (out * back) ** 2 * 10 ** ((survey.sonar.source_level_db - ALPHA * (out + back)) / 10)
        assert energy / (expected * survey.sonar.pulse_length) == pytest.approx(1, abs=2e-3 + 3 * abs(back / out - 1))
    assert seen >= 4


def test_delays_in_layered_water_are_those_of_exact_rays_to_where_the_sonar_is_then(tmp_path):
    """A summer's water, 8 knots and a climb of 0.5 m/s, against the eigenrays of `return_time`: 2 ns."""
    velocity, t = np.array([0.0, 8 * KNOT, 0.5]), np.arange(0, 1.01, 0.05)
    (tmp_path / "track.csv").write_text("time,x,y,z,heading\n" + "".join(
        f"{now},0,{velocity[1] * now},{velocity[2] * now - 20},0\n" for now in t))
    shapes = {f"ball {i}": {"type": "point_target", "position": list(target), "target_strength_db": 0.0}
              for i, target in enumerate(TARGETS)}
    scene = sidescan({"bed": buried_bed(45.0, size=800.0), **shapes}, water={"profile": SUMMER}, film={"bins": 4000},
                     rays=2000, sensor={"track": str(tmp_path / "track.csv"), "pings": 2, "ping_rate_hz": 4.0, **OMNI})
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    z, water = record(survey, Sides(survey)).coherent.pressure[..., 0], survey.waters.only.profile
    for ping, target in ((ping, target) for ping in range(2) for target in TARGETS):
        origin = survey.track.position[ping]
        out = eigenray(water, -origin[2], -target[2], np.hypot(*(target - origin)[:2])).travel_time
        delay = float(out + return_time(water, origin, [target], [[0, 0, 0]], velocity, "eigenray")[0, 0])
        found = z[ping, int(target[0] > 0), int((delay - survey.window[0]) / survey.bin_length)]
        error = np.angle(found * np.exp(2j * np.pi * 1e5 * delay)) / (2 * np.pi * 1e5)
        # pressures behind the first side lobe's edge are negative
        assert min(abs(error), abs(abs(error) - 5e-6)) < 2e-9


@pytest.mark.parametrize("degrees", [0.0, 0.25])
def test_a_smooth_plate_shines_towards_where_the_sonar_is_then(degrees, tmp_path):
    """A rigid plate of 1.5 m abeam, with a lobe of half a degree at 100 kHz: Kirchhoff's integral in steps of 5 mm,
    every point at its own delay, k/4π (n·u_out + n·u_back) / (r_out r_back). To 0.1 dB; for a sonar that stood still it
    would be 1.5 dB less, or more if the plate is askew."""
    way, centre, tilt = WAYS["8 knots"], np.array([40.0, 0.1, -30.0]), np.radians(degrees)
    across = np.array([-np.sin(tilt), np.cos(tilt), 0.0])
    normal = np.array([-40.0, 0.0, 10.0]) / np.hypot(40, 10)
    normal -= across * (across @ normal)
    normal /= np.linalg.norm(normal)
    up = np.cross(normal, across)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = 0.75 * across, 0.25 * up, normal, centre
    plate = {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix), "bsdf": {"type": "rigid"}}
    scene = scene_of(way, tmp_path, {"bed": buried_bed(45.0, size=800.0), "plate": plate}, film={"bins": 4000},
                     rays=2000, sensor={"beam_width_deg": 3.0, "pulse_ms": 1.0, **OMNI}, pings=2)
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    z = record(survey, Sides(survey)).coherent.pressure[..., 0]
    steps = np.stack(np.meshgrid((np.arange(300) + 0.5) / 300 - 0.5, (np.arange(100) + 0.5) / 100 - 0.5), -1)
    points = centre + 1.5 * steps[..., :1] * across + 0.5 * steps[..., 1:] * up
    off = []
    for moves in (way, Way()):
        delay, sent, received, out, back = echoes_of(moves, 0.0, points)
        shone = 0.0
        for body, t in ((sent, 0 * delay), (received, delay)):
            shone = shone + np.einsum("...k,...kx,x->...", -body, moves.sonar(t)[1], normal)
        echo = (np.sqrt(pattern(survey.sonar, sent, received)) * 1e5 / (2 * C) * shone / (out * back) * 10 ** (
            -ALPHA * (out + back) / 20) * np.exp(-2j * np.pi * 1e5 * delay)).sum() * 1.5 * 0.5 / steps[..., 0].size
        bin = int((delay.mean() - survey.window[0]) / survey.bin_length)
        off.append(20 * np.log10(abs(z[0, 1, bin] / echo)) - survey.sonar.source_level_db)
    assert off[0] == pytest.approx(0, abs=0.1)
    assert off[1] == pytest.approx(1.7 if degrees else -1.5, abs=0.2)


def test_the_place_of_a_bin_is_half_way_between_the_lobes(tmp_path):
    """At 8 knots the seabed that a bin shows lies v t / 2 ahead of where the ping was sent."""
    scene = scene_of(WAYS["8 knots"], tmp_path, {"seabed": bed(40.0)}, film={"bins": 50}, rays=200_000)
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    echoes = record(survey, Sides(survey))
    time = (np.arange(50) + 0.5) * 4.0 / C
    ahead = echoes.truth.seabed_place[..., 1] - survey.track.position[:, 1][:, None, None]
    assert np.abs(ahead[..., 20:] - 4 * KNOT * time[20:]).max() < 0.02
    assert (echoes.rays_in_beam[..., 20:] > 0).all()


def test_a_sonar_that_turns_by_a_beam_during_a_ping_needs_no_more_rays(tmp_path):
    """Errors of pings' levels are as small as those of a sonar that stands still, and half as much again at most."""
    way = Way(turn=np.radians(15.0))
    spread = []
    for at in (way, Way()):
        scene = scene_of(at, tmp_path, {"seabed": bed(40.0)}, film={"bins": 50}, rays=20_000, pings=40,
                         sensor=OMNI)
        survey = scene.integrator().survey(scene, scene.sensors()[0])
        intensity = record(survey, Sides(survey)).intensity[..., 14:49]
        spread.append((intensity.std((0, 1)) / intensity.mean((0, 1))).mean())
    assert spread[0] < 1.5 * spread[1]


def test_a_platform_at_rest_is_not_under_way():
    """There is no motion that the kernel would look up."""
    scene = sidescan({"seabed": bed(40.0)}, sensor={"heading_deg": 33.0})
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    underway = Sides(survey).underway
    assert not underway.moves and underway.motion(np.arange(2)) is None and underway.drift(C) == 0
    assert underway.along_shifts(survey.track.rotation(), C, 0.01)[1] == [0]
