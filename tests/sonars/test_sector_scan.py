"""A rotating head over a level bed and among targets, in uniform water: places, widths, truth, speckle, motion.

A beam whose sides are sinc's is, sent and received, b⁴ = sinc⁴(x), x = L sin(ψ) / λ: -3 dB at x = 0.31895, where that
of one way is at 0.44295; so the picture of a point is 0.7201 times as wide as the beam. A head that turns on by ω sends
at ψ and receives at ψ + ω t: the point appears ω t / 2 early, where both lobes are as strong.

A box on the bed, H below the head, its face y0 ahead, its back y1, h high: its highlight lies from hypot(y0, H - h) to
hypot(y1, H - h), its shadow from there to hypot(y1 H / (H - h), H), see `test_truth_of_a_fan`.
"""
import mitsuba as mi
import numpy as np
import pytest
from sonar_scenes import bed, buried_bed, point_target, sector_scan
from track_files import write_track

import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported

SPEED = 1500.0
TWO_WAY = 0.7201
DEEP = {"integrator": {"cell": 4.0, "rays": 4000}}         # scenes of targets alone


def peak(image):
    """Bearing [rad] and range [m] of the strongest bin, between bins by a parabola through the levels."""
    level = image["level"].values
    ping, bin = np.unravel_index(np.argmax(level), level.shape)
    axes = (ping, level[:, bin], image["bearing"]), (bin, level[ping], image["range"])
    return tuple(np.interp(place + top(values[place - 1:place + 2]), np.arange(len(values)), axis)
                 for place, values, axis in axes)


def top(three):
    """Where the parabola through three values has its top, from the middle one."""
    before, middle, after = three
    return 0.5 * (before - after) / (before - 2 * middle + after)


def width(level, axis, down=3.0):
    """Full width at `down` dB below the largest level, between bins."""
    at = int(np.argmax(level))
    left = np.interp(level[at] - down, level[:at + 1], axis[:at + 1])
    return np.interp(down - level[at], -level[at:], axis[at:]) - left


def seen_at(bearing_deg, distance, depth=10.0):
    return [distance * np.sin(np.deg2rad(bearing_deg)), distance * np.cos(np.deg2rad(bearing_deg)), -depth]


@pytest.mark.parametrize("turns, preset", [(False, "head_750khz"), (True, "head_750khz"), (True, "head_700khz")])
def test_a_point_lies_at_its_place_and_is_as_wide_as_the_beam(turns, preset):
    """Steps of a sixth of the beam; the head turns by a tenth of the beam until the point is heard."""
    scene = sector_scan({"seabed": buried_bed(60.0), "ball": point_target(seen_at(7.0, 12.0))}, **DEEP,
                        sensor={"preset": preset, "sector_deg": 8.0, "step_deg": 0.4, "first_bearing_deg": 3.0,
                                "turns_while_listening": turns, "beam_width_deg": 2.4}, film={"bins": 8000})
    image = mitsonar.render(scene)
    early = 0.5 * np.deg2rad(0.4) * 12.0 / 20.0 if turns else 0.0
    bearing, distance = peak(image)
    assert bearing == pytest.approx(np.deg2rad(7.0) - early, abs=0.02 * np.deg2rad(2.4))
    assert distance == pytest.approx(12.0, abs=0.5 * image.attrs["bin_width"])
    at = int(np.argmin(np.abs(image["range"].values - 12.0)))
    wide = width(image["level"].values[:, at], image["bearing"].values)
    assert wide == pytest.approx(TWO_WAY * np.deg2rad(2.4), rel=0.05)
    along = width(image["level"].values[int(np.argmax(image["level"].values[:, at]))], image["range"].values)
    # of a triangle of the length T of the pulse; of a sweep's sinc, a little wider for its window
    expected = {"head_750khz": (1 - np.sqrt(0.5)) * SPEED * 50e-6, "head_700khz": 0.97 * 0.5 * SPEED / 100e3}[preset]
    assert along == pytest.approx(expected, rel=0.1)


