"""Holes filled and relief added, through the reader.

Harmonic surfaces: x y and x^2 - y^2 solve the equation of five nodes exactly, so holes in them come back to the
solver's tolerance, a thousandth of their relief.
"""
import numpy as np
import pytest
import rasterio
from rasterio.transform import from_origin

from mitsonar.io.grids import bathymetry
from mitsonar.io.grids.bathymetry import SurveyRelief, fill_holes
from mitsonar.scattering import Fractal, RoughnessSpectrum

X, Y = np.meshgrid(np.linspace(-1, 1, 81), np.linspace(-1, 1, 61))
STEPS = X[0, 1] - X[0, 0], Y[1, 0] - Y[0, 0]
HOLE = (np.abs(X) < 0.4) & (np.abs(Y + 0.2 * X) < 0.3)


@pytest.mark.parametrize("surface", [X * Y, X**2 - Y**2, 3 + X], ids=["saddle", "turned saddle", "plane"])
def test_harmonic_surfaces_come_back(surface):
    filled = fill_holes(np.where(HOLE, np.nan, surface - 40).astype(np.float32), STEPS)
    assert np.abs(filled - surface + 40).max() < 2e-3


def test_filling_is_smooth_and_overshoots_nowhere():
    heights = np.where(HOLE, np.nan, np.random.default_rng(0).normal(-40, 1, X.shape)).astype(np.float32)
    filled = fill_holes(heights, STEPS)
    from scipy.ndimage import binary_dilation
    rim = heights[binary_dilation(HOLE) & ~HOLE]
    assert rim.min() <= filled[HOLE].min() and filled[HOLE].max() <= rim.max()
    assert np.array_equal(filled[~HOLE], heights[~HOLE])
    assert np.isnan(heights[HOLE]).all()                                    # not in place
    inside = (np.abs(X) < 0.2) & (np.abs(Y) < 0.1)
    assert filled[inside].std() < 0.3 * rim.std()                           # noise of the rim dies out inwards


def test_wide_holes_of_any_outline_are_solved():
    # Wide enough for the first guess by coarser grids; a strip outside, one node away from the hole, at an odd edge.
    y, x = np.mgrid[:151, :203] / 100
    surface = np.exp(2 * x) * np.sin(2 * y)
    hole = (y > 0.015) & (y < 1.3) & (x > 0.3 + 0.2 * np.sin(9 * y)) & (x < 1.7)
    heights = np.where(hole | (y < 0.005), np.nan, surface - 40).astype(np.float32)
    filled = fill_holes(heights, (0.01, 0.01))
    assert np.abs(filled - surface + 40)[hole].max() < 2e-3 * np.ptp(surface) and np.isnan(filled[0]).all()


def test_what_the_survey_does_not_surround_stays_open():
    heights = np.where((X > 0.5) | HOLE, np.nan, -40.0).astype(np.float32)
    filled = fill_holes(heights, STEPS)
    assert np.isnan(filled[X > 0.5]).all() and (filled[HOLE & (X < 0.5)] == -40).all()
    assert fill_holes(filled, STEPS) is filled


def test_wide_holes_stay_open():
    heights = np.where(HOLE | (np.hypot(X + 0.8, Y + 0.8) < 0.1), np.nan, -40.0).astype(np.float32)
    assert np.array_equal(np.isnan(fill_holes(heights, STEPS, 0.3)), HOLE)
    assert not np.isnan(fill_holes(heights, STEPS, 0.8)).any()              # HOLE is a band 0.6 wide


def test_too_large_holes_are_refused(monkeypatch):
    monkeypatch.setattr("mitsonar.io.grids.bathymetry._MOST_NODES", 100)
    with pytest.raises(ValueError, match="fill smaller ones by holes_max"):
        fill_holes(np.where(HOLE, np.nan, -40.0).astype(np.float32), STEPS)


LAW = RoughnessSpectrum(w2=1e-4, gamma=3.25, outer_scale=100.0)


@pytest.fixture
def path(tmp_path):
    """A fractal bed of 2 m, 200 x 240 nodes, with a hole of 10 x 15."""
    bed = Fractal(spectrum=LAW, seed=4).on_grid(np.arange(240) * 2.0, np.arange(200) * 2.0) - 40
    bed[60:70, 120:135] = -9999
    with rasterio.open(tmp_path / "bed.tif", "w", driver="GTiff", height=200, width=240, count=1, dtype="float32",
                       nodata=-9999, crs="EPSG:32632", transform=from_origin(500000, 5000400, 2, 2)) as raster:
        raster.write(bed.astype(np.float32), 1)
    return tmp_path / "bed.tif"


def test_holes_through_the_reader(path):
    assert (~bathymetry.read(path).valid).sum() == 150
    assert bathymetry.read(path, holes="filled").valid.all()
    assert (~bathymetry.read(path, holes="filled", holes_max=10.0).valid).sum() == 150
    finer = bathymetry.read(path, holes="filled", resolution=0.5, relief=SurveyRelief(), size=(100, 100),
                            centre=(500255, 5000270))
    assert finer.valid.all() and finer.spacing == (0.5, 0.5)


