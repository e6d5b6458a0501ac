"""Point targets in focused images: place, width, side lobes, level and phase against closed forms.

Echoes are made by brute force (`inputs.raw_strip`), with exact eigenrays and nothing standing still, in code that
shares no delays with what is tested.
Of sines |u| <= λ/2L and a sweep of bandwidth B, -3 dB widths (Cumming and Wong 2005, ch. 2; Harris 1978, Proc. IEEE
66, 51):

    boxcar 0.886 L/2, 0.886 c/2B      hann 1.44 of each      taylor (4, 30 dB) 1.12 of each

A full circle has J₀²(4πρ cos γ / λ): 0.179 λ / cos γ, γ the grazing angle (Soumekh 1999, ch. 7).
"""
import drjit as dr
import numpy as np
import pytest

import mitsonar
from mitsonar.sonar.pulses.pulses import cw, lfm
from mitsonar.synthetic_aperture.focusing.focusing import Focuser, focus, overlap_shares
from mitsonar.synthetic_aperture.focusing.grids import circle_grid, ground_grid
from mitsonar.synthetic_aperture.products.point_response import point_response
from mitsonar.water import SoundSpeedProfile
from tests.inputs.raw_strip import circle, line_array, raw_strip, straight

BANDWIDTH, LENGTH, RECEIVERS, SPEED, C = 60e3, 0.04, 32, 1.5, 1500.0
PULSE = lfm(300e3, BANDWIDTH, 1e-3)
STEP = 0.8 * RECEIVERS * LENGTH / 2
HEIGHT, BED = 10.0, 20.0
THERMOCLINE = SoundSpeedProfile([0, 8, 12, 14, 30, 60], [1525, 1524, 1505, 1490, 1484, 1482])
UNEASY = {"sway": (0.05, 3.0), "heave": (0.05, 3.5), "surge": (0.03, 5.0), "yaw": (0.02, 4.0), "roll": (0.02, 3.0),
          "pitch": (0.02, 5.0)}
STRENGTH = -20.0


def strip(slant, motion=None, profile=C, pings=None, **more):
    """Echoes of one target abreast of the middle of a strip as long as its aperture, and the target's place."""
    pings = pings or int((2.6 * slant * 0.5 * 0.005 / LENGTH + 1.5) / STEP) + 1
    target = np.sqrt(slant ** 2 - HEIGHT ** 2), 0.5 * pings * STEP + 0.003, BED, STRENGTH
    start = 2 * slant / C
    more = {"receivers": line_array(RECEIVERS, LENGTH), **more}
    raw = raw_strip(straight(SPEED, **(motion or {})), PULSE, target, ping_time=np.arange(pings) * STEP / SPEED,
                    sampling_rate=PULSE.suggested_sampling_rate, window=(0.985 * start - 5e-4, 1.015 * start + 2e-3),
                    tx_length=LENGTH, rx_length=LENGTH, profile=profile, **more)
    return raw, target


def around(target, half=(0.3, 0.2), step=(0.005, 0.0025)):
    along, across = ((at - reach, at + reach) for at, reach in zip((target[1], target[0]), half))
    return ground_grid(along, across, step, BED)


@pytest.fixture(scope="module")
def near():
    return strip(30.0)


@pytest.mark.parametrize("slant", [30.0, 75.0, 150.0])
@pytest.mark.parametrize("motion, profile", [({}, C), (UNEASY, THERMOCLINE)], ids=["straight", "uneasy in thermocline"])
def test_a_target_is_in_its_place_with_its_strength_and_as_wide_as_theory_says(slant, motion, profile):
    """Peak within a tenth of a cell, level 0.1 dB (interpolation, -52 dB, and beams of off-centre receivers), phase
    0.02 rad, 8 µm of way; along the track within 10 %, as yaw lets the beams taper the aperture, across 3 %."""
    raw, target = strip(slant, motion, profile)
    found = point_response(focus(raw, around(target), window="none", range_window=None))
    along, across = found.along_track, found.across_track
    cosine = target[0] / slant
    cell = C / (2 * BANDWIDTH)
    assert abs(along.place - target[1]) < 0.1 * LENGTH / 2
    assert abs(across.place - target[0]) * cosine < 0.1 * cell
    assert along.width == pytest.approx(LENGTH / 2, rel=0.1)
    assert across.width * cosine == pytest.approx(0.886 * cell, rel=0.03)
    assert found.level_db == pytest.approx(STRENGTH, abs=0.1)
    assert abs(found.phase) < 0.02


