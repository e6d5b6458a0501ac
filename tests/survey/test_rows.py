"""The energy record of both kinds of rows: the sides of a sidescan, and the beams of an array.

What holds of any rows goes through the same tests. Levels of sides are tested in `sonars/test_sidescan_levels`. Those
of beams are tested here, against the sonar equation of a level Lambert bed in water of one sound speed. A fan of
beams ahead of a baffle, from -Ψ to Ψ about its athwart axis, receives of the bed at slant range R

    p² = 10^(SL/10) μ (H/R)² Δφ R ΔR / R⁴ 10^(-2 α R / 10),    Δφ = 2 arcsin(min(1, R sin Ψ / √(R² - H²)))
"""
from dataclasses import replace

import numpy as np
import pytest

from mitsonar.imaging.fan import fan_directions
from mitsonar.survey.energy.energy import record
from mitsonar.survey.energy.sides import Sides
from mitsonar.survey.energy.sound_paths import SoundPaths
from mitsonar.survey.fan.beams import Beams
from mitsonar.survey.motion.places import Places
from mitsonar.validation.scenes import array_sonar, bed, lambert, point_target, sidescan

H, MU_DB, TARGET = 8.0, -27.0, [0.0, 14.0, -17.5]
ABSORPTION = 300.0                 # [dB/km]: 11 dB out to 18 m and back
ARRAY = {"receive": "line", "receive_elements": 24, "receive_normal": "forward", "receive_baffle": "hard",
         "frequency_khz": 200.0, "pulse_ms": 0.5, "bandwidth_khz": 20.0, "start": [0.0, 0.0, H - 20.0]}


def sides(absorption=30.0, shapes=None, pings=3, **shape):
    """A sidescan that looks across a level bed, heading so that the target is abeam."""
    made = sidescan({"seabed": bed(20.0, lambert(MU_DB), size=120.0), **(shapes or {})}, rays=20_000,
                    sensor={"start": [0.0, 0.0, H - 20.0], "heading_deg": 90.0, "pings": pings,
                            "vertical_beam_width_deg": 120.0, **shape},
                    water={"absorption_db_per_km": absorption}, film={"range": 20.0, "bins": 60})
    survey = made.integrator().survey(made, made.sensors()[0])
    return survey, Sides(survey)


def beams(absorption=30.0, shapes=None, pings=3, **shape):
    """A fan of 21 beams ahead over the same bed."""
    made = array_sonar({"seabed": bed(20.0, lambert(MU_DB), size=120.0), **(shapes or {})},
                       sensor={**ARRAY, "pings": pings, **shape}, water={"absorption_db_per_km": absorption},
                       film={"range": 20.0}, integrator={"cell": 0.5})
    survey = made.integrator().array_survey(made, made.sensors()[0])
    return survey, Beams(survey, *fan_directions(survey.receive, 21, np.pi / 2))


@pytest.fixture(autouse=True)
def few_rays(variant, monkeypatch):
    monkeypatch.setattr("mitsonar.survey.fan.beams.RAYS_PER_BIN", 2)
    monkeypatch.setattr("mitsonar.survey.fan.beams.FEWEST_RAYS", 20_000)


BOTH = pytest.mark.parametrize("rows_of", [sides, beams])


@BOTH
def test_the_record_has_a_row_for_each_side_or_beam_of_each_ping(rows_of):
    survey, rows = rows_of()
    made = record(survey, rows, 1)
    shape = 3, rows.per_ping, rows.bins.count
    assert made.intensity.shape == made.depth.shape == made.rays.shape == made.truth.label.shape == shape
    assert made.truth.share.shape == (*shape[:2], rows.labels, shape[2])
    assert made.path_intensity is None and made.coherent is None
    lit = made.rays > 0
    np.testing.assert_allclose(made.truth.share.sum(2)[made.intensity > 0], 1, atol=1e-5)
    np.testing.assert_allclose(made.depth[lit & (made.intensity > 0)], 20, atol=0.01)
    # the record ends before the bed is level with the horizon, and begins above it
    assert not lit[..., rows.bins.slant_range < 0.95 * H].any()
    assert lit[:, :, rows.bins.slant_range > 1.1 * H].mean() > 0.7


@BOTH
def test_the_same_seed_makes_the_same_record_in_any_blocks_and_another_seed_does_not(rows_of):
    survey, rows = rows_of()
    whole, other = record(survey, rows, 1), record(survey, rows, 2)
    told = []
    rows.pings_per_block = 1
    parts = record(survey, rows, 1, progress=lambda done, total: told.append((done, total)))
    np.testing.assert_array_equal(parts.intensity, whole.intensity)
    np.testing.assert_array_equal(parts.truth.share, whole.truth.share)
    assert not np.array_equal(other.intensity, whole.intensity)
    assert told == [(1, 3), (2, 3), (3, 3)]


