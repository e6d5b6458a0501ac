"""A sonar that is stepped gives the bytes of planned pings, whatever else happens, and compiles nothing for a step.

Scenes of `numbered_scenes` have a bed, a box in it and a point target in layered water; the sonar moves and sways.
"""
import gc
import weakref

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
import sonar_scenes as scenes
from numbered_scenes import numbered

import mitsonar

FANS = "forward_looking", "array_sonar", "multibeam"
SEED = 7


def poses(scene):
    """The poses of a scene's planned track, as arguments of a step."""
    survey = scene.integrator().survey(scene, scene.sensors()[0], SEED)
    voyage = survey.passage.platform or survey.voyage
    track = voyage.track
    return [dict(position=track.position[ping], attitude=(track.roll[ping], track.pitch[ping], track.heading[ping]),
                 velocity=voyage.velocity[ping], turn_rate=voyage.turn_rate[ping], time=track.time[ping])
            for ping in range(track.pings)]


def small(**sensor):
    """A forward-looking sonar of few elements that goes north at 2 m/s, 4 m over a rough bed."""
    sensor = {"frequency_khz": 200.0, "receive_elements": 8, "beams": 9, "element_spacing": 0.5, "pulse_ms": 0.2,
              "pings": 3, "speed_knots": 4.0, "noise": True, **sensor}
    return scenes.forward_looking({"seabed": scenes.bed(12.0, size=40.0)}, depth=8.0, sensor=sensor,
                                  film={"range": 8.0, "range_min": 4.0}, integrator={"cell": 0.2})


def same(one, other):
    """Both records have the same bytes, axes and attributes."""
    assert set(one.variables) == set(other.variables)
    for name in one.variables:
        assert one[name].dtype == other[name].dtype, name
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=name)
    assert {name: str(value) for name, value in one.attrs.items()} == {
        name: str(value) for name, value in other.attrs.items()}


def kernels(work):
    """The hashes of the kernels that some work launches."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        work()
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}


@pytest.mark.parametrize("kind", FANS)
def test_the_poses_of_a_planned_track_give_the_bytes_of_its_frames(exact, rng, kind):
    """The sonar sways while echoes arrive, so that the plan's accelerations count, too."""
    scene = numbered(kind, rng, pings=3)
    with mitsonar.Sonar(scene, SEED) as sonar:
        for pose, frame in zip(poses(scene), mitsonar.frames(scene, SEED), strict=True):
            same(sonar.ping(**pose), frame)


def test_pictures_of_elements_signals_are_those_of_frames(exact):
    scene = small(picture="elements", pings=2)
    with mitsonar.Sonar(scene, SEED) as sonar:
        for pose, frame in zip(poses(scene), mitsonar.frames(scene, SEED), strict=True):
            same(sonar.ping(**pose), frame)


def test_signals_are_those_of_the_elements(exact, rng):
    """At the last ping, and at the next one: a picture is not needed for it."""
    scene = numbered("array_sonar", rng, pings=3)
    planned = [mitsonar.element_signals(scene, ping, seed=SEED) for ping in range(3)]
    with mitsonar.Sonar(scene, SEED) as sonar:
        first, second, third = poses(scene)
        sonar.ping(**first)
        for found, wanted in ((sonar.signals(), planned[0]), (sonar.signals(**second), planned[1]),
                              (sonar.signals(**third), planned[2]), (sonar.signals(), planned[2])):
            np.testing.assert_array_equal(found.values, wanted.values)
            assert found.attrs["lost_arrivals"] == wanted.attrs["lost_arrivals"]
        assert sonar.pings == 3


SECTORS = {"frequency_khz": "200, 240", "pulse_ms": "0.3, 0.3", "bandwidth_khz": "20, 20", "pulse": "lfm", "beams": 24,
           "source_level_db": "210, 210", "sector_delay_ms": "0, 2", "receive_beam_width_deg": 4.0, "pings": 3,
           "transmit_beam_width_deg": 4.0, "sector_edges_deg": "0", "swaths": 1, "motion": "hull", "swath_deg": 90.0}


