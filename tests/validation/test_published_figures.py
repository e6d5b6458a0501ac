"""Figures 2 and 3 of the published method, against the geometry they show.

Figure 2, water of one speed: the bed z(x) faces the sonar at height s where x + (z - s) z' = 0, and two-way time there
is 2 |(x, z - s)| / c. Tolerances: rays of the dense bundle are up to 30 mm apart there and facets 20 mm, so 40 mm in
place; facets lie below a crest's arc by up to 66 um, 88 ns, so 100 ns in time, 0.004 of a sample. A caustic goes as
|t - t_c|^(-1/2), so its mean over a sample as the square root of the sampling rate: four times the rate doubles the
peak (found 1.95 and 1.93 from 150 to 600 kHz, as what lies beside the caustic does not grow): 0.1.

Figure 3: impulses against exact eigenrays (found 0.2 ps, wanted 0.1 ns) and against straight rays in water of one
speed, where both shifts have closed forms (module figure_3). These lack the wavefront's curvature, d^2 / 2 R c = 0.3 us
at 11 m and less farther off: 0.5 us.
"""
import numpy as np
import pytest

from mitsonar.scenes.published import RESULTS, figure_2, figure_3

WAVELENGTH, HEIGHT, ALTITUDE, SPEED = 3.0, 0.6, 10.0, 1500.0


@pytest.fixture(scope="module")
def waves():
    return figure_2.compute()


@pytest.fixture(scope="module")
def impulses():
    return figure_3.compute()


# ---------------------------------------------------------------------------------------------------------- figure 2

def facing():
    """Places (x, two-way time) at which the sinusoid faces the sonar, beside the nadir."""
    k = 2 * np.pi / WAVELENGTH
    x = np.linspace(0.5, 30, 200001)
    tilt = x - (HEIGHT / 2 * np.cos(k * x) - ALTITUDE) * (HEIGHT / 2 * k * np.sin(k * x))
    change = np.flatnonzero(tilt[:-1] * tilt[1:] < 0)
    x = x[change] - tilt[change] * np.diff(x)[change] / np.diff(tilt)[change]
    return x, 2 * np.hypot(x, ALTITUDE - HEIGHT / 2 * np.cos(k * x)) / SPEED


def test_caustics_lie_where_the_bed_faces_the_sonar(waves):
    x, time = facing()
    assert waves.caustic_x.values == pytest.approx(x, abs=0.04)
    assert waves.caustic_time.values == pytest.approx(time, abs=100e-9)
    # from the trough to the crest, on the side that looks at the sonar
    assert list(waves.caustic_kind.values) == ["far", "near"] * 2 and len(x) == 4


def test_rays_are_even_in_time_on_the_flat_bed():
    flat = figure_2.compute(height=0, rays=400)
    steps = np.diff(flat.travel_time.values)
    assert np.ptp(steps) < 1e-3 * steps.mean()
    assert flat.sizes["caustic"] == 0
    # one everywhere, half a kernel from the ends of the rays
    inside = flat.response.sel(bundle="dense").where((flat.time > 0.0140) & (flat.time < 0.0390), drop=True)
    assert inside.sel(kernel="peterson").values == pytest.approx(1, abs=5e-3)


def test_more_rays_leave_the_peaks(waves):
    highest = waves.peak.max("shift")
    assert (highest.sel(bundle="scene") / highest.sel(bundle="dense")).values == pytest.approx(1, abs=0.05)


def test_peterson_tames_what_depends_on_the_samples(waves):
    nearest, peterson = (waves.peak.sel(bundle="scene", kernel=kernel).values for kernel in ("nearest", "peterson"))
    assert 0.07 < 1 - peterson.max() / nearest.max() < 0.17             # 12 % lower at its worst
    assert nearest.max() / nearest.min() > 1.4                          # 14.0 to 22.3 as samples fall
    assert peterson.max() / peterson.min() < 1.2                        # 17.1 to 19.6
    # and few rays are as good as many
    assert 0.06 < waves.difference.sel(kernel="nearest") < 0.11
    assert waves.difference.sel(kernel="peterson") < 0.02
    # the mean is the same: no energy is lost
    means = waves["mean"].sel(bundle="scene")
    assert float(means.max() / means.min()) == pytest.approx(1, abs=2e-3)


