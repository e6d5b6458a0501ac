"""What a sidescan image shows: first return, shadow, layover, labels, speckle, noise, and the same bytes every time."""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from scipy.stats import kstest
from track_files import write_track

import mitsonar
import mitsonar.scene.loading
from mitsonar.io.records import exr
from mitsonar.signal.gates import pulse_shares
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import bed, lambert, sidescan

ALTITUDE, HEIGHT, RANGE = 20.0, 1.5, 40.0          # sonar above the bed, box, ground range of its front

METRE_BY_METRE = {"speed_knots": 8 / (1852 / 3600), "ping_rate_hz": 8.0}


def box(x, height, width=1.0, length=60.0):
    """A box on the bed at 40 m depth, its front face at ground range x, long enough to fill the beam."""
    T = mi.ScalarTransform4f
    to_world = T().translate([x + width / 2, 0, -40 + height / 2]).scale([width / 2, length / 2, height / 2])
    return {"type": "cube", "to_world": to_world, "bsdf": lambert(-20.0)}


@pytest.fixture(scope="module")
def boxed():
    mitsonar.scene.loading.prepare()
    scene = sidescan({"bed": bed(40.0), "box": box(RANGE, HEIGHT)}, rays=400_000, film={"bins": 2000})
    return mitsonar.render(scene).sel(side="starboard")


def test_first_bottom_return_comes_from_right_below(boxed):
    """Water column until R = altitude; the first bin with an echo holds it."""
    heard = np.flatnonzero(boxed["rays"].values[0] > 0)
    assert abs(boxed["range"].values[heard[0]] - ALTITUDE) <= boxed.attrs["bin_width"]
    assert (boxed["level"].values[0, :heard[0] - 1] == -200).all()


def test_shadow_length_behind_a_box_is_that_of_geometry(boxed):
    """The ray over the box's rear top edge, ground range r at height h_t, meets the bed at slant range R h / (h -
    h_t)."""
    r = RANGE + 1.0
    grazing = np.hypot(r, ALTITUDE - HEIGHT)
    shadow = boxed["range"].values[boxed["shadow"].values[0] == 1]
    width = boxed.attrs["bin_width"]
    assert abs(shadow.min() - 0.5 * width - grazing) <= width
    assert abs(shadow.max() + 0.5 * width - grazing * ALTITUDE / (ALTITUDE - HEIGHT)) <= width
    assert np.all(np.diff(shadow) < 1.5 * width)


def test_top_of_a_wall_lies_over_the_bed_in_front_of_it(boxed):
    """Layover: the front top edge returns at sqrt(r² + (h - h_t)²), before its foot at sqrt(r² + h²)."""
    names = boxed.attrs["labels"]
    number = int(next(key for key, name in names.items() if name == "box"))
    shown = boxed["range"].values[boxed["label"].values[0] == number]
    width = boxed.attrs["bin_width"]
    assert abs(shown.min() - 0.5 * width - np.hypot(RANGE, ALTITUDE - HEIGHT)) <= width
    assert names[str(boxed["label"].values[0, int(30 / width)])] == "bed"


def test_depth_channel_tells_where_the_echo_came_from(boxed):
    far = boxed["depth"].values[0, -10:]
    assert np.abs(far - 40.0).max() < 1e-3
    on_top = boxed["depth"].values[0, int(np.hypot(RANGE + 0.5, ALTITUDE - HEIGHT) / boxed.attrs["bin_width"])]
    assert 40 - HEIGHT < on_top < 39.9                               # the bed in front of the box shares its bins


def test_adaptive_pass_feeds_the_bins_that_the_flat_bed_draw_starves():
    """Beyond the edge of a terrace 5 m below the sonar lies a floor 65 m below it. Its bins are reached through a few
    degrees, to which a flat bed 5 m below would give one ray in a hundred."""
    shapes = {"terrace": bed(25.0, size=8.0), "floor": bed(85.0)}
    fewest = {}
    for first_pass in (0.0, 0.15):
        scene = sidescan(shapes, rays=40_000, integrator={"first_pass": first_pass}, film={"bins": 400})
        dataset = mitsonar.render(scene)
        far = dataset.sel(side="starboard", range=slice(87, 100))
        fewest[first_pass] = np.percentile(far["rays"], 5)
    assert fewest[0.15] > 2 * fewest[0.0] > 0