@pytest.mark.parametrize("apart", ["beam", "pulse"])
def test_points_a_little_more_than_a_beam_or_a_pulse_apart_are_two(apart):
    """1.6 widths of the picture of a beam, or lengths of the pulse: equally strong, and 4 dB less in between.

    Those side by side are a quarter of a cycle out of phase: 2 mm over 8.
    """
    beam, pulse = TWO_WAY * 2.0, 0.5 * SPEED * 50e-6
    second = (1.6 * beam, 10.00025) if apart == "beam" else (0.0, 10.0 + 1.6 * pulse)
    between = 0.5 * second[0], 5.0 + 0.5 * second[1]
    scene = sector_scan({"seabed": buried_bed(60.0), "a": point_target(seen_at(0.0, 10.0)),
                         "b": point_target(seen_at(*second))}, **DEEP, film={"bins": 4800, "range": 12.0},
                        sensor={"sector_deg": 5.0, "step_deg": 0.2, "first_bearing_deg": -1.0,
                                "turns_while_listening": False})
    image = mitsonar.render(scene)
    bearing, distance = np.rad2deg(image["bearing"].values), image["range"].values
    a, b, middle = (image["level"].values[int(np.argmin(np.abs(bearing - at))), int(np.argmin(np.abs(distance - away)))]
                    for at, away in ((0.0, 10.0), second, between))
    assert a == pytest.approx(b, abs=1.0)
    assert min(a, b) - middle > 4


def test_a_fast_head_hears_a_point_half_way_between_sending_and_receiving():
    """6 degrees in the 27 ms to the next ping, so 5.1 until the point at 17 m is heard: it appears 2.55 early."""
    bearings = np.arange(4.5, 6.6, 0.5)
    found = []
    for first in bearings:
        scene = sector_scan({"seabed": buried_bed(60.0), "ball": point_target(seen_at(8.0, 17.0))}, **DEEP,
                            sensor={"sector_deg": 60.0, "step_deg": 6.0, "first_bearing_deg": float(first),
                                    "beam_width_deg": 6.0, "pings": 1})
        found.append(float(mitsonar.render(scene)["level"].max()))
    at = int(np.argmax(found))
    assert bearings[at] + 0.5 * top(found[at - 1:at + 2]) == pytest.approx(8.0 - 0.5 * 6.0 * 17.0 / 20.0, abs=0.1)


# ---- a box: the head turns and its vehicle runs towards it while echoes come in

H, HEIGHT, NEAR, FAR, HALF, KNOTS, STEP_DEG = 6.0, 1.2, 12.0, 14.0, 1.6, 4.0, 3.0


@pytest.fixture(scope="module")
def image():
    mitsonar.scene.loading.prepare()
    to_world = mi.ScalarTransform4f().translate([0, 0.5 * (NEAR + FAR), -20 + HEIGHT / 2])
    box = {"type": "cube", "id": "box.1", "bsdf": {"type": "lambert", "mu_db": -15.0},
           "to_world": to_world.scale([HALF, 0.5 * (FAR - NEAR), HEIGHT / 2])}
    return mitsonar.render(sector_scan(
        {"seabed": bed(20, size=50.0), "box": box}, depth=20.0 - H, integrator={"cell": 0.12, "rays": 50_000},
        sensor={"sector_deg": 48.0, "step_deg": STEP_DEG, "tilt_deg": 20.0, "vertical_beam_width_deg": 60.0,
                "speed_knots": KNOTS}), seed=1)


def heard_at(image, y, up):
    """Slant range [m] at which the ping that looks ahead hears a point ahead of it, of a head that has moved on."""
    ping = int(np.argmin(np.abs(image["bearing"].values)))
    ahead, speed = y - float(image["y"][ping]), KNOTS * 1852 / 3600
    distance = np.hypot(ahead, H - up)
    for _ in range(5):
        distance = 0.5 * (np.hypot(ahead, H - up) + np.hypot(ahead - speed * 2 * distance / SPEED, H - up))
    return distance


def span(image, flags):
    found = np.flatnonzero(flags)
    assert len(found) == found[-1] - found[0] + 1, "there are gaps"
    return image["range"].values[[found[0], found[-1]]]


