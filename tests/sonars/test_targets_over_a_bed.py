"""Targets over a bed that reflects: three more echoes, of the target's image in the bed.

With s the sonar, p the target, p' its image below the plane of the bed, d = |p - s|, D = |p' - s|, k = 2πf/c,

    b: f exp(-2ikd)/d²,    bb: 2 f V exp(-ik(d + D))/(d D),    bbb: f V² exp(-2ikD)/D²,
    V = R(θ) exp(-2 (k h sin θ)²),    h² = 2π w2 K^(2 - γ)/(γ - 2),    K = π/√(λ l_1 l_2/(l_1 + l_2))

R Rayleigh's coefficient (Fluid, its conjugate), θ the angle that the way to p' makes with the plane, l_1 and l_2 its
parts. Tolerances: 1e-5 of a point, whose gains are float32; 1 dB of a sphere, which is a/2 times exp(2ika cos β/2) for
an angle of β between both ways but for physical optics at ka = 17, whose shadow's edge adds 1/ka. In bent water the
time is the least over the places of the bounce, of exact eigenrays: 0.2 ns.
"""
import mitsuba as mi
import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from sonar_scenes import array_sonar, bed, forward_looking, lambert, point_target, sidescan

import mitsonar
from mitsonar.scattering import Sediment
from mitsonar.scene.tracing.connection import Connector
from mitsonar.survey.pressure.pressure import PressureRecord

SONAR, SPEED, DEPTH, STRENGTH_DB = np.array([0.0, 0.0, -10.0]), 1500.0, 20.0, -20.0


def sand(**parameters):
    return {"type": "sediment", "sediment": "medium sand", **parameters}


def scene_of(target, *, material=None, kilohertz=20.0, max_depth=3, water=None, tilt=0.0, **more):
    shapes = {"seabed": bed(DEPTH, material or sand(w2=1e-9), size=200.0, tilt=tilt), "ball": target, **more}
    return array_sonar(shapes, film={"range": 60.0}, sensor={"frequency_khz": kilohertz},
                       water={"absorption_db_per_km": 0.0, **(water or {})},
                       integrator={"max_depth": max_depth, "cell": 20.0, "rays": 16})


def echoes_of(scene):
    """Pressures at the sonar and times of the echoes that owe nothing to chance, by path, ways alike together."""
    survey, found = scene.integrator().array_survey(scene, scene.sensors()[0]), {}
    for _, echoes in PressureRecord(survey).ensonification(0).coherent_echoes(SONAR):
        time = (echoes.arrival + echoes.back.travel_time).numpy()
        amplitude = echoes.amplitude[0].numpy() + 1j * echoes.amplitude[1].numpy()
        found.setdefault(echoes.path, []).append(((amplitude * np.exp(-2j * np.pi * survey.frequency * time)).sum(),
                                                  time.mean()))
    return {path: (sum(z for z, _ in some), some[0][1]) for path, some in found.items()}


def expected(place, image, normal, *, kilohertz=20.0, **parameters):
    """Pressures by path, of a point of strength 1."""
    sediment = Sediment.of("medium sand", **parameters)
    d, D = (np.linalg.norm(end - SONAR) for end in (place, image))
    k, height = 2e3 * np.pi * kilohertz / SPEED, 0.5 * np.linalg.norm(place - image)
    sine = normal @ (SONAR - image) / D
    last = height / sine
    cut = np.pi / np.sqrt(2 * np.pi / k * (D - last) * last / D)
    rough = 2 * np.pi * sediment.w2 * cut ** (2 - sediment.gamma) / (sediment.gamma - 2)
    wave = (1 + 1j * sediment.loss) / sediment.sound_speed_ratio
    below = np.sqrt(wave ** 2 - 1 + sine ** 2) / sediment.density_ratio
    thrown = np.conj((sine - below) / (sine + below)) * np.exp(-2 * k ** 2 * rough * sine ** 2)
    return {"b": np.exp(-2j * k * d) / d ** 2, "bb": 2 * thrown * np.exp(-1j * k * (d + D)) / (d * D),
            "bbb": thrown ** 2 * np.exp(-2j * k * D) / D ** 2}


