"""Grids and clouds of soundings: sums cell by cell against loops, places, and what a grid errs by."""
import numpy as np
import pytest
from soundings_line import ORIGIN, soundings_line

from mitsonar.hydrography.gridding import gridded, residual
from mitsonar.hydrography.record import variable
from mitsonar.io.records import geotiff

CELL = 4.0


@pytest.fixture(scope="module")
def line():
    return soundings_line(column=False, snippets=False)


def by_loop(line, cell, chosen):
    """Depths by cell's south-west corner, one sounding after the other."""
    found = {}
    for ping, beam in np.argwhere(line["valid"].values):
        x, y, depth, sigma = (line[name].values[ping, beam] for name in ("x", "y", "depth", "uncertainty"))
        key = ((x + ORIGIN[0]) // cell, (y + ORIGIN[1]) // cell)
        found.setdefault(key, []).append((depth, float(sigma)))
    return {key: chosen(*np.array(values).T) for key, values in found.items()}


@pytest.mark.parametrize("rule, chosen", [
    ("mean", lambda depth, sigma: (depth.mean(), depth.std(), len(depth))),
    ("shoalest", lambda depth, sigma: (depth.min(), depth.std(), len(depth))),
    ("weighted", lambda depth, sigma: (np.average(depth, weights=sigma**-2), depth.std(), len(depth)))])
def test_cells_hold_what_lies_in_them(line, rule, chosen):
    rough = line["uncertainty"] * (1 + 0.5 * np.sin(np.arange(line.sizes["beam"])))
    line = line.assign(uncertainty=variable("uncertainty", rough.values))
    grid = gridded(line, CELL, rule=rule)
    wanted = by_loop(line, CELL, chosen)
    assert int((grid["count"] > 0).sum()) == len(wanted) and max(count for *_, count in wanted.values()) > 2
    for (column, row), (depth, deviation, count) in wanted.items():
        cell = grid.sel(x=(column + 0.5) * CELL, y=(row + 0.5) * CELL)
        np.testing.assert_allclose([cell["depth"], cell["deviation"], cell["count"]], [depth, deviation, count],
                                   atol=1e-5)
    assert ("uncertainty" in grid) == (rule == "weighted")


def test_cells_with_too_few_soundings_are_empty(line):
    one, three = gridded(line, CELL), gridded(line, CELL, least=3)
    assert np.array_equal(np.isfinite(three["depth"]), one["count"] >= 3)
    assert np.array_equal(one["count"], three["count"])


def test_lines_on_one_grid_count_together_and_grids_fit(line):
    both, one = gridded([line, line], CELL), gridded(line, CELL)
    assert np.array_equal(both["count"], 2 * one["count"])
    np.testing.assert_allclose(both["depth"], one["depth"], atol=1e-5)
    part = gridded(line, CELL, bounds=(*(np.array(ORIGIN) + [-20, 2]), *(np.array(ORIGIN) + [15, 9])))
    np.testing.assert_array_equal(part["depth"].dropna("x", how="all"), one["depth"].sel(x=part.x, y=part.y).dropna(
        "x", how="all"))


def plane(x, y):
    return 50 + 0.02 * x


def test_grid_of_a_plane_bed_is_the_bed(line):
    off = residual(gridded(line, 1.0), plane)
    # What is left is the soundings' own noise of 10 mm, and the slope over half a cell: 10 mm.
    assert 0.001 < float(off.std()) < 0.02 and abs(float(off.mean())) < 0.005
    assert off.dims == ("y", "x") and np.isnan(off.values).any()


def test_grid_is_written_as_a_geotiff(line, tmp_path):
    rasterio = pytest.importorskip("rasterio")
    grid = gridded(line, CELL)
    geotiff.write(grid[["depth"]], tmp_path / "grid.tif")
    with rasterio.open(tmp_path / "grid.tif") as raster:
        assert raster.crs.to_epsg() == 32632 and raster.transform.a == CELL
        np.testing.assert_array_equal(raster.read(1), grid["depth"].values)
    geotiff.write(grid[["count"]], tmp_path / "count.tif")


@pytest.mark.parametrize("change, message", [
    (dict(cell=0.0), "cell is 0.0 m"), (dict(cell=1e-4), "more than 16,777,216 of them; take cells of"),
    (dict(rule="median"), "one of mean"), (dict(least=0), "1 or more"), (dict(bounds=(1, 1, 0, 2)), "in order")])
def test_grids_that_make_no_sense_are_refused(line, change, message):
    with pytest.raises(ValueError, match=message):
        gridded(line, **{"cell": CELL, **change})


def test_soundings_that_cannot_be_gridded_are_refused(line):
    with pytest.raises(ValueError, match="needs valid soundings"):
        gridded(line.assign(valid=line["valid"] & False), CELL)
    with pytest.raises(ValueError, match="without uncertainty"):
        gridded(line.drop_vars("uncertainty"), CELL, rule="weighted")
    with pytest.raises(ValueError, match="one system"):
        gridded([line, line.assign_attrs(crs=None)], CELL)
    with pytest.raises(ValueError, match="no line"):
        gridded([], CELL)
