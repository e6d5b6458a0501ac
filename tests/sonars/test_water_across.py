"""Water that changes across the track: times of hits, targets and elements are those of exact eigenrays.

Exact eigenrays are those of `tests/propagation/test_frozen_ray`, by shooting: a thermocline of 8 m/s at 15 m, a front,
a gradient or an internal wave along x. The sonar is at 5 m depth, targets at 30 m, 100 and 200 m away, elements within
0.5 m. Two-way, the field adds 7 to 180 µs, and 2 to 450 ns between elements. Bounds are twice the measured errors.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.propagation import eigenray
from mitsonar.propagation.returns.frozen_ray import FrozenLeg, frozen_ray
from mitsonar.water import SoundSpeedProfile
from tests.inputs.sonar_scenes import (
    array_sonar,
    bed,
    buried_bed,
    interferometric,
    multibeam,
    point_target,
    sidescan,
)
from tests.propagation.test_frozen_ray import NODES, exact, speed

WATER = {"profile": ", ".join(f"{z:g}:{speed(z):.9g}" for z in NODES[::4])}
PROFILE_OF_SCENES = SoundSpeedProfile(NODES[::4], speed(NODES[::4]))
FIELDS = {"front": {"field": "front", "field_x": 100.0, "field_change": 2.0, "field_width": 60.0},
          "gradient": {"field": "gradient", "field_gradient": 0.01},
          "internal wave": {"field": "internal_wave", "field_x": 100.0, "field_height": 2.0, "field_length": 30.0,
                            "field_bending_ns": 1000.0}}
FREQUENCY = 100e3
#: largest errors [ns] at the centre, and of elements relative to it; a leg along the thermocline bends by 2 x 170 ns
BOUNDS = {**{kind: {100.0: (0.3, 1.5), 200.0: (1.5, 4.0)} for kind in ("front", "gradient")},
          "internal wave": {100.0: (7.0, 7.0), 200.0: (25.0, 200.0)}}


def echoes(tmp_path, target, offsets, return_path="vector", **water):
    """Pressure (rx,) of the echo of a point target at receivers off the sonar, at the carrier frequency."""
    for name, places in (("tx", [(0, 0, 0)]), ("rx", offsets)):
        (tmp_path / f"{name}.csv").write_text("x,y,z\n" + "".join(f"{x},{y},{z}\n" for x, y, z in places))
    away = np.linalg.norm(target)
    scene = array_sonar({"bed": buried_bed(90.0, size=600.0), "ball": point_target(target)}, depth=5.0,
                        water={"absorption_db_per_km": 0.0, **WATER, **water}, integrator={"cell": 4.0},
                        film={"range": away + 8, "range_min": away - 8, "sample_rate_khz": 30.0},
                        sensor={"pings": 1, "transmit": "file", "transmit_file": str(tmp_path / "tx.csv"),
                                "receive": "file", "receive_file": str(tmp_path / "rx.csv"), "heading_deg": 90.0})
    return mitsonar.impulse_response(scene, return_path=return_path).values[0, 0].astype(complex).sum(-1)


OFFSETS = [(0, 0, 0), (0.5, 0, 0), (-0.5, 0, 0), (0, 0, 0.5), (0, 0, -0.5), (0.35, 0, 0.35)]    # ahead is east


@pytest.mark.parametrize("return_path", ["vector", "eigenray"])
@pytest.mark.parametrize("distance", [100.0, 200.0])
@pytest.mark.parametrize("kind", FIELDS)
def test_echoes_at_elements_have_the_times_of_exact_eigenrays(variant, tmp_path, kind, distance, return_path):
    target = [distance, 0.0, -30.0]
    with_field, without = (echoes(tmp_path, target, OFFSETS, return_path, **water) for water in (FIELDS[kind], {}))
    ends = [(0.0, 5.0), *((x, 5.0 + z) for x, _, z in OFFSETS)]
    out, *back = [exact(kind, *end, distance, 30.0) - exact("", *end, distance, 30.0) for end in ends]
    wanted = out + np.array(back)
    late = np.angle(with_field * np.conj(without) * np.exp(2j * np.pi * FREQUENCY * wanted)) / (-2 * np.pi * FREQUENCY)
    error, (centre, element) = 1e9 * late, BOUNDS[kind][distance]
    assert abs(error[0]) < centre and np.abs(error - error[0]).max() < element and abs(wanted[0]) > 5e-6


@pytest.fixture(scope="module")
def survey_in():
    """A function that plans a sidescan over a level bed in water with a field."""
    def made(**water):
        scene = sidescan({"bed": bed(30.0, size=500.0)}, depth=5.0, rays=2000, sensor={"pings": 1},
                         water={**WATER, **water}, film={"range": 200.0, "bins": 400})
        return scene.integrator().survey(scene, scene.sensors()[0])
    return made


@pytest.mark.parametrize("kind", FIELDS)
def test_hits_of_rays_have_the_times_of_the_frozen_ray(variant, survey_in, kind):
    import drjit as dr
    import mitsuba as mi

    from mitsonar.scene.tracing.tracer import Tracer

    water = {**FIELDS[kind], "field_heading_deg": 120.0}
    angle = dr.linspace(mi.Float, 0.15, 0.6, 64)
    direction = mi.Vector3f(dr.cos(angle) * 0.6, dr.cos(angle) * 0.8, -dr.sin(angle))
    hits = []
    for geometry, device in (survey_in(**water).surroundings, survey_in().surroundings):
        tracer = Tracer(geometry, device, max_range=210.0)
        hits.append(tracer.trace(tracer.sources(np.array([5.0])), tracer.lib.Array3f64(0, 0, -5), mi.UInt32(0),
                                 direction))
    assert dr.all(hits[0].valid)
    away = np.hypot(hits[0].point.x.numpy(), hits[0].point.y.numpy())
    ray, column = eigenray(PROFILE_OF_SCENES, 5.0, 30.0, away), survey_in(**water).waters.only
    here = np.ones(away.size)
    leg = FrozenLeg((0 * here, 0 * here, 5 * here), (0.6 * here, 0.8 * here), away, 30 * here, ray.arc_length,
                    ray.ray_parameter, np.sin(ray.launch_angle))
    wanted = frozen_ray(leg, column.field, lambda z: (column.profile.at(z), column.profile.gradient(z))).later
    added = hits[0].travel_time.numpy() - hits[1].travel_time.numpy()
    assert np.abs(added - wanted).max() < 2e-10 and np.abs(wanted).max() > 5e-7


def test_frames_and_elements_see_the_same_field(variant, tmp_path):
    """Scatterers of the beam domain have the times and directions of exact ways, but for the table without a field."""
    import drjit as dr
    import mitsuba as mi

    from mitsonar.survey.beam_domain.line import LineArray
    from mitsonar.survey.beam_domain.ping_echoes import PingEchoes

    placed, ways = [], []
    for field in ({}, {**FIELDS["internal wave"], "field_x": 25.0}):
        scene = array_sonar({"bed": bed(30.0, size=200.0)}, depth=5.0, water={**WATER, **field}, film={"range": 60.0},
                            sensor={"pings": 1, "receive": "line", "receive_elements": 16, "beams": 8, "pulse": "cw"})
        survey = scene.integrator().survey(scene, scene.sensors()[0])
        axis, normal = survey.receive.position[-1] - survey.receive.position[0], survey.receive.normal[0]
        axis /= np.linalg.norm(axis)
        beams = np.array([np.sin(angle) * axis + np.cos(angle) * normal for angle in (-0.8, 0.8)])
        line = LineArray.of(survey.receive, beams, survey.wavelength)
        echoes = PingEchoes(survey, line, per_cell=2.0)
        placed.append(echoes.scatterers(0, everywhere=True))
        around = echoes.ground.ensonification
        origin = around.lib.Array3f64(0, 0, -5)
        ways.append(around.connector.connect(around.tracer.sources(np.array([5.0])), origin, mi.UInt32(0),
                                             placed[0].out_offset + origin, mi.Vector3f(0, 0, 0), occlusion=False))
    far = dr.norm(placed[0].out_offset).numpy() < 55.0
    time, launch = ((placed[1].out_time - placed[0].out_time).numpy()[far],
                    np.array(placed[1].sent - placed[0].sent)[:, far])
    wanted = (ways[1].travel_time - ways[0].travel_time).numpy()[far]
    turned = np.array(ways[1].launch_direction - ways[0].launch_direction)[:, far]
    assert np.abs(wanted).max() > 5e-7 and np.abs(time - wanted).max() < 2e-9
    assert np.abs(turned).max() > 1e-4 and np.abs(launch - turned).max() < 4e-5


def test_a_still_field_leaves_pings_their_water_and_a_moving_one_gives_each_its_own(variant):
    made = []
    for speed_ in (0.0, 0.5):
        scene = sidescan({"bed": bed(30.0, size=300.0)}, depth=5.0, rays=2000, film={"range": 60.0, "bins": 50},
                         sensor={"pings": 3, "speed_knots": 1.0},
                         water={**WATER, **FIELDS["front"], "field_speed": speed_})
        survey = scene.integrator().survey(scene, scene.sensors()[0])
        made.append([survey.waters.at(ping).field.x for ping in range(3)])
        time = survey.track.time
    assert made[0] == [100.0] * 3 and np.allclose(made[1], 100.0 + 0.5 * (time - time[0]))


def test_bending_beyond_its_bound_is_said(variant):
    water = {**WATER, **FIELDS["internal wave"], "field_bending_ns": 50.0}
    scene = sidescan({"bed": bed(30.0, size=900.0)}, depth=5.0, rays=2000, sensor={"pings": 1}, water=water,
                     film={"range": 200.0, "bins": 50})
    with pytest.warns(UserWarning, match=r"bends rays to the bed at \d+ m so that they arrive \d+ ns earlier"):
        mitsonar.render(scene)


@pytest.mark.parametrize("integrator, water, shapes", [
    ({"max_depth": 2}, {}, {}), ({}, {"volume_strength_db": -70.0}, {}),
    ({}, {}, {"sea": {"type": "sea_surface", "wind_speed": 0.0}})])
def test_what_does_not_see_the_field_is_refused(variant, integrator, water, shapes):
    scene = sidescan({"bed": bed(30.0, size=300.0), **shapes}, depth=5.0, rays=2000, sensor={"pings": 1},
                     water={**WATER, **FIELDS["front"], **water}, integrator=integrator,
                     film={"range": 60.0, "bins": 9})
    with pytest.raises(ValueError, match="the water has a field, which paths of several bounces, mirrored paths and"):
        mitsonar.render(scene)


def test_gradients_do_not_see_the_field(variant):
    scene = sidescan({"bed": bed(30.0, size=300.0)}, depth=5.0, rays=2000, sensor={"pings": 1},
                     water={**WATER, **FIELDS["front"]}, film={"range": 60.0, "bins": 9})
    with pytest.raises(ValueError, match="the water has a field, which gradients do not see yet; write field none"):
        mitsonar.gradient(scene, ["bed.bsdf.strength"], lambda record: 0 * record)


@pytest.mark.parametrize("kind", ["multibeam", "interferometric"])
def test_a_field_counts_as_an_error_by_refraction(variant, kind):
    """A gradient tilts the swath by about 1 cm in 50 m; errors by detection vary with the echoes, but do not tilt."""
    builder, more = {"multibeam": (multibeam, {"sensor": {"beams": 64}, "film": {"range": 80.0}}),
                     "interferometric": (interferometric, {"film": {"range": 60.0, "bins": 400}})}[kind]
    lines = [mitsonar.soundings(builder({"bed": bed(30.0, size=400.0)}, depth=5.0, water={**WATER, **water}, **more), 3)
             for water in (FIELDS["gradient"], {})]
    both = lines[0]["valid"].values & lines[1]["valid"].values & (np.abs(lines[1]["across_track"].values) > 10)
    change = {name: (lines[0][name] - lines[1][name]).values[both] for name in ("error_detection", "error_refraction")}
    across = lines[1]["across_track"].values[both]
    detection, refraction = (np.polyfit(across, change[name], 1)[0] for name in ("error_detection", "error_refraction"))
    assert refraction < -1e-4 and abs(detection) < 0.2 * abs(refraction)