def test_speckle_is_rayleigh_with_the_mean_level():
    """Bins as long as the pulse: I / <I> is exponential. KS on 4000 values at 1 %; the scale is known, so no
    Lilliefors. Pings a metre apart, more than the aperture, are independent."""
    scene = sidescan({"bed": bed(40.0)}, sensor={"pings": 40, "speckle": True, **METRE_BY_METRE},
                     film={"range": 75.0, "bins": 1000})
    dataset = mitsonar.render(scene, 3)
    part = dataset.isel(range=slice(500, 600), side=1)
    ratio = 10 ** ((part["level"].values - part["mean_level"].values) / 10)
    assert kstest(ratio.ravel(), "expon").pvalue > 0.01


def test_bins_finer_than_the_pulse_are_correlated_over_it():
    """Four bins a pulse: intensities of neighbours j apart correlate as the squared overlap (1 - j/4)², j = 1, 2, 3."""
    scene = sidescan({"bed": bed(40.0)}, sensor={"pings": 60, "speckle": True, **METRE_BY_METRE},
                     film={"range": 75.0, "bins": 4000},
                     rays=300_000)
    part = mitsonar.render(scene, 4).isel(range=slice(1600, 3600), side=1)
    ratio = 10 ** ((part["level"].values - part["mean_level"].values).astype(float) / 10) - 1
    for j in (1, 2, 3):
        found = np.mean(ratio[:, :-j] * ratio[:, j:]) / np.mean(ratio ** 2)
        assert abs(found - (1 - j / 4) ** 2) < 0.03            # 120,000 values, 30,000 of them independent: 4 sigma
    assert pulse_shares(1.0, 4.0).sum() == pytest.approx(8.0)      # half bins


def test_noise_has_the_band_of_the_pulse():
    """Bins a quarter of the pulse long, water column only: intensities j bins apart correlate as (1 - j/4)²."""
    scene = sidescan({"bed": bed(400.0)}, sensor={"pings": 60, "speckle": True, "noise": True},
                     film={"range": 75.0, "bins": 4000})
    intensity = 10 ** (mitsonar.render(scene, 6)["level"].values[:, 1].astype(float) / 10)
    ratio = intensity / intensity.mean() - 1
    for j in (1, 2, 3):
        assert abs(np.mean(ratio[:, :-j] * ratio[:, j:]) / np.mean(ratio ** 2) - (1 - j / 4) ** 2) < 0.03
    assert intensity[:, :20].mean() == pytest.approx(intensity.mean(), rel=0.1)        # also at the ends of the record


def test_absorbed_echoes_keep_their_label_and_depth():
    """300 dB/km over 100 m: echoes 60 dB below those without absorption still say where they came from."""
    shapes = {"a_buoy": {"type": "sphere", "center": [0.0, 300.0, -5.0], "radius": 1.0, "bsdf": lambert()},
              "bed": bed(40.0)}
    scene = sidescan(shapes, sensor={"preset": "auv_900khz"}, water={"absorption_db_per_km": 300.0}, film={"bins": 200})
    far = mitsonar.render(scene).isel(range=slice(150, 199))
    names = far.attrs["labels"]
    assert {names[str(number)] for number in np.unique(far["label"]) if number} == {"bed"}
    assert np.nanmax(np.abs(far["depth"].values - 40.0)) < 0.05