@pytest.mark.parametrize("window, width, lobe", [("boxcar", 0.886, -13.3), ("hann", 1.44, -31.5),
                                                 ("taylor 4 30", 1.12, -30.0)])
def test_windows_set_widths_and_side_lobes(near, window, width, lobe):
    """Side lobes within 2 dB: the sweep's spectrum has ripples of its own, and phase centres are L/2 apart."""
    raw, target = near
    found = point_response(focus(raw, around(target), window=window, range_window=window))
    assert found.along_track.width == pytest.approx(width * LENGTH / 2, rel=0.03)
    assert found.across_track.width * target[0] / 30 == pytest.approx(width * C / (2 * BANDWIDTH), rel=0.03)
    assert found.along_track.side_lobe_db == pytest.approx(lobe, abs=2)
    assert found.across_track.side_lobe_db == pytest.approx(lobe, abs=2)


def test_one_sound_speed_misplaces_and_blurs_what_the_profile_focuses():
    raw, target = strip(75.0, UNEASY, THERMOCLINE)
    exact = point_response(focus(raw, around(target)))
    wrong = point_response(focus(raw, around(target), 1500.0))
    assert exact.level_db == pytest.approx(STRENGTH, abs=0.1)
    assert wrong.level_db < STRENGTH - 3
    assert abs(wrong.across_track.place - target[0]) > 0.1


def test_a_full_circle_resolves_a_fifth_of_the_wavelength():
    """Within 2 %: bandwidth narrows J₀ by a little."""
    pulse, radius = lfm(100e3, 30e3, 1e-3), 15.0
    pings = 109
    raw = raw_strip(circle(radius), pulse, [0.05, -0.02, BED, STRENGTH], window=(0.0234, 0.0262),
                    ping_time=np.arange(pings) * 2 * np.pi * radius / SPEED / pings,
                    sampling_rate=pulse.suggested_sampling_rate, receivers=line_array(24, 0.08)[::3], tx_length=0.08,
                    rx_length=0.08)
    found = point_response(focus(raw, circle_grid(raw, size=0.2), range_window=None))
    wanted = 0.179 * 0.015 * np.hypot(radius, HEIGHT) / radius
    assert found.along_track.width == pytest.approx(wanted, rel=0.02)
    assert found.across_track.width == pytest.approx(wanted, rel=0.02)
    assert (found.across_track.place, found.along_track.place) == pytest.approx((0.05, -0.02), abs=2e-4)
    assert found.level_db == pytest.approx(STRENGTH, abs=0.1)


def test_banks_are_focused_apart_and_transmitters_send_in_turn():
    """Phases of the two rows agree: each is focused with its own delays."""
    receivers = line_array(16, LENGTH, banks=2)
    raw, target = strip(30.0, profile=THERMOCLINE, receivers=receivers, bank=np.arange(32) // 16,
                        transmitters=np.array([[0.16, 0, 0.1], [-0.16, 0, 0.1]]), pings=20)
    image = focus(raw, around(target, (0.1, 0.1)))
    assert image.sizes["bank"] == 2
    for bank in range(2):
        found = point_response(image, bank=bank)
        assert found.level_db == pytest.approx(STRENGTH, abs=0.15)
        assert abs(found.phase) < 0.02
        assert abs(found.along_track.place - target[1]) < 0.002


def test_a_port_look_sees_port_alone():
    raw, target = strip(30.0)
    port = raw.assign_attrs(look=[0.0, -raw.attrs["look"][1], raw.attrs["look"][2]])
    with pytest.raises(ValueError, match="the grid lies outside the beam and the record"):
        focus(port, around(target))