def test_no_kernel_removes_a_caustic():
    slow, fast = (figure_2.compute(sample_rate_khz=rate, rays=round(5.3 * rate), range=12).peak.sel(bundle="scene")
                  for rate in (150, 600))
    for kernel in ("nearest", "peterson"):
        assert float(fast.sel(kernel=kernel).mean() / slow.sel(kernel=kernel).mean()) == pytest.approx(2, abs=0.1)


# ---------------------------------------------------------------------------------------------------------- figure 3

def test_three_impulses_become_27(impulses):
    assert impulses.delay.count(("ray", "tx", "rx")).values.tolist() == [3, 27, 27, 27]
    assert (impulses.delay.notnull() == impulses.intensity.notnull()).all()


def test_delays_are_those_of_eigenrays(impulses):
    assert float(abs(impulses.delay - impulses.exact_delay).max()) < 0.1e-9


def shifts(dataset, arrangement):
    one = dataset.sel(arrangement=arrangement)
    return one.uniform_transmit_shift.values, one.uniform_receive_shift.values


def test_shifts_in_water_of_one_speed_are_those_of_straight_rays(impulses):
    theta, c = impulses.launch_angle.values, impulses.sound_speed
    step = 0.1 / np.sqrt(2)
    receive = 0.1 * np.abs(np.sin(np.pi / 4 - theta)) / c
    transmit = (step / np.sin(theta) + (step / np.tan(theta) + step) * np.cos(theta)) / c
    own, common = shifts(impulses, "3 vertically"), shifts(impulses, "3 vertically, common scatterers")
    assert own[0] == pytest.approx(transmit, abs=0.5e-6)
    for found in (own[1], *common):
        assert found == pytest.approx(receive, abs=0.5e-6)


def test_the_published_shift_of_260_samples_is_that_of_the_hits(impulses):
    last = impulses.isel(ray=figure_3.SHOWN)
    own, common = (last.sel(arrangement=name) for name in ("3 vertically", "3 vertically, common scatterers"))
    assert float(own.transmit_shift) == pytest.approx(255.7e-6, abs=0.5e-6)
    assert float(own.receive_shift) == pytest.approx(24.95e-6, abs=0.05e-6)
    assert float(common.transmit_shift) == pytest.approx(float(common.receive_shift), abs=0.05e-6)
    # the water is a small part of it
    assert abs(float(own.transmit_shift - own.uniform_transmit_shift)) < 0.05 * float(own.transmit_shift)


def test_horizontal_elements_hear_within_two_samples(impulses):
    """Delays, not rounded: where they straddle the middle of a sample, rounding makes two of 1.6."""
    horizontal = impulses.sel(arrangement="3 horizontally")
    assert (np.ptp(horizontal.delay.values * impulses.sampling_rate, (1, 2)) < 2).all()
    assert np.ptp(horizontal.delay.values, (1, 2)).max() < 2e-6


def test_what_the_figure_sets_itself_is_refused():
    with pytest.raises(ValueError, match="sets axis itself"):
        figure_3.compute(axis="down")


# ------------------------------------------------------------------------------------------------------------- both

@pytest.mark.parametrize("name", ["figure_2", "figure_3"])
def test_table_rows_and_picture(name, request, tmp_path):
    from mitsonar.plots import canvas

    result, dataset = RESULTS[name], request.getfixturevalue({"figure_2": "waves", "figure_3": "impulses"}[name])
    assert {"figure_2": "12 % below", "figure_3": "1.02 MHz would make"}[name] in result.table(dataset)
    header, records = result.rows(dataset)
    assert {len(record) for record in records} == {len(header)}
    canvas.save(result.plot(dataset), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