def test_highlight_and_shadow_of_a_box_lie_where_geometry_puts_them(image):
    ahead = image.isel(ping=int(np.argmin(np.abs(image["bearing"].values))))
    edge, there = 2 * image.attrs["bin_width"], float(ahead["y"])
    ends = [heard_at(image, NEAR, HEIGHT), heard_at(image, FAR, HEIGHT)]
    end = heard_at(image, there + (FAR - there) * H / (H - HEIGHT), 0.0)
    assert image.attrs["labels"]["1"] == "box.1"
    np.testing.assert_allclose(span(image, ahead["label"] == 1), ends, atol=edge)
    np.testing.assert_allclose(span(image, ahead["object_shadow"] == 1), [ends[1], end], atol=edge)
    over = (ahead["range"] > ends[0] + edge) & (ahead["range"] < heard_at(image, NEAR, 0.0) - edge)
    assert (ahead["layover"].values[over] >= 2).all()
    assert ((ahead["hidden"] > 0.9) & (ahead["range"] > ends[1] + edge) & (ahead["range"] < end - edge)).sum() > 20


def test_a_box_appears_as_early_as_the_head_turns_half_way(image):
    """It lies straight ahead; its share's mean bearing is ω t / 2 = 1 degree before that."""
    bin = int(np.argmin(np.abs(image["range"].values - heard_at(image, 0.5 * (NEAR + FAR), HEIGHT))))
    share = image["share"].sel(shape="box.1").values[:, bin]
    early = 0.5 * STEP_DEG * image["range"].values[bin] / 20.0
    assert np.rad2deg(share @ image["bearing"].values / share.sum()) == pytest.approx(-early, abs=0.4)
    seen = np.rad2deg(np.ptp(image["bearing"].values[share > 0.5]))
    away = 0.5 * (NEAR + FAR) - float(image["y"].mean())
    assert seen == pytest.approx(2 * np.rad2deg(np.arctan2(HALF, away)), abs=STEP_DEG)


def test_bright_in_the_picture_is_labelled_and_dark_is_shadow(image):
    level = image["level"].values
    mean = {name: 10 * np.log10(np.mean(10 ** (level[flags] / 10))) for name, flags in
            (("box", image["share"].sel(shape="box.1").values > 0.9), ("shadow", image["object_shadow"].values == 1),
             ("bed", (image["share"].sel(shape="seabed").values > 0.99) & (image["range"].values > 10)))}
    assert mean["box"] > mean["bed"] + 6
    assert mean["shadow"] < mean["bed"] - 10


def test_shares_add_to_one(image):
    total = image["share"].sum("shape").values
    assert np.abs(total[total > 0] - 1).max() < 1e-5


def test_signals_have_the_mean_level_of_the_rays(image):
    """8160 bins of bed, each with about one speckle: 0.1 dB."""
    bed_alone = (image["share"].sel(shape="seabed").values > 0.99) & (image["range"].values > 7)
    power, mean = (np.mean(10 ** (image[name].values[bed_alone] / 10)) for name in ("level", "mean_level"))
    assert 10 * np.log10(power / mean) == pytest.approx(0, abs=0.3)


# ---- speckle, bytes, mounts

def test_speckle_stays_with_the_ground():
    """A second turn is the first again. Steps are correlated as their beams overlap: ∫ b²(ψ) b²(ψ + Δ) dψ / ∫ b⁴ dψ."""
    step, beam = 0.8, 4.0
    scene = sector_scan({"seabed": bed(16, size=44.0)}, integrator={"cell": 0.05, "rays": 1000},
                        sensor={"sector_deg": 3 * step, "step_deg": step, "beam_width_deg": beam, "pings": 5,
                                "back_and_forth": False, "turns_while_listening": False, "tilt_deg": 20.0})
    signals = mitsonar.element_signals(scene, ping=range(5))
    z = signals.values[:, 0, 0, signals["time"].values > 2 * 9.0 / SPEED]
    np.testing.assert_array_equal(z[4], z[0])
    psi = np.deg2rad(np.linspace(-30, 30, 60001))

    def lobe(shift_deg):
        return np.sinc(0.44295 / np.sin(np.deg2rad(beam / 2)) * np.sin(psi + np.deg2rad(shift_deg))) ** 2

    for k in (1, 2, 3):
        expected = np.sum(lobe(0) * lobe(k * step)) / np.sum(lobe(0) ** 2)
        pairs = [(z[i], z[i + k]) for i in range(4 - k)]
        found = sum(np.vdot(a, b) for a, b in pairs) / sum(np.linalg.norm(a) * np.linalg.norm(b) for a, b in pairs)
        assert abs(found) == pytest.approx(expected, abs=0.12), k


