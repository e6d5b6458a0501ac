"""Elements of an array that moves and turns while the echo is under way: a point target against the trajectory itself.

Every element e is, at the time t, at O(t) + R(t) d_e of a trajectory in closed form. An echo of the target at I leaves
the array's centre at the ping t_p and is heard at t_p + τ,

    τ = T(O(t_p), I) + T(I, O(t_p + τ) + R(t_p + τ) d_e),      found by fixed point, T of straight or exact eigenrays

and its pressure is that of the face at the attitude of t_p + τ towards I. Delays are the phases of responses of 1 MHz,
which fixes them within half a microsecond of the envelope's: brute force and this code agree in which cycle.

Tolerance 2 ns: the track is read every 0.1 s (0.3 ns by its spline), the vector approximation may leave 0.5 ns, sums of
the kernel 0.5 ns.
"""
import numpy as np
import pytest
from exhaustive import thinned
from summer import SUMMER, SUMMER_TEXT
from track_files import write_track

import mitsonar
from mitsonar.device.rotations import rotation_matrix
from mitsonar.propagation import eigenray
from mitsonar.sonar.arrays.element_patterns import element_pressure
from mitsonar.validation.scenes import array_sonar, buried_bed, point_target
from mitsonar.water import SoundSpeedProfile

F0, INTERVAL, PINGS = 1e6, 0.5, 4
ARMS = np.array([[0, 0, 0], [1, 0, 0], [-0.6, 0.8, 0], [0, -1, 0], [0.3, 0.3, 0.9], [0, 0, -1.0]])
WAVE = 2 * np.pi
WATERS = {"uniform": ("0:1500", SoundSpeedProfile.constant(1500.0)), "summer": (SUMMER_TEXT, SUMMER)}
# t -> x, y, z [m], roll, pitch, heading [rad], and where the target is
MOTIONS = {
    "heaving 0.3 m in 6 s": (lambda t: (0 * t, 1.5 * t, -10 + 0.3 * np.sin(WAVE * t / 6), 0 * t, 0 * t, 0 * t),
                             (70.0, 141.0, -24.0)),
    "rolling 8 degrees in 5 s": (lambda t: (0 * t, 1.5 * t, 0 * t - 10, np.radians(8) * np.sin(WAVE * t / 5), 0 * t,
                                            0 * t), (150.0, 50.0, -25.0)),
    "turning 10 degrees a second": (lambda t: (12 * (1 - np.cos(np.radians(10) * t)), 12 * np.sin(np.radians(10) * t),
                                               0 * t - 10, 0 * t, 0 * t, np.radians(10) * t), (60.0, -90.0, -26.0)),
}


def pose(motion, time):
    """Place (3,) and rotation (3, 3) at a time."""
    x, y, z, roll, pitch, heading = MOTIONS[motion][0](np.float64(time))
    return np.array([x, y, z]), rotation_matrix(roll, pitch, heading)


def travel_time(water, place, point):
    across = np.hypot(*(point - place)[:2])
    return float(eigenray(water, -place[2], np.array([-point[2]]), np.array([across])).travel_time[0])


def echo_of(water, motion, ping, element, sender=(0, 0, 0)):
    """Delay of the echo at an element [s], and place and rotation of the sonar when it arrives."""
    point, (start, attitude) = np.array(MOTIONS[motion][1]), pose(motion, ping * INTERVAL)
    out = travel_time(water, start + attitude @ sender, point)
    delay = 2 * out
    for _ in range(6):
        place, rotation = pose(motion, ping * INTERVAL + delay)
        delay = out + travel_time(water, place + rotation @ element, point)
    return delay, place, rotation


def sailing(tmp_path, motion, profile, shapes=None, **sensor):
    """A scene whose sonar follows one of the motions, read every tenth of a second."""
    time = np.arange(-1.0, PINGS * INTERVAL + 1.0, 0.1)
    x, y, z, *angles = MOTIONS[motion][0](time)
    rows = np.column_stack([time, x, y, z, *np.degrees(angles)])[time >= -1e-9]
    np.savetxt(tmp_path / "elements.csv", ARMS, delimiter=",", header="x,y,z", comments="")
    point = MOTIONS[motion][1]
    away = np.linalg.norm(point)
    return array_sonar(
        {"bed": buried_bed(40.0), "buoy": point_target(point), **(shapes or {})}, integrator={"cell": 4.0},
        sensor={"frequency_khz": F0 / 1000, "track": write_track(tmp_path / "track.csv", rows),
                "ping_rate_hz": 1 / INTERVAL, "receive": "file", "receive_file": str(tmp_path / "elements.csv"),
                **sensor},
        water={"absorption_db_per_km": 0.0, "profile": profile},
        film={"range": away + 8, "range_min": away - 8, "sample_rate_khz": 30.0})