@pytest.mark.parametrize("height, w2, tilt", [(0.0375, 1e-9, 0.0), (0.5, 1e-4, 0.0), (3.0, 3e-4, 0.15)])
def test_a_point_is_heard_four_times(variant, height, w2, tilt):
    """From half a wavelength up; over a rough bed, and over one that leans towards the sonar."""
    slope = np.tan(tilt)
    normal = np.array([slope, 0, 1]) / np.hypot(slope, 1)
    foot = np.array([-20.0, 15.0, -DEPTH + 20.0 * slope])
    place, image = foot + height * normal, foot - height * normal
    found = echoes_of(scene_of(point_target(place, STRENGTH_DB), material=sand(w2=w2), tilt=tilt))
    wanted = expected(place, image, normal, w2=w2)
    assert set(found) == set(wanted)
    for path, pressure in wanted.items():
        assert abs(found[path][0] - 0.1 * pressure) < 3e-4 * 0.1 * abs(pressure), path


def test_bounces_are_counted(variant):
    ball = point_target([0.0, 30.0, -19.0], STRENGTH_DB)
    assert set(echoes_of(scene_of(ball, max_depth=1))) == {"b"}
    assert set(echoes_of(scene_of(ball, max_depth=2))) == {"b", "bb"}


@pytest.mark.parametrize("height", [0.5, 2.0])
def test_a_rigid_sphere_interferes_with_its_image(variant, height):
    """The sum at three frequencies of a fringe, over which the image goes in and out of phase."""
    radius, place = 0.2, np.array([0.0, 30.0, -DEPTH + height])
    image, up = place * [1, 1, -1] - [0, 0, 2 * DEPTH], np.array([0, 0, 1.0])
    towards = [end / np.linalg.norm(end) for end in (place - SONAR, (image - SONAR) * [1, 1, -1] )]
    found, wanted = [], []
    fringe = 1e-3 * SPEED / np.subtract(*(np.linalg.norm(end - SONAR) for end in (image, place)))
    for kilohertz in 20.0 + fringe * np.array([0.0, 1 / 3, 2 / 3]):
        ball = {"type": "sphere", "center": list(place), "radius": radius, "bsdf": {"type": "rigid"}}
        heard = echoes_of(scene_of(ball, kilohertz=kilohertz))
        k = 2e3 * np.pi * kilohertz / SPEED
        both = {"b": 1.0, "bbb": 1.0, "bb": np.sqrt(0.5 + 0.5 * towards[0] @ towards[1])}
        terms = {path: 0.5 * radius * z * np.exp(2j * k * radius * both[path])
                 for path, z in expected(place, image, up, kilohertz=kilohertz, w2=1e-9).items()}
        for path, term in terms.items():
            assert abs(20 * np.log10(abs(heard[path][0] / term))) < 1.0, path
        found.append(sum(z for z, _ in heard.values()))
        wanted.append(sum(terms.values()))
    found, wanted = np.array(found), np.array(wanted)
    assert np.abs(found - wanted).max() < 0.15 * np.abs(wanted).max()


def test_the_bounce_is_where_it_takes_least_time_in_bent_water(variant):
    water = {"profile": "0:1500, 15:1503, 19.5:1501, 22:1500, 40:1490"}
    place = np.array([0.0, 30.0, -18.0])
    scene = scene_of(point_target(place, STRENGTH_DB), water=water)
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    connector, nothing = Connector(*survey.surroundings), mi.Vector3f(0, 0, 0)

    def time(start, end):
        start, end = (connector.lib.Array3f64(*(mi.Float64(float(v)) for v in point)) for point in (start, end))
        return float(connector.join(start, nothing, end, nothing, occlusion=False).travel_time[0])

    straight = time(SONAR, place)
    bounced = minimize_scalar(lambda y: time(SONAR, [0, y, -DEPTH]) + time([0, y, -DEPTH], place), bounds=(1, 29.9),
                              method="bounded", options={"xatol": 1e-6}).fun
    found = echoes_of(scene)
    for path, wanted in (("b", 2 * straight), ("bb", straight + bounced), ("bbb", 2 * bounced)):
        assert found[path][1] == pytest.approx(wanted, abs=2e-10), path


