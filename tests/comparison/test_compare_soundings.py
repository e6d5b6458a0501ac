"""Comparison of lines of soundings: nothing against itself, known biases given back, pairs, files, refusals.

The line is a plane bed seen without error in water of one speed, so that a bias put into a copy is the whole
difference. Tolerances are those of float32 files and, for interpolation between beams more than a degree apart, 1e-4 of
the depth: the bed is a plane, but its soundings have 1 cm of noise at 50 m.
"""
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from drawn_line import line as drawn_line

import mitsonar
from mitsonar.cli.main import main
from mitsonar.comparison.record import opened
from mitsonar.io.survey_lines import reading, write
from mitsonar.plots.sheets.comparison_sheet import comparison_figure
from tests.inputs.soundings_line import SPEED, soundings_line

MEASURED = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam"
DIFFERENCES = ("echo_time_difference", "echo_time_spread", "depth_difference", "depth_spread", "strength_difference",
               "strength_shape", "silent")
shared = pytest.mark.skipif(not MEASURED.is_dir(), reason="the shared survey lines are not here")


@pytest.fixture(scope="module")
def line():
    """Six pings of 90 beams in three sectors, whose strengths fall with the angle."""
    made = soundings_line(pings=6, beams=90, column=False, snippets=False)
    return made.assign(backscatter_db=-20 - 10 * made["angle"] ** 2)


def known(found, name):
    values = found[name].values
    assert np.isfinite(values).any()
    return values[..., np.isfinite(values.reshape(-1, values.shape[-1])).all(0)]


def test_a_line_is_no_different_from_itself(line):
    found = mitsonar.compare(line, line)
    for name in DIFFERENCES:
        assert np.abs(known(found, name)).max() < 1e-9, name
    for name, one in found.data_vars.items():
        if "line" in one.dims:
            assert np.array_equal(*one.values, equal_nan=True), name
    assert found["ray_time"].values[0] < 0.02                         # the soundings' noise is 1 cm
    assert found.attrs["paired_by"] == "time"


def test_known_biases_are_given_back(line):
    deeper = mitsonar.compare(line, line.assign(depth=1.005 * line["depth"]))
    assert known(deeper, "depth_difference") == pytest.approx(0.5, abs=0.01)
    found = mitsonar.compare(line, line.assign(backscatter_db=line["backscatter_db"] + 2,
                                               valid=line["valid"] & (line["sector"] != 2)))
    strength = known(found, "strength_difference")
    assert np.median(strength) == pytest.approx(2, abs=1e-5)
    assert strength == pytest.approx(2, abs=0.4)                      # at the hole, bins have lost soundings
    assert np.abs(known(found, "strength_shape")).max() < 0.4
    writes = line.assign(written_backscatter_db=line["backscatter_db"] + 3)      # as the instrument's file would
    assert known(mitsonar.compare(line, writes), "strength_difference") == pytest.approx(3, abs=1e-4)
    silent = np.degrees(found["angle"].values[found["silent"].values > 0])
    assert silent.min() == pytest.approx(22, abs=5) and silent.max() > 55         # the third sector's angles
    assert "no sounding in" in repr(found)


def test_lever_arms_are_no_difference_of_times_and_a_step_is(line):
    away = np.stack([line["along_track"], line["across_track"], line["depth"] - line["ping_depth"]], -1)
    along_arms = (away / np.linalg.norm(away, axis=-1, keepdims=True)) @ [0.4, -0.3, 0.2]
    arms = line.assign(travel_time=line["travel_time"] + 2 / SPEED * along_arms)
    assert np.abs(known(mitsonar.compare(line, arms), "echo_time_difference")).max() < 5e-3
    aside = np.abs(np.degrees(line["angle"]) - 35) < 4
    step = arms.assign(travel_time=arms["travel_time"] + aside * 2 / SPEED * 0.5)
    found = mitsonar.compare(line, step)
    there = np.abs(np.degrees(found["angle"].values) - 35) < 1.5
    apart = found["echo_time_difference"].values
    assert apart[there] == pytest.approx(0.5, abs=0.02)
    assert np.nanmedian(np.abs(apart[~there])) < 5e-3


def test_parts_of_a_comparison_of_soundings_print_as_datasets(line):
    found = mitsonar.compare(line, line)
    for part in (found.isel(angle=3), found.sel(line="real"), found[["depth_difference"]]):
        assert "Dimensions" in repr(part)


def test_lines_without_a_common_time_are_paired_by_place(line):
    later = line.assign_attrs(start="2000-01-01T00:00:00Z")
    found = mitsonar.compare(line, later.isel(ping=slice(2, 6)))
    assert found.attrs["paired_by"] == "place" and found.attrs["pings"] >= 4
    assert np.nanmax(np.abs(found["depth_difference"])) < 0.1


