"""Targets partly below the bed: what is buried is neither ensonified nor seen, what stands out is as it was.

By physical optics a rigid sphere of radius a sends back a/2 from a spot of the radius √(λ a / 2) about the place where
it is met at right angles, a cylinder of length L from broadside L √(a / 2λ) from a strip as wide each way. Where that
spot lies clear of the bed by some such radii, burial changes no more than the edge at the bed sends back, ~1 / k a: 0.5
dB. Where it lies below, that edge is all: 20 dB less.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from sonar_scenes import array_sonar, bed, buried_bed, forward_looking, lambert

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.echoes.scatterers.thinned_scatterers import Density
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import Tracer
from mitsonar.survey.beam_domain.ground import FREE, Ground
from mitsonar.survey.pressure.pressure import PressureRecord

DEPTH, RADIUS, SPEED, KILOHERTZ = 20.0, 0.5, 1500.0, 60.0


def sphere(height, material):
    """Its middle so high over the bed."""
    return {"type": "sphere", "center": [0.0, 0.0, height - DEPTH], "radius": RADIUS, "bsdf": material}


def cylinder(height, material):
    return {"type": "cylinder", "p0": [-0.2, 0.0, height - DEPTH], "p1": [0.2, 0.0, height - DEPTH], "radius": RADIUS,
            "bsdf": material}


def strength_db(target, sonar, middle):
    """Target strength of what is heard of smooth surfaces, spreading about their middle taken out."""
    scene = array_sonar({"seabed": buried_bed(DEPTH, size=100.0), "ball": target}, film={"range": 30.0},
                        sensor={"frequency_khz": KILOHERTZ, "start": list(sonar)}, water={"absorption_db_per_km": 0.0},
                        integrator={"cell": 20.0, "rays": 16})
    survey, total = scene.integrator().array_survey(scene, scene.sensors()[0]), 0
    for _, echoes in PressureRecord(survey).ensonification(0).coherent_echoes(np.array(sonar)):
        time = (echoes.arrival + echoes.back.travel_time).numpy()
        amplitude = echoes.amplitude[0].numpy() + 1j * echoes.amplitude[1].numpy()
        total += (amplitude * np.exp(-2j * np.pi * survey.frequency * time)).sum()
    distance = np.linalg.norm(np.array(sonar) - middle)
    nearer = distance * (distance - RADIUS)                  # of a sphere, from its highlight: (d - a) d
    return 20 * np.log10(max(abs(total), 1e-30) * nearer)


def test_a_sphere_echoes_as_its_highlight_lies_over_the_bed_or_under_it(variant):
    """Looked at 45 degrees down the highlight lies 0.35 m over the middle, and 4 radii of its spot are 0.3 m."""
    rigid, theory = {"type": "rigid"}, 20 * np.log10(RADIUS / 2)
    for height, expected in ((2.0, theory), (0.0, theory), (-0.08, theory), (-0.6, None)):
        middle = np.array([0.0, 0.0, height - DEPTH])
        found = strength_db(sphere(height, rigid), middle + [0.0, 14.0, 14.0], middle)
        if expected is None:
            assert found < -200
        else:
            assert found == pytest.approx(expected, abs=0.5)
    middle = np.array([0.0, 0.0, -0.45 - DEPTH])
    assert strength_db(sphere(-0.45, rigid), middle + [0.0, 14.0, 14.0], middle) < theory - 10


def test_a_half_buried_cylinder_echoes_from_broadside(variant):
    length, rigid = 0.4, {"type": "rigid"}
    theory = 20 * np.log10(length * np.sqrt(RADIUS * KILOHERTZ * 1e3 / (2 * SPEED)))
    for height in (2.0, 0.0):
        middle = np.array([0.0, 0.0, height - DEPTH])
        found = strength_db(cylinder(height, rigid), middle + [0.0, 14.0, 14.0], middle)
        assert found == pytest.approx(theory, abs=0.6)
    middle = np.array([0.0, 0.0, -0.51 - DEPTH])
    assert strength_db(cylinder(-0.51, rigid), middle + [0.0, 14.0, 14.0], middle) < -200


@pytest.mark.parametrize("away", [5.0, 150.0])
@pytest.mark.parametrize("made", [sphere, cylinder])
def test_no_ray_reaches_under_the_bed_and_none_is_missing_over_it(variant, made, away):
    """Points on the side that faces the sonar, to a millimetre over the line where the body meets the bed."""
    sonar, random = np.array([0.0, -away, -12.0]), np.random.default_rng(1)
    scene = array_sonar({"seabed": bed(DEPTH, size=400.0), "body": made(0.0, lambert())}, film={"range": 200.0},
                        sensor={"start": list(sonar)})
    survey, lib = scene.integrator().array_survey(scene, scene.sensors()[0]), arrays_of(mi.Float)
    sources = Tracer(*survey.surroundings, max_range=300.0).sources([-sonar[2]])
    for low, high, share in ((-0.3, -0.002, 0.0), (0.0, 0.003, 1.0), (0.003, 0.2, 1.0)):
        height = random.uniform(low, high, 2000)
        ring = np.sqrt(RADIUS ** 2 - height ** 2)
        turn = random.uniform(-2.5, -0.6, 2000) if made is sphere else np.full(2000, -0.5 * np.pi)
        x = random.uniform(-0.19, 0.19, 2000) if made is cylinder else ring * np.cos(turn)
        point = np.stack([x, ring * np.sin(turn), height - DEPTH], 1)
        normal = np.stack([0 * x if made is cylinder else x, point[:, 1], height], 1) / RADIUS
        way = Connector(*survey.surroundings).connect(
            sources, lib.Array3f64(*(mi.Float64(float(v)) for v in sonar)), mi.UInt32(0),
            lib.Array3f64(*(upload(mi.Float64, column) for column in point.T)),
            mi.Vector3f(*(upload(mi.Float, column.astype(np.float32)) for column in normal.T)))
        assert way.free.numpy().mean() == share


@pytest.mark.parametrize("ground", ["flat", "mesh"])
def test_pictures_in_the_beam_domain_see_nothing_of_what_is_buried(variant, ground):
    """The horizon of a bed is known every decimetre or so: under it, the bed over a scatterer is looked for."""
    away, mesh = 16.0, {"type": "seabed", "depth": DEPTH, "length": 60.0, "width": 60.0, "spacing": 0.5,
                        "bsdf": lambert()}
    ball = {**sphere(-0.35, lambert(-10.0)), "center": [0.0, away, -0.35 - DEPTH]}
    scene = forward_looking({"seabed": bed(DEPTH, size=200.0) if ground == "flat" else mesh, "ball": ball}, depth=14.0)
    survey, origin = scene.integrator().array_survey(scene, scene.sensors()[0]), np.array([0.0, 0.0, -14.0])
    density = Density(origin=origin, axis=np.array([1.0, 0, 0]), per_cell=4000.0, range_cell=0.2, sine_cell=0.02,
                      nearest=1.0, farthest=20.0)
    lit = Ground(survey).lit(density, lambda way, distance, wider: (abs(way.y * distance - away) < 1)
                             & (abs(way.x * distance) < 1))
    assert lit is not None
    height = lit.offset.z.numpy() - 14.0 + DEPTH
    label = next(number for number, name in survey.world.labels.items() if name == "ball")
    there = (lit.scatterers.label.numpy() == label) & (lit.energy.numpy() > 0)
    free, normal = lit.state.numpy() == FREE, lit.scatterers.normal
    arrival = lit.legs.arrival_direction
    facing = abs(dr.dot(normal, arrival)).numpy() > 0.05
    front = lit.offset.y.numpy() < away
    assert there[height < -0.001].any() and not free[there & (height < -0.001)].any()
    over = there & facing & front & (height > 0.001)
    assert over.sum() > 100 and free[over].all()
