"""The meshes and the survey shipped with the scenes are what their script makes, and are fit to be targets."""
import runpy
from pathlib import Path

import numpy as np
import pytest

from mitsonar.io.grids import bathymetry

SCENES = Path(__file__).resolve().parents[2] / "scenes"
SCRIPT = runpy.run_path(str(SCENES / "make_targets.py"))
MESHES = [*(f"meshes/{name}" for name in sorted(SCRIPT["TARGETS"])),
          *(f"targets/{name}" for name in sorted(SCRIPT["SPECIES"]))]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scenes")
    SCRIPT["main"](folder)
    return folder


def mesh(name):
    folder, _, name = name.partition("/")
    return SCRIPT[{"meshes": "TARGETS", "targets": "SPECIES"}[folder]][name]()


@pytest.mark.parametrize("name", MESHES)
def test_shipped_meshes_are_what_the_script_makes(made, name):
    file = f"{name}.ply"
    assert (made / file).read_bytes() == (SCENES / file).read_bytes()
    assert (SCENES / file).stat().st_size < (60_000 if name.startswith("targets/") else 300_000)


def test_shipped_survey_is_what_the_script_makes(made):
    # Grids, not bytes: another GDAL may pack them differently.
    file = "bathymetry/sandwaves.tif"
    shipped, fresh = (bathymetry.read(folder / file) for folder in (SCENES, made))
    assert np.array_equal(shipped.heights, fresh.heights, equal_nan=True)
    assert shipped.heights.shape == (240, 200) and shipped.spacing == (2.0, 2.0) and shipped.crs == "EPSG:32631"
    assert (SCENES / file).stat().st_size < 300_000
    assert 0.9 < shipped.valid.mean() < 1 and -40 < np.nanmin(shipped.heights) and np.nanmax(shipped.heights) < -20


def test_shipped_map_of_a_bed_is_what_the_script_makes(made):
    file = "textures/wreck_bed.pfm"
    shipped, fresh = (np.frombuffer((folder / file).read_bytes()[16:], "<f4") for folder in (SCENES, made))
    assert shipped.size == 150 * 150 and -34 <= shipped.min() and shipped.max() <= -14
    np.testing.assert_allclose(fresh, shipped, atol=0.011)                  # another SciPy may round otherwise


@pytest.mark.parametrize("name", MESHES)
def test_targets_are_closed_and_look_outwards(name):
    vertices, faces = mesh(name)
    edges = np.concatenate((faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]))
    directed = set(map(tuple, edges))
    assert len(directed) == len(edges)                                      # no edge runs the same way twice
    assert all((end, start) in directed for start, end in directed)         # and each runs back once
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    assert np.einsum("ij,ij->", a, np.cross(b, c)) > 0


@pytest.mark.parametrize("name, size, height", [
    ("truncated_cone", (1.0, 1.0), 0.43), ("tyre", (1.0, 1.0), 0.19), ("boulder", (1.8, 1.5), 0.78),
    ("wreck", (16.0, 33.0), 8.5), ("hulk", (17.0, 27.0), 3.9),
])
def test_targets_have_their_size_and_are_partly_buried(name, size, height):
    vertices, faces = SCRIPT["TARGETS"][name]()
    assert np.all(np.ptp(vertices[:, :2], axis=0) <= np.array(size) * 1.1)
    assert vertices[:, 2].max() == pytest.approx(height, rel=0.1) and -2.5 < vertices[:, 2].min() < 0
    assert len(faces) < 12_000


def test_the_diver_is_whole_and_as_large_as_one():
    vertices, faces = SCRIPT["TARGETS"]["diver"]()
    assert np.allclose(np.ptp(vertices, axis=0), (0.65, 2.55, 0.55), rtol=0.1) and len(faces) < 2000


@pytest.mark.parametrize("name, size", [
    ("anchor", (1.1, 2.0, 1.1)), ("boulder", (1.8, 1.5, 1.1)), ("clump", (1.0, 1.0, 0.87)),
    ("crate", (0.84, 1.2, 0.74)), ("cylinder", (0.53, 2.06, 0.58)), ("drum", (0.59, 0.88, 0.59)),
    ("lobster_pot", (0.54, 0.74, 0.42)), ("sphere", (1.0, 0.9, 1.1)), ("torpedo", (0.6, 5.8, 0.6)),
    ("truncated_cone", (1.0, 1.0, 0.45)), ("tyre", (1.0, 1.0, 0.28)), ("wedge", (0.8, 1.0, 0.4)),
])
def test_species_stand_on_the_ground_and_have_their_size(name, size):
    vertices, _ = SCRIPT["SPECIES"][name]()
    assert np.allclose(np.ptp(vertices, axis=0), size, rtol=0.05) and vertices[:, 2].min() == pytest.approx(0, abs=1e-9)