def test_pings_one_by_one_make_the_same_bytes_whatever_the_threads(near):
    raw, target = near
    grid = around(target, (0.1, 0.1))
    whole = focus(raw, grid).image.values
    before = dr.thread_count()
    try:
        dr.set_thread_count(1 if before > 1 else 2)
        focuser = Focuser(raw.isel(ping=slice(0, 1)), grid)
        for ping in range(raw.sizes["ping"]):
            focuser.add(raw.isel(ping=slice(ping, ping + 1)))
        np.testing.assert_array_equal(focuser.image().image.values, whole)
    finally:
        dr.set_thread_count(before)


def test_a_navigated_track_moves_the_image(near):
    raw, target = near
    moved = raw[[f"motion_{one}" for one in ("time", "x", "y", "depth", "roll", "pitch", "heading")]]
    moved = moved.assign(motion_x=moved.motion_x + 0.05)
    found = point_response(focus(raw, around(target), trajectory=moved))
    assert found.across_track.place - target[0] == pytest.approx(0.05, abs=1e-3)


def test_a_ping_of_constant_frequency_focuses_along_the_track():
    pulse = cw(300e3, 1e-4)
    raw = raw_strip(straight(SPEED), pulse, [28.0, 6.0, BED, STRENGTH], ping_time=np.arange(24) * STEP / SPEED,
                    sampling_rate=pulse.suggested_sampling_rate, window=(0.0385, 0.042), tx_length=LENGTH,
                    rx_length=LENGTH, receivers=line_array(RECEIVERS, LENGTH))
    found = point_response(focus(raw, around((28.0, 6.0), (0.2, 0.4)), range_window=None))
    assert found.along_track.width == pytest.approx(1.12 * LENGTH / 2, rel=0.05)
    assert found.level_db == pytest.approx(STRENGTH, abs=0.2)


def test_shares_of_overlapping_pings_add_to_one():
    along = line_array(32, LENGTH)[:, 0]
    for step in (7, 16, 25):                              # in phase centres, of which a ping has 32
        total = np.zeros(400)
        for first in range(0, 400 - 32, step):
            total[first:first + 32] += overlap_shares(along, step * LENGTH / 2)
        inner = total[50:300]
        np.testing.assert_allclose(inner, inner[0], rtol=1e-9)
    np.testing.assert_array_equal(overlap_shares(along, 0.64), 1)


@pytest.mark.parametrize("change, options, words", [
    (lambda raw: raw.isel(ping=slice(0, 1)), {}, "two or more pings"),
    (lambda raw: raw.assign(motion_x=raw.motion_x * np.nan), {}, "motion_x holds numbers that are not finite"),
    (lambda raw: raw.assign(motion_roll=raw.motion_roll + [*[0] * (len(raw.motion_time) - 1), 1e300]), {},
     "motion_roll reaches 1e.300, beyond 1e.08; repair"),
    (lambda raw: raw.assign(ping_time=raw.ping_time + 100), {}, "the trajectory runs from"),
    (lambda raw: raw.assign(signal=raw.signal * np.nan), {}, "signals that are not finite"),
    (lambda raw: raw, {"window": ""}, "window"), (lambda raw: raw, {"range_window": "tailor"}, "window"),
    (lambda raw: raw, {"range_window": "taylor x"}, "its numbers"), (lambda raw: raw, {"aperture": 2.0}, "aperture is"),
    (lambda raw: raw.drop_vars("time"), {}, "time"),
    (lambda raw: raw, {"grid": ground_grid((0, 1), (300, 301), (0.1, 0.1), BED)}, "the grid lies outside")])
def test_what_cannot_be_focused_is_refused_in_a_sentence(near, change, options, words):
    raw, target = near
    options = {"grid": around(target, (0.05, 0.05)), **options}
    with pytest.raises(ValueError, match=words):
        focus(change(raw), **options)


def test_the_share_of_points_that_no_ping_sees_is_said(near):
    raw, (across, along, *_) = near
    grid = ground_grid((along - 0.1, along + 0.1), (across - 60.1, across + 0.1), (0.1, 30.0), BED)
    with pytest.warns(UserWarning, match=r"no ping sees [\d.]+ % of the grid's points: their level is -inf"):
        focus(raw, grid)


def test_a_grid_that_is_none_is_a_type_error(near):
    with pytest.raises(TypeError, match="a grid of mitsonar.synthetic_aperture.focusing.grids or None, got a str"):
        mitsonar.focus(near[0], grid="x")
