"""The meshes and the survey shipped with the scenes are what their script makes, and are fit to be targets."""
import runpy
from pathlib import Path

import numpy as np
import pytest

from mitsonar.io import bathymetry

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SCRIPT = runpy.run_path(str(SCENES / "make_targets.py"))
MESHES = sorted(SCRIPT["TARGETS"])


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    SCRIPT["main"](folder)
    return folder


@pytest.mark.parametrize("name", MESHES)
def test_shipped_meshes_are_what_the_script_makes(made, name):
    file = f"meshes/{name}.ply"
    assert (made / file).read_bytes() == (SCENES / file).read_bytes()
    assert (SCENES / file).stat().st_size < 300_000


def test_shipped_survey_is_what_the_script_makes(made):
    # Grids, not bytes: another GDAL may pack them differently.
    file = "bathymetry/sandwaves.tif"
    shipped, fresh = (bathymetry.read(folder / file) for folder in (SCENES, made))
    assert np.array_equal(shipped.heights, fresh.heights, equal_nan=True)
    assert shipped.heights.shape == (240, 200) and shipped.spacing == (2.0, 2.0) and shipped.crs == "EPSG:32631"
    assert (SCENES / file).stat().st_size < 300_000
    assert 0.9 < shipped.valid.mean() < 1 and -40 < np.nanmin(shipped.heights) and np.nanmax(shipped.heights) < -20


@pytest.mark.parametrize("name", MESHES)
def test_targets_are_closed_and_look_outwards(name):
    vertices, faces = SCRIPT["TARGETS"][name]()
    edges = np.concatenate((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
    directed = set(map(tuple, edges))
    assert len(directed) == len(edges)                                      # no edge runs the same way twice
    assert all((end, start) in directed for start, end in directed)         # and each runs back once
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


@pytest.mark.parametrize("name, size, height", [
    ("truncated_cone", (1.0, 1.0), 0.43), ("tyre", (1.0, 1.0), 0.19), ("boulder", (1.8, 1.5), 0.78),
    ("wreck", (16.0, 33.0), 8.5),
])
def test_targets_have_their_size_and_are_partly_buried(name, size, height):
    vertices, faces = SCRIPT["TARGETS"][name]()
    assert np.all(np.ptp(vertices[:, :2], axis=0) <= np.array(size) * 1.1)
    assert vertices[:, 2].max() == pytest.approx(height, rel=0.1) and -2.5 < vertices[:, 2].min() < 0
    assert len(faces) < 10_000