def swath():
    """A multibeam of two sectors on a launch, 10 m over a bed."""
    return scenes.multibeam({"seabed": scenes.bed(12.0, size=60.0)}, depth=2.0, film={"range": 20.0},
                            sensor={**SECTORS, "speed_knots": 4.0, "noise": True})


def test_a_swath_of_several_sectors_is_that_of_frames_and_soundings(exact):
    """Soundings interpolate the motion sensors' record, whose samples lie elsewhere for a single ping: 1e-8 m."""
    scene = swath()
    line = mitsonar.soundings(scene, SEED)
    with mitsonar.Sonar(scene, SEED) as sonar:
        for ping, (pose, frame) in enumerate(zip(poses(scene), mitsonar.frames(scene, SEED), strict=True)):
            same(sonar.ping(**pose), frame)
            found, wanted = sonar.soundings(), line.isel(ping=[ping])
            assert set(found.variables) == set(wanted.variables)
            for name in ("travel_time", "valid", "backscatter_db", "true_depth"):
                np.testing.assert_array_equal(found[name].values, wanted[name].values, err_msg=name)
            for name in ("x", "y", "depth", "error"):
                np.testing.assert_allclose(found[name].values, wanted[name].values, rtol=0, atol=1e-8, err_msg=name)


def test_soundings_of_a_swath_that_is_rolled_and_turned_lie_on_the_bed(exact):
    """On a level bed 12 m deep, to 1 % of the depth (rms) of the beams within 45 degrees."""
    with mitsonar.Sonar(swath(), SEED) as sonar:
        found = sonar.soundings(position=(4.0, -3.0, -2.5), attitude=(0.2, 0.03, 2.0), velocity=(1.0, -1.0, 0.0),
                                turn_rate=(0.02, 0.03, -0.1))
    depth = found["depth"].values[0][found["valid"].values[0]]
    assert found["valid"].values.mean() > 0.8
    assert np.sqrt(np.mean((depth - 12.0) ** 2)) < 0.12
    bearing = np.arctan2(np.diff(found["x"].values[0]), np.diff(found["y"].values[0]))
    assert np.nanmedian(bearing) == pytest.approx(2.0 + np.pi / 2 - 2 * np.pi, abs=0.1)   # to starboard of the heading


def strip(first_pass=0.0, **sensor):
    """A sidescan of 100 kHz that is towed north at 3 knots, 8 m over a bed with a box."""
    box = {"type": "cube", "to_world": mi.ScalarTransform4f().translate([8, 0, -19.5]), "bsdf": scenes.lambert(-10)}
    sensor = {"pings": 4, "speed_knots": 3.0, "motion": "tow", "start": [0.0, -1.0, -12.0], "speckle": True, **sensor}
    return scenes.sidescan({"seabed": scenes.bed(20.0, size=80.0), "box": box}, sensor=sensor,
                           film={"range": 30.0, "bins": 200}, integrator={"rays": 20000, "first_pass": first_pass})


def test_rows_of_a_sidescan_are_those_of_its_record(exact):
    """Noise is drawn for blocks of pings together, and first passes are shared by four: both are left out here."""
    scene = strip()
    whole = mitsonar.render(scene, SEED)
    with mitsonar.Sonar(scene, SEED) as sonar:
        for ping, pose in enumerate(poses(scene)):
            row, planned = sonar.ping(**pose), whole.isel(ping=[ping])
            for name in planned.variables:
                np.testing.assert_array_equal(row[name].values, planned[name].values, err_msg=name)


def test_a_step_of_a_sidescan_finds_its_rays_by_itself(exact):
    """It is its own scout, as the third of four planned pings is; with noise, of a record of one ping."""
    scene = strip(first_pass=0.15, noise=True)
    whole = mitsonar.render(scene, SEED)["mean_level"].values
    with mitsonar.Sonar(scene, SEED) as sonar:
        rows = [sonar.ping(**pose) for pose in poses(scene)]
    np.testing.assert_array_equal(rows[2]["mean_level"].values[0], whole[2])
    noisy = abs(np.array([row["mean_level"].values[0] for row in rows]) - whole)
    assert 0 < noisy.max() and np.median(noisy[noisy > 0]) < 0.3                        # [dB], of 10,000 rays a side
    assert len({row["level"].values.tobytes() for row in rows}) == len(rows)