@BOTH
def test_absorption_takes_its_share_of_every_bin(rows_of):
    """10 log of the ratio is 2 α R, but for where the rays of a bin lie in it: half a bin's 2 α ΔR."""
    (survey, rows), (lossless, clear) = rows_of(ABSORPTION), rows_of(0.0)
    with_loss, without = record(survey, rows, 1).intensity, record(lossless, clear, 1).intensity
    seen = with_loss > 0
    expected = np.broadcast_to(2e-3 * ABSORPTION * rows.bins.slant_range, seen.shape)
    slack = 1e-3 * ABSORPTION * np.diff(rows.bins.slant_range).max() + 0.001
    assert seen.any() and np.abs(10 * np.log10(without[seen] / with_loss[seen]) - expected[seen]).max() < slack


@BOTH
def test_water_that_absorbs_leaves_shares_as_they_are(rows_of):
    """The bed's echo and that of a point target in the same bin lose as much, though one is a power, one a pressure."""
    shares = []
    for absorption in (0.0, ABSORPTION):
        survey, rows = rows_of(absorption, {"buoy": point_target(TARGET, -40.0)}, pings=1)
        shares.append(record(survey, rows, 1).truth.share[:, :, 0])
    seen = (shares[0] > 0.05) & (shares[0] < 0.95)
    assert seen.any()
    np.testing.assert_allclose(shares[1][seen], shares[0][seen], atol=0.01)


@BOTH
def test_rows_receive_the_rays_that_they_launch(rows_of, monkeypatch):
    """Solid angles fill the sphere, patterns are 1 at most, and rows those of the block."""
    monkeypatch.setattr("mitsonar.survey.fan.beams.FEWEST_RAYS", 400_000)
    survey, rows = rows_of()
    sound = SoundPaths.of(survey, 40.0)
    place = Places(survey, sound.tracer, rows.underway, rows.per_ping).of(np.arange(rows.pings_per_block))

    def nowhere(place, rays):
        none = rays.direction.x > 2
        return type(rays.ping)(0) + 0 * rays.cell, none

    total = 0.0
    for rays in rows.passes(place, 1, nowhere):
        response = rows.response(place, rays, rays.direction)
        pattern, row = response.pattern.numpy(), np.broadcast_to(response.row.numpy(), len(response.pattern))
        total += rays.solid_angle.numpy().sum()
        assert pattern.min() >= 0 and pattern.max() <= 1 + 1e-5
        assert set(np.unique(row[pattern > 0])) == set(range(place.rows))
    assert total == pytest.approx(4 * np.pi * len(place.ping), rel=0.05)


def test_levels_of_a_fan_of_beams_close_the_sonar_equation(monkeypatch):
    monkeypatch.setattr("mitsonar.survey.fan.beams.FEWEST_RAYS", 400_000)
    survey, rows = beams(pings=1)
    power = record(survey, rows, 1).intensity[0].sum(0, dtype=float)
    R, width = rows.bins.slant_range, rows.bins.slant_range[1] - rows.bins.slant_range[0]
    far = (R > 1.15 * H) & (R < 19.0)
    R = R[far]
    # the outermost beams take half a beam more
    edge = np.sin(np.pi / 4 * (1 + 1 / 20))
    wide = 2 * np.arcsin(np.minimum(1, R * edge / np.sqrt(R ** 2 - H ** 2)))
    expected = 10 ** ((survey.source_level_db + MU_DB) / 10) * (H / R) ** 2 * wide * width / R ** 3 * 10 ** (-0.006 * R)
    assert 10 * np.log10(power[far].sum() / expected.sum()) == pytest.approx(0, abs=0.05)
    parts = np.array_split(np.arange(len(R)), 12)
    assert max(abs(10 * np.log10(power[far][part].sum() / expected[part].sum())) for part in parts) < 0.2


def test_too_many_sums_are_refused_before_anything_is_traced(monkeypatch):
    survey, _ = sides()
    monkeypatch.setattr("mitsonar.survey.energy.sides.MOST_SUMS", 1000)
    with pytest.raises(ValueError, match="60 bins and 1 shapes make .* sums a ping"):
        Sides(replace(survey))
    monkeypatch.setattr("mitsonar.survey.fan.beams.MOST_SUMS", 1000)
    with pytest.raises(ValueError, match="21 beams, .* take fewer beams, a shorter range"):
        beams()