@pytest.mark.parametrize("how, within", [({"turns_while_listening": False}, 0.01), ({}, 0.01),
                                         ({"speed_knots": 3.0, "roll_deg": 4.0}, 0.1)])
def test_points_are_as_those_of_elements(how, within):
    """In dB, down to 20 below the strongest bin, ten times that at 40. Under way the elements' Doppler is coarse."""
    scenes = [sector_scan({"seabed": buried_bed(60.0), "a": point_target([1.0, 12.0, -12.0], -10.0),
                           "b": point_target([-3.0, 9.0, -11.0], -14.0)}, **DEEP, film={"bins": 800},
                          sensor={"sector_deg": 30.0, "step_deg": 1.5, "tilt_deg": 5.0, "picture": way, **how})
              for way in ("beams", "elements")]
    image = mitsonar.render(scenes[0])
    beams, elements = image["level"].values, mitsonar.render(scenes[1])["level"].values
    for down, most in ((20, within), (40, 10 * within)):
        strong = elements > elements.max() - down
        assert strong.sum() > down / 8
        assert np.abs(beams - elements)[strong].max() < most
    # nothing else is heard, so what has a phase is the mean
    np.testing.assert_allclose(image["mean_level"].values[strong], beams[strong], atol=0.01)


def test_a_picture_of_beams_needs_scatterers():
    scene = sector_scan({"seabed": bed(14, size=30.0)}, sensor={"pings": 1, "picture": "beams"},
                        integrator={"ensonification": "rays", "rays": 1000})
    with pytest.raises(ValueError, match="picture is beams, but rays are to find the scatterers .* leave one of them"):
        mitsonar.render(scene)


def test_ghosts_by_way_of_a_flat_surface_are_those_of_elements():
    """4 m below it and above the bed, a wide head hears most of what comes from 17 m on by way of the surface.

    The element chain (cells of 0.15 m, seed 0, one bed) makes it 5.2 dB more than without the surface, with a chance of
    1 dB: 16 pings, of which 5 are independent, and 3 m of ranges. The mean over twelve seeds is here 6.2 to 6.4 dB, and
    a seed's deviation 0.8; incoherent sums of all paths would give 4.6, and pairs of paths that are each other's
    reverse add by amplitude, 6.8 at most.
    """
    def far(surface, seeds):
        scene = sector_scan(
            {"seabed": bed(12, size=44.0), **surface}, depth=8.0, film={"bins": 200},
            sensor={"sector_deg": 30.0, "step_deg": 2.0, "tilt_deg": 20.0, "vertical_beam_width_deg": 90.0},
            integrator={"cell": 0.15, "rays": 1000, "max_depth": 2})
        images = [mitsonar.render(scene, seed) for seed in range(seeds)]
        return 10 * np.log10(np.mean([10 ** (image["level"].values[:, 170:] / 10) for image in images]))

    flat = {"surface": {"type": "sea_surface", "size": 80.0}}
    assert far(flat, 6) - far({}, 1) == pytest.approx(6.2, abs=1.0)


def test_noise_is_as_strong_as_that_of_elements():
    """8000 bins of two samples each: 0.1 dB; and as strong as the attribute says."""
    levels = []
    for way in ("beams", "elements"):
        image = mitsonar.render(sector_scan({"seabed": buried_bed(60.0)}, **DEEP, sensor={
            "sector_deg": 30.0, "step_deg": 1.5, "noise": True, "self_noise_db": 30.0, "picture": way}))
        levels += [10 * np.log10(np.mean(10 ** (image["level"].values / 10))), image.attrs["noise_db"]]
    np.testing.assert_allclose(levels, levels[1], atol=0.2)