def test_water_below_a_target_in_mid_water_is_no_shadow():
    """The flag begins with the first bottom return; a fish ball beside the track casts none on water."""
    ball = {"type": "sphere", "center": [8.0, 0.0, -28.0], "radius": 1.5, "bsdf": lambert(-10.0)}
    dataset = mitsonar.render(sidescan({"bed": bed(40.0), "ball": ball}, film={"bins": 400}))
    assert not dataset["shadow"].sel(range=slice(0, 19.5)).values.any()


def test_noise_fills_the_water_column_at_the_level_of_band_and_beam():
    """NL + 10 log BW - DI; the mean of 40,000 exponential values is known to 0.5 %."""
    scene = sidescan({"bed": bed(40.0)}, sensor={"pings": 40, "speckle": True, "noise": True, "noise_level_db": 40.0})
    dataset = mitsonar.render(scene, 5)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    expected = 40 + 10 * np.log10(1 / sonar.pulse_length) - sonar.directivity_index_db()
    column = 10 ** (dataset["level"].values[..., :150] / 10)
    assert abs(10 * np.log10(column.mean()) - expected) < 0.12
    assert dataset.attrs["noise_db"] == pytest.approx(expected)


def test_same_seed_same_bytes_whatever_threads_and_blocks(tmp_path, monkeypatch):
    def written(name, seed=7):
        scene = sidescan({"bed": bed(40.0), "box": box(RANGE, HEIGHT)}, rays=20_000,
                         sensor={"pings": 9, "speckle": True, "noise": True})
        exr.write(mitsonar.render(scene, seed), tmp_path / name)
        return (tmp_path / name).read_bytes()

    threads = dr.thread_count()
    try:
        first = written("a.exr")
        dr.set_thread_count(5)
        assert written("b.exr") == first
        monkeypatch.setattr("mitsonar.survey.energy.sides.RAYS_PER_BLOCK", 40_000)
        assert written("c.exr") == first
        assert written("d.exr", seed=8) != first
    finally:
        dr.set_thread_count(threads)


def test_kernels_compile_once_whatever_the_numbers():
    """A second scene with other depth, profile, range, beam and bins reuses every kernel of the first."""
    def run(depth, speed, bins, rays, frequency):
        scene = sidescan({"bed": bed(depth)}, water={"profile": f"0:{speed + 10}, 12:{speed}"}, film={"bins": bins},
                         rays=rays, sensor={"frequency_khz": frequency})
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            mitsonar.render(scene)
            return {entry["hash"] for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT}

    first = run(40.0, 1490.0, 700, 20_000, 100.0)
    assert first
    assert run(43.0, 1485.0, 900, 26_000, 130.0) <= first


def test_mi_render_gives_the_waterfall():
    scene = sidescan({"bed": bed(40.0)}, film={"bins": 200})
    image = mi.render(scene, seed=2).numpy()
    level = mitsonar.render(scene, 2)["level"].values
    assert image.shape == (4, 400, 1)
    np.testing.assert_array_equal(image[:, :200, 0], level[:, 0, ::-1])
    np.testing.assert_array_equal(image[:, 200:, 0], level[:, 1])


def test_roll_turns_the_beams(tmp_path):
    """Rolled 20 degrees to starboard (starboard side down): the starboard face looks steeper and hears more from
    near, the port face flatter and hears more from afar. Unrolled, both sides hear the same."""
    sensor = {"depression_deg": 30.0, "vertical_beam_width_deg": 20.0}
    near, far = slice(25, 35), slice(60, 90)

    def levels(roll):
        track = write_track(tmp_path / "track.csv", [[0, 0, 0, -20, roll, 0, 0]])
        scene = sidescan({"bed": bed(40.0)}, sensor={**sensor, "track": track}, film={"bins": 100})
        return mitsonar.render(scene)["mean_level"]

    level = levels(0)
    assert np.abs(level.sel(side="port") - level.sel(side="starboard")).sel(range=slice(25, 90)).max() < 1.0
    level = levels(20)
    difference = level.sel(side="starboard") - level.sel(side="port")
    assert difference.sel(range=near).mean() > 6
    assert difference.sel(range=far).mean() < -6