@pytest.mark.parametrize("water, return_path", thinned(
    [(water, way) for water in WATERS for way in ("vector", "eigenray")],
    ("uniform", "vector"), ("summer", "eigenray")))
@pytest.mark.parametrize("motion", MOTIONS)
def test_echoes_meet_elements_where_the_trajectory_has_them(variant, tmp_path, motion, water, return_path):
    profile, exact = WATERS[water]
    response = mitsonar.impulse_response(sailing(tmp_path, motion, profile), range(PINGS), return_path=return_path)
    found = response.values[:, 0].astype(complex).sum(-1)
    wanted = np.array([[echo_of(exact, motion, ping, arm)[0] for arm in ARMS] for ping in range(PINGS)])
    late = np.angle(found * np.exp(2j * np.pi * F0 * wanted)) / (-2 * np.pi * F0)
    assert np.abs(late).max() < 2e-9


@pytest.mark.parametrize("fans", ["centre", "elements"])
@pytest.mark.parametrize("water", WATERS)
def test_what_an_outer_element_sends_is_heard_where_the_array_is_then(variant, tmp_path, water, fans):
    """Sent a metre farther off, an echo comes 0.6 ms later, and the array is 3 mm further on."""
    profile, exact = WATERS[water]
    motion, senders = "turning 10 degrees a second", np.array([[0.8, 0.6, 0], [-1, 0, 0], [0, 0, 0.9]])
    np.savetxt(tmp_path / "senders.csv", senders, delimiter=",", header="x,y,z", comments="")
    scene = sailing(tmp_path, motion, profile, transmit="file", transmit_file=str(tmp_path / "senders.csv"))
    if fans != "centre":
        scene.integrator().fans = fans
    found = mitsonar.impulse_response(scene, range(2)).values.astype(complex).sum(-1)
    wanted = np.array([[[echo_of(exact, motion, ping, arm, sender)[0] for arm in ARMS] for sender in senders]
                       for ping in range(2)])
    late = np.angle(found * np.exp(2j * np.pi * F0 * wanted)) / (-2 * np.pi * F0)
    assert np.abs(late).max() < 2e-9


FACE = {"pattern": "rectangular", "element_length": 0.02, "element_height": 0.01}


@pytest.mark.parametrize("return_path", ["vector", "eigenray"])
def test_faces_look_where_the_trajectory_has_turned_them(variant, tmp_path, return_path):
    """A face of 13 wavelengths has turned by 1.5 degrees of its 3.8 when the echo is there: 2 to 8 dB."""
    motion = "turning 10 degrees a second"
    sensor = {f"receive_{name}": value for name, value in FACE.items()}
    scene = sailing(tmp_path, motion, "0:1500", receive_normal="0.2, 1, 0.1", **sensor)
    array = scene.sensors()[0].receive
    exact, point = WATERS["uniform"][1], np.array(MOTIONS[motion][1])
    found = np.abs(mitsonar.impulse_response(scene, range(PINGS), return_path=return_path).values[:, 0].sum(-1))
    wanted = np.empty_like(found)
    for ping in range(PINGS):
        for row, arm in enumerate(ARMS):
            delay, place, rotation = echo_of(exact, motion, ping, arm)
            way = (point - place - rotation @ arm) @ rotation
            length = np.linalg.norm(way)
            seen = element_pressure(way / length, 1500 / F0, array.normal[row], array.along[row], length=0.02,
                                    height=0.01, pattern="rectangular")
            out = np.linalg.norm(point - pose(motion, ping * INTERVAL)[0])
            wanted[ping, row] = abs(seen) / (out * length)
    assert found == pytest.approx(wanted, rel=0.004, abs=0.002 * float(wanted.max()))