def test_the_speckle_of_a_second_turn_is_that_of_the_first():
    """Way and way back: the same but for the order of sums. Neighbours are alike, as their beams overlap."""
    step, beam = 0.8, 4.0
    image = mitsonar.render(sector_scan(
        {"seabed": bed(16, size=44.0)}, integrator={"rays": 40_000},
        sensor={"sector_deg": 8 * step, "step_deg": step, "beam_width_deg": beam, "pings": 18, "tilt_deg": 20.0,
                "turns_while_listening": False}))
    level = image["level"].values[:, image["range"].values > 8]
    np.testing.assert_allclose(level[:8:-1], level[:9], atol=0.01)
    intensity = 10 ** ((level[:9] - image["mean_level"].values[:9, image["range"].values > 8]) / 10)
    assert np.mean(intensity) == pytest.approx(1, abs=0.1)
    assert np.mean(intensity ** 2) / np.mean(intensity) ** 2 == pytest.approx(1.75, abs=0.25)      # two cells a bin
    near, far = (np.mean([np.corrcoef(intensity[i], intensity[i + k])[0, 1] for i in range(9 - k)]) for k in (1, 5))
    assert near > 0.8 and abs(far) < 0.3


def test_same_bytes_whatever_the_threads_and_blocks(monkeypatch, tmp_path):
    import drjit as dr

    def rendered():
        scene = sector_scan({"seabed": bed(14, size=30.0), "ball": point_target([0.0, 9.0, -13.0], -10.0)},
                            film={"range": 12.0, "bins": 200}, integrator={"cell": 0.3, "rays": 8000},
                            sensor={"sector_deg": 8.0, "step_deg": 2.0, "noise": True, "pings": 7, "speed_knots": 3.0,
                                    "roll_deg": 3.0})
        return mitsonar.render(scene, seed=5)

    threads, first = dr.thread_count(), rendered()
    assert first["turn"].values.tolist() == [0, 0, 0, 0, 0, 1, 1]
    monkeypatch.setattr("mitsonar.survey.sector_scan.steps.RAYS_PER_BLOCK", 1)
    dr.set_thread_count(threads + 1)
    try:
        again = rendered()
    finally:
        dr.set_thread_count(threads)
    assert again.identical(first)
    first.to_netcdf(tmp_path / "turn.nc")
    mitsonar.write(first, tmp_path / "turn.exr")
    assert mitsonar.read(tmp_path / "turn.nc").identical(first)
    assert mitsonar.read(tmp_path / "turn.exr").identical(first)


def test_a_head_that_stands_still_is_the_same_whatever_the_threads_and_the_way(monkeypatch):
    """Echoes that are kept from ping to ping are those of a head that makes its own at every ping.

    The latter lays them in another order, and looks for scatterers by patches: 1e-3 dB and less.
    """
    import drjit as dr

    def rendered():
        return mitsonar.render(sector_scan(
            {"seabed": bed(14, size=30.0)}, film={"range": 12.0, "bins": 200}, integrator={"rays": 4000},
            sensor={"step_deg": 60.0, "noise": True}))["level"].values

    threads, first = dr.thread_count(), rendered()
    dr.set_thread_count(threads + 1)
    try:
        np.testing.assert_array_equal(rendered(), first)
    finally:
        dr.set_thread_count(threads)
    monkeypatch.setattr("mitsonar.survey.sector_scan.signals.STILL", -1.0)
    np.testing.assert_allclose(rendered(), first, atol=1e-3)


@pytest.mark.parametrize("mount, place", [("forward", [3.0, 0.0, -20.0]), ("forward", [0.0, 0.0, -23.0]),
                                          ("down", [-3.0, 0.0, -20.0]), ("up", [3.0, 0.0, -20.0])])
def test_a_mounted_head_looks_where_it_points(mount, place):
    """Due north: starboard is east, straight down 180 degrees of a profiler's."""
    bearing = {(3.0, -20.0): 90.0, (0.0, -23.0): 180.0, (-3.0, -20.0): -90.0}[place[0], place[2]]
    scene = sector_scan({"seabed": buried_bed(60.0), "ball": point_target(place)}, depth=20.0, **DEEP,
                        film={"range": 4.0, "bins": 100},
                        sensor={"sector_deg": 3.0, "step_deg": 1.0, "first_bearing_deg": bearing - 1.0, "mount": mount,
                                "turns_while_listening": False})
    found, distance = peak(mitsonar.render(scene))
    assert np.rad2deg(found) % 360 == pytest.approx(bearing % 360, abs=0.1)
    assert distance == pytest.approx(3.0, abs=0.02)


