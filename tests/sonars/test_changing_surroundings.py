"""A water or a scene that changes on the way: every ping is that of a run in its own surroundings alone.

Geometry: a level bed, two targets, 4 pings of which the last 2 have another profile, or other places of the targets; of
sidescans 6 and 3, so that the change divides pings that share a scout. The runs share their plan, made in the first
surroundings: windows, sampling, and what the instrument takes its sound speed to be. Everything else must be the same
to the last bit, because a block, a table or a tracer belongs to one of the surroundings.
"""
import numpy as np
import pytest

from mitsonar.scene.geometry import Geometry
from mitsonar.survey.kinds import SOUNDERS, kind_of
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.pressure.signals import LEAD, received_signals
from mitsonar.survey.soundings.line import SoundingLine
from mitsonar.survey.synthetic_aperture.image import raw_pings
from mitsonar.verbs.images import opened
from mitsonar.water import SoundSpeedProfile
from tests.inputs.changing_surroundings import in_waters, in_worlds
from tests.inputs.sonar_scenes import (
    array_sonar,
    bed,
    echo_sounder,
    forward_looking,
    interferometric,
    multibeam,
    point_target,
    sector_scan,
    sidescan,
    synthetic_aperture,
)

FIRST = {"profile": "0:1520, 10:1518, 15:1500, 60:1495"}
OTHER = SoundSpeedProfile([0.0, 11.0, 13.0, 60.0], [1500.0, 1498.0, 1470.0, 1465.0])
SHAPES = {"bed": bed(18.0, size=120.0), "ball": point_target([8.0, 2.0, -17.0], 0.0),
          "float": point_target([-7.0, 3.0, -16.0], 0.0)}
SCATTERING, SEA = {"volume_strength_db": -60.0}, {"type": "sea_surface"}
MOVING = {"pings": 4, "speed_knots": 2.0}
SCENES = {
    "sidescan": lambda: sidescan(SHAPES, depth=10.0, water=FIRST, rays=4000, film={"range": 30.0, "bins": 100},
                                 sensor={**MOVING, "pings": 6, "noise": True}, integrator={"cell": 0.5}),
    "array": lambda: array_sonar(SHAPES, water=FIRST, film={"range": 20.0}, integrator={"cell": 0.4}, sensor={
        **MOVING, "receive": "line", "receive_elements": 12, "beams": 8, "pulse": "lfm", "pulse_ms": 0.5,
        "bandwidth_khz": 10.0}),
    "array by elements": lambda: array_sonar(
        {**SHAPES, "sea": SEA}, water={**FIRST, **SCATTERING}, film={"range": 20.0}, sensor={
            **MOVING, "picture": "elements", "receive": "line", "receive_elements": 6, "beams": 4},
        integrator={"cell": 0.5, "max_depth": 2, "rays": 2000}),
    "sidescan with bounces": lambda: sidescan(
        {**SHAPES, "sea": SEA}, depth=10.0, water={**FIRST, **SCATTERING}, rays=2000, sensor={**MOVING, "pings": 6},
        film={"range": 30.0, "bins": 100}, integrator={"max_depth": 3}),
    "forward_looking": lambda: forward_looking(SHAPES, water=FIRST, sensor={**MOVING, "beams": 16},
                                               film={"range": 11.0}),
    "multibeam": lambda: multibeam(SHAPES, water=FIRST, sensor={**MOVING, "beams": 32}, film={"range": 25.0}),
    "interferometric": lambda: interferometric(SHAPES, water=FIRST, sensor=MOVING, film={"range": 25.0, "bins": 200}),
    "echo_sounder": lambda: echo_sounder(SHAPES, water=FIRST, sensor=MOVING, film={"range": 25.0}),
    "sector_scan": lambda: sector_scan(SHAPES, water=FIRST, sensor={"pings": 4},
                                       integrator={"rays": 4000, "cell": 0.2}),
    "synthetic_aperture": lambda: synthetic_aperture(SHAPES, water=FIRST, integrator={"cell": 0.5}, sensor={
        **MOVING, "receivers": 4, "pulse_ms": 0.2}, film={"range_min": 12.0, "range": 16.0})}


def elements(survey, seed):
    """The signals of the elements."""
    return received_signals(PressureRecord(survey, seed=seed), range(survey.track.pings)).to_dataset(name="signals")


def pictures(survey, sensor, seed):
    """The picture, or the raw echoes of a strip, whose picture has no pings."""
    if sensor.kind != "synthetic_aperture":
        return [kind_of(sensor).picture(survey, sensor, seed)]
    return list(raw_pings(survey, seed))


def by_ping(records):
    """The variables of records that have pings, in their order."""
    values = {}
    for record in records:
        for name, variable in record.variables.items():
            if "ping" in variable.dims:
                values.setdefault(name, []).append(np.moveaxis(variable.values, variable.dims.index("ping"), 0))
    return {name: np.concatenate(parts) for name, parts in values.items()}


def check(make, survey, of_interest, changed=lambda survey, change: in_waters(survey, OTHER, change)):
    """Compare the pings in two surroundings with those in either alone, and those of either with the other's."""
    change = survey.track.pings // 2
    first, other, both = (by_ping(make(run)) for run in (survey, changed(survey, 0), changed(survey, change)))
    assert set(both) == set(first)
    for name, values in both.items():
        np.testing.assert_array_equal(values[:change], first[name][:change], err_msg=name)
        np.testing.assert_array_equal(values[change:], other[name][change:], err_msg=name)
    assert not np.array_equal(first[of_interest], other[of_interest])


@pytest.mark.parametrize("kind", SCENES)
def test_every_ping_of_a_picture_has_its_own_water(variant, kind):
    scene, sensor, integrator = opened(SCENES[kind]())
    survey = integrator.survey(scene, sensor) if kind != "synthetic_aperture" else integrator.array_survey(
        scene, sensor, LEAD)
    check(lambda run: pictures(run, sensor, 3), survey, "level" if kind != "synthetic_aperture" else "signal")


@pytest.mark.parametrize("kind", ["sidescan", "interferometric"])
def test_every_ping_of_a_picture_has_its_own_geometry(variant, kind):
    scene, sensor, integrator = opened(SCENES[kind]())
    other = Geometry(array_sonar({**SHAPES, "float": point_target([-2.0, 9.0, -16.0], 5.0)}))
    check(lambda run: pictures(run, sensor, 3), integrator.survey(scene, sensor), "level",
          lambda survey, change: in_worlds(survey, other, change))


@pytest.mark.parametrize("kind", ["array", "sidescan"])
def test_every_ping_of_element_signals_has_its_own_water(variant, kind):
    scene, sensor, integrator = opened(SCENES[kind]())
    check(lambda run: [elements(run, 3)], integrator.array_survey(scene, sensor, LEAD), "signals")


@pytest.mark.parametrize("kind", ["multibeam", "interferometric"])
def test_every_ping_of_soundings_has_its_own_water(variant, kind):
    scene, sensor, integrator = opened(SCENES[kind]())

    def line(run):
        return list(SoundingLine(run, SOUNDERS[kind].instrument(run, 3, column=False, snippets=0), 3).pings())

    check(line, integrator.survey(scene, sensor), "travel_time")