def head(**sensor):
    """A rotating head of 750 kHz, 4 m over a bed."""
    sensor = {"pings": 4, "step_deg": 7.2, "noise": True, "start": [0.0, 0.0, -8.0], **sensor}
    return scenes.sector_scan({"seabed": scenes.bed(12.0, size=40.0), "ball": scenes.point_target([2, 6, -10], -10)},
                              sensor=sensor, film={"range": 12.0, "bins": 200}, integrator={"rays": 4000, "cell": 0.2})


@pytest.mark.parametrize("sensor", [{"speed_knots": 0.0, "ping_rate_hz": 10.0}, {"speed_knots": 2.0, "motion": "auv"},
                                    {"speed_knots": 2.0, "picture": "elements"}], ids=["rest", "sways", "elements"])
def test_steps_of_a_rotating_head_are_those_of_its_picture(exact, sensor):
    """At rest, echoes are made once for all bearings; the attitude of a pose is the platform's."""
    scene = head(**sensor)
    whole = mitsonar.render(scene, SEED)
    with mitsonar.Sonar(scene, SEED) as sonar:
        for ping, pose in enumerate(poses(scene)):
            step, planned = sonar.ping(**pose), whole.isel(ping=[ping])
            for name in planned.variables:
                np.testing.assert_array_equal(step[name].values, planned[name].values, err_msg=name)


def test_a_head_on_a_platform_that_turns_looks_where_bearing_and_heading_say(exact):
    """The platform turns so that the head, at the bearing of its ping, looks at the ball, and then a radian aside.

    Beside it, side lobes of -26 dB two-way and less see it.
    """
    azimuth = np.arctan2(2, 6)
    with mitsonar.Sonar(head(sector_deg=1.0, step_deg=0.5, noise=False), SEED) as sonar:
        first = sonar.ping(position=(0, 0, -8))
        levels = []
        for aside in (0.0, 1.0):
            heading = azimuth + aside - float(first["bearing"].values[0])
            step = sonar.ping(position=(0, 0, -8), attitude=(0, 0, heading))
            assert abs(float(step["bearing"].values[0] - first["bearing"].values[0])) < 0.02
            levels.append(float(step["level"].max()))
    assert levels[0] - levels[1] > 26


def test_a_sidescan_that_turns_and_dives_sees_the_bed_it_is_over(exact):
    """The first echo of the bed is at the altitude, whatever the heading; a bin is 15 cm, the bed level."""
    with mitsonar.Sonar(strip(), SEED) as sonar:
        for number in range(3):
            row = sonar.ping(position=(3.0 * number, 2.0, -13.0 - number), attitude=(0.02, 0.0, 1.5 * number),
                             velocity=(1.0, 0.5, 0.0), turn_rate=(0, 0, 0.3 * number))
            first = row["range"].values[(row["label"].values[0] > 0).any(0)][0]
            assert first == pytest.approx(20.0 - 13.0 - number, abs=0.3)


def test_a_step_away_from_the_plan_is_a_scene_planned_there(exact):
    """The slope of absorption over the band is that at the planned depth, here 8 and 7 m: 2e-5 of the strongest echo.

    Sums of the same scatterers in another order differ by 1e-6 of it.
    """
    there, heading = np.array([3.0, -5.0, -7.0]), 1.0
    planned = mitsonar.render(small(pings=1, start=there, heading_deg=np.rad2deg(heading), noise=False), SEED)
    with mitsonar.Sonar(small(noise=False), SEED) as sonar:
        velocity = poses(small())[0]["velocity"][1] * np.array([np.sin(heading), np.cos(heading), 0])
        stepped = sonar.ping(position=there, attitude=(0, 0, heading), velocity=velocity)
    found, wanted = (10 ** (image["level"].values / 20) for image in (stepped, planned))
    assert np.abs(found - wanted).max() < 1e-4 * wanted.max()
    assert np.mean(stepped["label"].values == planned["label"].values) > 0.999
    assert stepped["altitude"].values == pytest.approx(planned["altitude"].values)