def test_a_head_on_its_vehicle_sits_off_the_track_and_follows_it(tmp_path):
    """Half a metre ahead of and 0.2 m below a vehicle that goes round a corner; bearings are relative to it."""
    time = np.arange(0, 3.01, 0.1)
    track = np.column_stack([time, 0 * time, time, 0 * time - 12, 0 * time, 0 * time, 30 * time])
    scene = sector_scan({"seabed": buried_bed(60.0), "ball": point_target([0.0, 9.0, -12.2])}, **DEEP,
                        film={"range": 10.0}, sensor={
                            "track": write_track(tmp_path / "track.csv", track), "pings": 25, "ping_rate_hz": 25.0,
                            "offset": "0.5, 0, 0.2", "sector_deg": 40.0, "step_deg": 1.0, "first_bearing_deg": -25.0,
                            "turns_while_listening": False})
    with pytest.warns(UserWarning, match="the track is cut"):
        image = mitsonar.render(scene)
    ping = int(np.argmax(image["level"].values.max(1)))
    heading, when = float(image["heading"][ping]), 0.04 * ping
    np.testing.assert_allclose([image["x"][ping], image["y"][ping], image["z"][ping]],
                               [0.5 * np.sin(heading), when + 0.5 * np.cos(heading), -12.2], atol=1e-3)
    assert heading == pytest.approx(np.deg2rad(30 * when), abs=1e-6)
    towards = np.arctan2(-float(image["x"][ping]), 9.0 - float(image["y"][ping]))
    assert np.rad2deg(heading + float(image["bearing"][ping]) - towards) == pytest.approx(0, abs=1.1)


def test_progress_is_told_from_the_first_signals_to_the_last_truth():
    told = []
    scene = sector_scan({"seabed": buried_bed(60.0)}, **DEEP, sensor={"sector_deg": 6.0, "step_deg": 2.0})
    mitsonar.render(scene, progress=lambda done, total: told.append(done / total))
    assert len(told) > 1 and told == sorted(told) and 0 < told[0] < 0.5 and told[-1] == pytest.approx(1)


# ---- what is refused

@pytest.mark.parametrize("attributes, words", [
    ({"preset": "head"}, 'preset is the string "head"; expected one of "head_750khz", "head_700khz"'),
    ({"step_deg": 40.0, "sector_deg": 30.0}, "a step cannot be wider than the sector, take a smaller one"),
    ({"step_deg": 0.0}, "at least 0.01 and at most 90"), ({"sector_deg": 361.0}, "above 0 and at most 360"),
    ({"mount": "aft"}, 'mount is the string "aft"; expected one of "down", "up", "forward"'),
    ({"tilt_deg": 91.0}, "at least -90 and at most 90"), ({"beam_width_deg": 0.0}, "at least 0.01 and at most 180"),
    ({"pulse_ms": 0.0}, "above 0"), ({"pulse_ms": 0.0005}, "less than one cycle of the carrier"),
    ({"bandwidth_khz": 2000.0}, "lfm"), ({"turns_while_listening": "no"}, "expected true or false"),
    ({"receive": "line"}, 'unknown attribute "receive"')])
def test_refusals(attributes, words):
    with pytest.raises(Exception) as caught:
        sector_scan({"seabed": bed(20)}, sensor=attributes)
    assert words in str(caught.value)


def test_large_smooth_surfaces_are_announced_and_reported_ping_by_ping(monkeypatch):
    """Over a bed of metres such a ping takes minutes: here over one of a metre."""
    from mitsonar.echoes.smooth import targets

    monkeypatch.setattr(targets, "WORTH_SAYING", 1)
    slow = {"frequency_khz": 100.0, "bandwidth_khz": 0.0, "pulse_ms": 0.1, "pings": 3, "speed_knots": 0.05}
    scene = sector_scan({"seabed": bed(6.0, {"type": "rigid"}, size=1.0)}, integrator={"cell": 4.0, "rays": 500},
                        sensor={**slow, "depth": 5.0, "start": None}, film={"range": 2.0, "bins": 20})
    done = []
    with pytest.warns(UserWarning, match="smooth surfaces within reach need .* cells each time they are ensonified"):
        mitsonar.render(scene, progress=lambda now, total: done.append(now))
    assert done == sorted(done) and len({now for now in done if now < 1}) >= 3 and done[-1] == pytest.approx(3)