def test_beds_without_a_coefficient_and_targets_that_lie_on_the_bed_have_no_image(variant):
    hanging, lying = (point_target([0.0, 30.0, -DEPTH + height], STRENGTH_DB) for height in (1.0, 0.01))
    assert set(echoes_of(scene_of(hanging, material=lambert()))) == {"b"}
    assert set(echoes_of(scene_of(lying))) == {"b"}


def test_a_wall_or_a_box_at_the_bounce_hides_it(variant):
    """A wall between bounce and target; one that the sound passes over before the bounce does not."""
    place = np.array([0.0, 30.0, -19.0])
    for y in (29.0, 20.0):                      # the bounce is at 27.3, the straight way 1.3 and 4 m up
        matrix = mi.ScalarTransform4f().translate([0, y, -19.55]).scale([5, 0.02, 0.45])
        wall = {"type": "cube", "to_world": matrix, "bsdf": lambert()}
        found = echoes_of(scene_of(point_target(place, STRENGTH_DB), wall=wall))
        assert found["b"][0] != 0
        assert ("bb" in found) == (y == 20.0)
    matrix = mi.ScalarTransform4f().translate([0, 27.27, -19.98]).scale([1, 1, 0.01])
    box = {"type": "cube", "to_world": matrix, "bsdf": lambert()}
    assert set(echoes_of(scene_of(point_target(place, STRENGTH_DB), box=box))) == {"b"}


def test_a_bed_that_is_rough_in_its_mesh_throws_on_less(variant):
    """A mesh of random heights of 1 cm: σ counts as the material's roughness does. 61 spots tell it to 10 %."""
    from mitsonar.echoes.sights.bed_planes import BedPlanes
    from mitsonar.scene.geometry import Geometry

    mesh = {"type": "seabed", "depth": DEPTH, "length": 30.0, "width": 30.0, "spacing": 0.1, "fractal_rms": 0.01,
            "fractal_outer_scale": 1.0, "bsdf": sand()}
    geometry = Geometry(array_sonar({"seabed": mesh, "ball": point_target([0.0, 5.0, -19.0], STRENGTH_DB)}))
    label = next(number for number, name in geometry.labels.items() if name == "ball")
    a, b, c, rest, known = BedPlanes(geometry).table[label]
    assert known and abs(a + DEPTH) < 0.05 and max(abs(b), abs(c)) < 0.02
    assert 0.002 < rest < 0.02


def test_pictures_and_sidescans_hear_the_image(variant):
    """A picture has more echoes of a point, and a sidescan has them by their paths."""
    place = np.array([0.0, 12.0, -18.5])
    ball = point_target(place, 0.0)

    def loudest(depth):
        scene = forward_looking({"seabed": bed(DEPTH, sand(w2=1e-9, volume_parameter=0.0), size=60.0), "ball": ball},
                                sensor={"pings": 1, "vertical_beam_width_deg": 180.0, "frequency_khz": 200.0,
                                        "bandwidth_khz": 10.0, "receive_elements": 32, "beams": 32},
                                film={"range": 20.0}, integrator={"max_depth": depth})
        return 10 ** (mitsonar.render(scene)["level"].values[0].astype(float) / 10)

    one, three = loudest(1), loudest(3)
    assert three.sum() > 1.5 * one.sum()
    at = 36.0 * np.array([1.0, 0, 0]) + [0, 0, -19.0]
    scene = sidescan({"seabed": bed(DEPTH, sand(w2=1e-9)), "ball": point_target(at, STRENGTH_DB)}, depth=10.0, pings=1,
                     rays=400, sensor={"vertical_beam_width_deg": 180.0}, integrator={"max_depth": 3})
    image = mitsonar.render(scene)
    level = [image["path_level"].sel(path_name=name).values[0, 1].astype(float) for name in ("b", "bb", "bbb")]
    power = [10 ** (some / 10) for some in level]
    near = np.abs(image["range"].values - np.linalg.norm(at - SONAR)) < 1.5
    assert power[1][near].max() > 0.5 * power[2][near].max() > 0