def test_steady_poses_are_those_of_the_plan_to_rounding(exact):
    """A pose 1 nm off the plan moves on at its own velocity, here the plan's: the pictures differ as the places do.

    Phases change by 4 pi 1e-8 m / 7.5 mm = 2e-5 at most.
    """
    scene = small(noise=False)
    pose = poses(scene)[1]
    with mitsonar.Sonar(scene, SEED) as on, mitsonar.Sonar(scene, SEED) as beside:
        one, other = on.ping(**pose), beside.ping(**{**pose, "position": pose["position"] + 1e-8})
    found, wanted = (10 ** (image["level"].values / 20) for image in (other, one))
    assert 0 < np.abs(found - wanted).max() < 1e-4 * wanted.max()


def test_a_turn_moves_echoes_as_far_as_the_sonar_turns_meanwhile(exact):
    """A target ahead at R appears ω 2R/c to port of its bearing when the sonar turns to starboard at ω.

    0.5 rad/s over 12 m and back: 8 mrad, in beams 20 mrad apart that are 1.2 degrees wide: the centre of its energy
    is found to a tenth of a beam.
    """
    sensor = {"frequency_khz": 400.0, "receive_elements": 96, "element_spacing": 0.5, "beams": 181, "fan_deg": 60.0,
              "pulse_ms": 0.1, "pings": 1, "speed_knots": 0.0, "ping_rate_hz": 10.0, "tilt_deg": 0.0, "noise": False}
    target = scenes.point_target([0.0, 12.0, -8.0], 0.0)
    scene = scenes.forward_looking({"seabed": scenes.bed(60.0, size=80.0), "target": target}, depth=8.0, sensor=sensor,
                                   film={"range": 14.0, "range_min": 10.0})

    def bearing(image):
        energy = (10 ** (image["level"].values[0] / 10)).max(1)
        near = energy > 0.1 * energy.max()
        return float(np.sum((energy * image["bearing"].values)[near]) / np.sum(energy[near]))

    with mitsonar.Sonar(scene) as sonar:
        at_rest = bearing(sonar.ping(position=(0, 0, -8)))
        turning = bearing(sonar.ping(position=(0, 0, -8), turn_rate=(0, 0, -0.5)))
    assert turning - at_rest == pytest.approx(-0.5 * 2 * 12.0 / 1500.0, rel=0.1)


def test_two_sonars_in_turn_are_each_by_itself(exact):
    scene = small()
    ways = [[dict(position=(0, y, -8), velocity=(0, 1, 0), attitude=(0, 0, 0.3 * y)) for y in (0.0, 0.4, 0.9)],
            [dict(position=(x, 0, -7), attitude=(0.1, 0, 2.0)) for x in (1.0, 1.5, 2.0)]]

    def alone(way, seed):
        with mitsonar.Sonar(scene, seed) as sonar:
            return [sonar.ping(**pose) for pose in way]

    with mitsonar.Sonar(scene, 1) as one, mitsonar.Sonar(scene, 2) as other:
        in_turn = [(one.ping(**first), other.ping(**second)) for first, second in zip(*ways)]
    for number, way in enumerate(ways):
        for found, wanted in zip(in_turn, alone(way, number + 1)):
            same(found[number], wanted)


@pytest.mark.parametrize("made", [small, swath, strip, head])
def test_a_step_compiles_nothing_that_the_first_one_has_not(made):
    """Depth, place, heading, speed and rate of turn change. At rest, under way and in a turn, kernels differ."""
    def send(y, moves, turns):
        sonar.ping(position=(y, y, -5 - 0.3 * y), attitude=(0.1 * y, 0.05, y),
                   velocity=(0, 0.3 + 0.3 * y if moves else 0, 0), turn_rate=(0, 0, 0.1 + 0.1 * y if turns else 0))

    with mitsonar.Sonar(made(**({"speed_knots": 3.0} if made is head else {})), SEED) as sonar:
        known = kernels(lambda: [send(0.0, *ways) for ways in ((True, True), (True, False), (False, False))])
        later = kernels(lambda: [send(y, *ways) for y in (0.7, 1.1) for ways in ((True, True), (False, False))])
        assert len(later - known) == 0