def test_relief_continues_the_file_s_spectrum(path):
    crop = {"crop": (500040, 5000040, 500120, 5000120)}
    grid = bathymetry.read(path, resolution=0.5, relief=SurveyRelief(seed=1), **crop)
    plain = bathymetry.read(path, resolution=0.5, **crop)
    assert np.array_equal(grid.x, plain.x) and np.array_equal(grid.y, plain.y)     # the same nodes as without
    assert grid.roughness.gamma == pytest.approx(3.25, abs=0.2) and plain.roughness is None
    highest = np.pi / 2
    assert abs(10 * np.log10(grid.roughness.at(highest) / LAW.at(highest))) < 1.5
    # A part of the part shows the same relief, to the tail of its correlation.
    part = bathymetry.read(path, resolution=0.5, relief=SurveyRelief(seed=1), crop=(500060, 5000070, 500090, 5000100),
                           local_origin=grid.local_origin)
    there = np.ix_(np.isin(np.round(grid.y, 3), np.round(part.y, 3)), np.isin(np.round(grid.x, 3), np.round(part.x, 3)))
    added = grid.heights - plain.heights
    assert np.abs(grid.heights[there] - part.heights).max() < 5e-3 * added.std()
    other = bathymetry.read(path, resolution=0.5, relief=SurveyRelief(seed=2), **crop)
    assert np.std(other.heights - grid.heights) > 0.5 * added.std()


def test_relief_of_a_survey_in_degrees(tmp_path):
    # Warped to metres by cubics; linear interpolation would take 2 dB of its shortest waves, and give 3.8.
    metres = 111200.0
    bed = Fractal(spectrum=LAW, seed=4).on_grid(np.arange(400) * 2.0, np.arange(400) * 2.0) - 40
    with rasterio.open(tmp_path / "bed.tif", "w", driver="GTiff", height=400, width=400, count=1, dtype="float32",
                       crs="EPSG:4326", transform=from_origin(3, 0.5, 2 / metres, 2 / metres)) as raster:
        raster.write(bed.astype(np.float32), 1)
    grid = bathymetry.read(tmp_path / "bed.tif", relief=SurveyRelief(), resolution=0.5, size=(50, 50))
    assert grid.crs == "EPSG:32631" and grid.roughness.gamma == pytest.approx(3.25, abs=0.3)


def test_relief_of_a_spectrum_that_is_given(path):
    part = {"size": (60, 60), "centre": (500100, 5000100), "resolution": 0.5}
    smooth = bathymetry.read(path, relief=SurveyRelief(w2=0.0, gamma=3.0), **part)
    rough = bathymetry.read(path, relief=SurveyRelief(w2=1e-3, gamma=3.0), **part)
    faint = bathymetry.read(path, relief=SurveyRelief(w2=1e-5, gamma=3.0), **part)
    assert rough.roughness.gamma == 3.0 and rough.roughness.w2 == 1e-3
    ratio = np.std(rough.heights - smooth.heights) / np.std(faint.heights - smooth.heights)
    assert ratio == pytest.approx(10, rel=1e-3)
    assert bathymetry.read(path, relief=SurveyRelief(gamma=3.0), **part).roughness.gamma == 3.0


def test_holes_stay_holes_under_relief(path):
    grid = bathymetry.read(path, resolution=0.5, relief=SurveyRelief(), size=(100, 100), centre=(500255, 5000270))
    area = (~grid.valid).sum() * 0.25
    assert 9 * 14 * 4 < area < 12 * 17 * 4


@pytest.mark.parametrize("options, said", [
    ({"relief": SurveyRelief()}, "relief needs a resolution finer than the survey's 2 m; none is given"),
    ({"relief": SurveyRelief(), "resolution": 2.0}, "finer than the survey's 2 m; it is 2 m"),
    ({"relief": SurveyRelief(), "resolution": 0.001}, "nodes are more than 2e"),
    ({"holes_max": 9.0}, 'holes_max is 9 m, but holes are cut; write holes "filled" too'),
    ({"holes": "bridged"}, 'holes is "bridged"; it must be "cut" or "filled"'),
    ({"relief": SurveyRelief(), "resolution": 0.5, "crop": (500245, 5000265, 500250, 5000270)}, "only holes|no depth"),
])
def test_refusals(path, options, said):
    with pytest.raises(ValueError, match=said):
        bathymetry.read(path, **options)


def test_relief_s_numbers_are_checked():
    with pytest.raises(ValueError, match="relief_w2 is given without relief_gamma"):
        SurveyRelief(w2=1e-4)
    with pytest.raises(ValueError, match="gamma is 5.0; it must be between 2 and 4"):
        SurveyRelief(gamma=5.0)


def test_a_survey_without_a_whole_patch_has_no_spectrum(tmp_path):
    heights = np.full((40, 40), -30.0)
    heights[::10, ::10] = np.nan
    np.save(tmp_path / "bed.npy", heights)
    with pytest.raises(ValueError, match="no 32 x 32 nodes of it are without holes; give relief_w2 and relief_gamma"):
        bathymetry.read(tmp_path / "bed.npy", spacing=2.0, resolution=1.0, relief=SurveyRelief())