def test_noise_between_neighbours_is_that_of_one_sounding(line):
    chance = np.random.default_rng(3)
    noisy = line.assign(depth=line["depth"] + 0.1 * chance.standard_normal(line["depth"].shape))
    found = mitsonar.compare(line, noisy)
    for name in ("depth_noise_beams", "depth_noise_pings"):
        assert np.median(known(found, name)[1]) == pytest.approx(0.2, abs=0.03)   # 0.1 m of 50 m


def test_levels_of_a_water_column_are_over_the_bed():
    line = drawn_line(column=400)
    louder = line.assign(column_level_db=line["column_level_db"] + 7)            # gain is no difference
    found = mitsonar.compare(line, louder)
    ring, water = found["column_ring"].values, found["column_water"].values
    assert np.nanmax(np.abs(np.diff(ring, axis=0))) < 1e-4 and np.nanmax(np.abs(np.diff(water, axis=0))) < 1e-4
    assert np.nanmedian(water[0] - ring[0]) == pytest.approx(40 - 65 + 1.6, abs=1)      # 70 % of the time of the ring


def test_a_comparison_is_read_back(line, tmp_path):
    found = mitsonar.compare(line, line.assign(depth=line["depth"] + 0.1))
    found.to_netcdf(tmp_path / "compare.nc")
    back = opened(tmp_path / "compare.nc")
    xr.testing.assert_identical(xr.Dataset(back.data_vars, back.coords), xr.Dataset(found.data_vars, found.coords))
    assert repr(back) == repr(found)
    assert "cannot prove" in back["depth_difference"].attrs["evidence"]
    assert len(comparison_figure(back).axes) >= 8


def test_what_cannot_be_compared_is_refused(line):
    def refused(real, simulated):
        with pytest.raises(ValueError) as caught:
            mitsonar.compare(real, simulated)
        return str(caught.value)

    assert "1 of 1 pings with soundings; a comparison takes two or more" in refused(line.isel(ping=[0]), line)
    later = line.assign_attrs(start="2000-01-01T00:00:00Z")
    assert "no two common pings" in refused(line, later.assign_attrs(crs="EPSG:32633"))
    assert "no two common pings" in refused(line, line.assign(ping_x=line["ping_x"] + 1e4))
    other = xr.Dataset({"level": ("range", np.zeros(3))})
    assert "is neither a line of soundings nor a sidescan" in refused(line, other)


def test_the_command_writes_terms_and_a_sheet(line, tmp_path, capsys):
    write(line, tmp_path / "line.kmall")
    write(line, tmp_path / "twin.nc")
    assert main(["compare", str(tmp_path / "line.kmall"), str(tmp_path / "twin.nc"), "-o", str(tmp_path / "c.nc"),
                 "--sheet", str(tmp_path / "c.png")]) == 0
    printed = capsys.readouterr().out
    assert "depth_difference" in printed and "cannot prove" in printed and "c.png" in printed
    assert (tmp_path / "c.png").stat().st_size > 20_000 and opened(tmp_path / "c.nc").attrs["simulated"] == "twin.nc"
    assert main(["plot", str(tmp_path / "c.nc")]) == 0 and (tmp_path / "c_comparison.png").is_file()
    assert main(["compare", str(tmp_path / "line.kmall"), str(tmp_path / "c.nc")]) == 2
    assert "c.nc is neither a line of soundings nor a sidescan" in capsys.readouterr().err


def test_a_scene_is_sounded_first(line, tmp_path, monkeypatch):
    asked = []

    def sounded(scene, seed, *, column):
        asked.append((scene, seed, column))
        return line

    monkeypatch.setattr("mitsonar.verbs.images.soundings", sounded)
    write(line, tmp_path / "line.nc")
    found = mitsonar.compare(tmp_path / "line.nc", tmp_path / "twin.xml", seed=4)
    assert asked == [(tmp_path / "twin.xml", 4, False)] and found.attrs["simulated"] == "twin.xml"


@shared
@pytest.mark.parametrize("name, rays_mm", [("em710_122m.all", 1), ("em2040_56m.all", 1), ("em2042_os01.kmall", 0.1)])
def test_a_recorded_line_is_no_different_from_itself(name, rays_mm):
    line = reading.read(MEASURED / name, water_column=False)
    found = mitsonar.compare(line, line)
    assert np.nanmax(np.abs(found["depth_difference"])) < 1e-9 and not found["silent"].any()
    assert 1e3 * found["ray_time"].values.max() < rays_mm
