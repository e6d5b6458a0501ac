"""Comparison of sidescans: nothing against itself, a known low pass given back, gain no difference, refusals.

Lines are independent Rayleigh amplitudes behind the taps (k, 1 - 2k, k) along range, over a water column at 2 %; their
r1 and CV are closed forms (`clue_features.three_taps`). A patch's r1 has a standard error of 1/64, the median of 112
patches 0.002; tolerance 0.02 with the local mean's bias.
"""
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import mitsonar
from mitsonar.cli.main import main
from mitsonar.comparison.clue_features import three_taps
from mitsonar.comparison.record import opened
from mitsonar.io import sidescan_lines
from mitsonar.io.records import netcdf
from mitsonar.plots.sheets.comparison_sheet import comparison_figure

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/sidescan"
R1 = "correlation in range, lag 1"


def line(k=0.1, seed=0, pings=256, samples=320, gain=1.0):
    """Return an image whose recorder's counts are Rayleigh amplitudes behind three taps, in samples of 4 cm."""
    drawn = np.random.default_rng(seed).rayleigh(size=(pings, 2, samples + 2))
    drawn[..., :100] *= .02
    count = 4000 * gain * (k * drawn[..., :-2] + (1 - 2 * k) * drawn[..., 1:-1] + k * drawn[..., 2:])
    return xr.Dataset({"level": (("ping", "side", "range"), 20 * np.log10(count)),
                       "recorded": (("ping", "side", "range"), np.round(count).astype(np.uint16))},
                      {"side": ["port", "starboard"], "range": 0.02 + 0.04 * np.arange(samples)})


@pytest.fixture(scope="module")
def real():
    return line()


def test_a_sidescan_is_no_different_from_itself(real):
    found = mitsonar.compare(real, real)
    known = np.isfinite(found["auc"].values)
    assert known.sum() > 40 and found["auc"].values[known] == pytest.approx(0.5)
    for name in ("clue_median", "value", "mean_db", "picture"):
        assert np.array_equal(*found[name].values, equal_nan=True), name


def test_pings_of_the_same_time_are_compared(real):
    times = 1.7e9 + 0.1 * np.arange(256)
    dated = real.assign_coords(ping_time=("ping", times))
    part = dated.isel(ping=slice(64, 192))
    found = mitsonar.compare(dated, part)
    assert found.attrs["remarks"][0] == "128 of 256 real pings are of the time that both records cover"
    assert np.array_equal(*found["picture"].values)
    found = mitsonar.compare(dated, part.assign_coords(ping_time=part["ping_time"] + 1e6))       # no common time: all
    assert "256 pings of 320 samples" in found.attrs["remarks"][0]


def test_a_low_pass_is_given_back_and_gain_is_none(real):
    found = mitsonar.compare(real, line(k=0, seed=5, gain=2))
    clue = found.isel(clue=list(found["clue"].values).index(R1))
    assert clue["clue_median"].values == pytest.approx([three_taps(k)[0] for k in (0.1, 0)], abs=0.02)
    assert float(clue["auc"]) > 0.99 and str(clue["kind"].values) == "patches of bed"
    assert abs(float(clue["auc_control"]) - 0.5) < 0.35               # patches overlap: some ten are independent
    assert R1 in repr(found)
    variation = found["value"].sel(statistic="coefficient of variation").mean("side").values
    assert variation == pytest.approx([three_taps(k)[1] for k in (0.1, 0)], abs=0.03)
    beyond = found["distance"].values > 5
    assert np.abs(np.diff(found["mean_db"].values[..., beyond].mean((1, 2)))) < 0.1       # twice the gain
    assert np.abs(np.diff(found["picture"].values.mean((1, 2)))) < 0.03


def test_a_short_line_has_pictures_and_says_what_is_missing(real):
    found = mitsonar.compare(real, line(pings=20))
    assert "auc" not in found and "no clues of patches of bed" in repr(found) and "no statistics" in repr(found)
    assert np.isfinite(found["picture"]).all() and np.isfinite(found["mean_db"]).all()


def test_a_line_without_a_first_return_has_pictures_and_says_so(real):
    even = real.copy(deep=True)
    even["recorded"][:] = 1000                                        # no water column before the bed
    found = mitsonar.compare(real, even)
    assert np.isfinite(found["picture"]).all() and "auc" not in found
    assert "no statistics of a dataset, port: no first return was found" in repr(found)


def test_parts_of_a_comparison_print_as_datasets(real):
    found = mitsonar.compare(real, real)
    for part in (found.isel(line=0), found.sel(side="port"), found.isel(clue=0), found[["auc"]]):
        assert "Dimensions" in repr(part)


def test_what_cannot_be_compared_is_refused(real):
    def refused(one, other):
        with pytest.raises(ValueError) as caught:
            mitsonar.compare(one, other)
        return str(caught.value)

    assert "is no sidescan of two sides, it has port" in refused(real, real.isel(side=[0]))
    assert "a comparison takes two or more" in refused(real.isel(ping=[0]), real)
    assert "give two records of one kind" in refused(real, xr.Dataset({"travel_time": ("beam", np.zeros(3))}))


def test_the_command_draws_pictures_and_clues(real, tmp_path, capsys):
    netcdf.write(real, tmp_path / "real.nc")
    assert main(["compare", *2 * [str(tmp_path / "real.nc")], "-o", str(tmp_path / "c.nc"),
                 "--sheet", str(tmp_path / "c.png")]) == 0
    assert "strongest clues" in capsys.readouterr().out and (tmp_path / "c.png").stat().st_size > 50_000
    back = opened(tmp_path / "c.nc")
    assert back["picture"].dims == ("line", "row", "column") and len(comparison_figure(back).axes) == 5
    assert repr(back).startswith("Comparison of real.nc with real.nc")


@pytest.mark.skipif(not MEASURED.is_dir(), reason="the shared sidescan lines are not here")
def test_a_recorded_sidescan_is_compared_by_its_samples():
    record = sidescan_lines.read(MEASURED / "scotsman_600khz.xtf", pings=slice(0, 130))
    found = mitsonar.compare(record, record)
    assert found["auc"].values[np.isfinite(found["auc"])] == pytest.approx(0.5)
    clue = found["clue_median"].values[0, list(found["clue"].values).index(R1)]
    assert 0.1 < clue < 0.35                                          # of the whole line 0.21