def test_a_sonar_left_alone_is_freed():
    sonar = mitsonar.Sonar(small(), SEED)
    sonar.ping(position=(0, 0, -8))
    left = weakref.ref(sonar)
    del sonar
    gc.collect()
    assert left() is None


def test_what_is_left_out_and_what_it_says():
    with mitsonar.Sonar(small(), SEED) as sonar:
        interval = poses(small())[1]["time"]
        frames = [sonar.ping(position=(0, 0, -8)), sonar.ping(position=(0, 0, -8), time=3.0),
                  sonar.ping(position=(0, 0, -8))]
        assert [float(frame["ping_time"].values[0]) for frame in frames] == pytest.approx([0, 3.0, 3.0 + interval])
        assert [int(frame["ping"].values[0]) for frame in frames] == [0, 1, 2]
        assert all(frames[0][name].values[0] == 0 for name in ("roll", "pitch", "heading"))
        assert repr(sonar).startswith('Sonar(forward_looking "') and "3 pings" in repr(sonar)
    assert "closed" in repr(sonar)
    with pytest.raises(ValueError, match="closed"):
        sonar.ping(position=(0, 0, -8))


BAD = [
    (dict(position=(0, 0, -8), time=0.5), "last ping was sent at 1 s"),
    (dict(position=(0, 0, -8), time=1.001), "echoes from the range of the film take"),
    (dict(position=(0, 0, -8), time=np.nan), "time is nan"),
    (dict(position=(0, 0, -8), time="noon"), "number of seconds"),
    (dict(position=(0, np.nan, -8)), "position is .* finite"),
    (dict(position=(0, 0)), r"shape \(2,\); give three numbers"),
    (dict(position="here"), "give three numbers"),
    (dict(position=(0, 0, -8), attitude=(0, 2.0, 0)), "pitch"),
    (dict(position=(0, 0, 0.5)), "ping 1: the sonar is 0.50 m above the sea surface"),
    (dict(position=(0, 0, -13)), "below the seabed: at ping 1"),
    (dict(position=(500, 0, -8)), "outside the bathymetry: ping 1"),
    (dict(position=(0, 0, -8), velocity=(3, 0, 0)), "3 m/s, and the scene's route .* 2.058 m/s"),
    (dict(position=(0, 0, -8), turn_rate=(0, 0, 400)), "turns by"),
]


def test_bad_poses_are_refused_in_a_sentence_and_leave_the_sonar_where_it_is(exact):
    with mitsonar.Sonar(small(), SEED) as sonar, mitsonar.Sonar(small(), SEED) as other:
        for each in (sonar, other):
            each.ping(position=(0, 0, -8), time=1.0)
        for pose, words in BAD:
            with pytest.raises(ValueError, match=words):
                sonar.ping(**pose)
            assert sonar.pings == 1
        same(sonar.ping(position=(0, 0.5, -8)), other.ping(position=(0, 0.5, -8)))


def test_signals_ask_for_a_ping():
    with mitsonar.Sonar(small(), SEED) as sonar:
        with pytest.raises(ValueError, match="has sent none"):
            sonar.signals()
        with pytest.raises(ValueError, match="without a position"):
            sonar.signals(time=4.0)


def test_only_a_multibeam_makes_soundings():
    with mitsonar.Sonar(small(), SEED) as sonar:
        with pytest.raises(ValueError, match="makes soundings"):
            sonar.soundings(position=(0, 0, -8))
        with pytest.raises(ValueError, match="snippets is -1"):
            sonar.soundings(snippets=-1)
        assert sonar.pings == 0


def test_a_strip_cannot_be_stepped():
    with pytest.raises(ValueError, match="synthetic_aperture cannot be stepped"):
        mitsonar.Sonar(scenes.synthetic_aperture({"seabed": scenes.bed(20.0)}))
