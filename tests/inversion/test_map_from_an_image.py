"""A map of strengths from one image of a flat bed: half mud, half sand, 7 dB apart.

A start between the two is 3.5 dB off everywhere. With four looks, 100 sums of bins in a cell's reach and a smooth
prior, the border's ring of one cell carries most of what is left; 1.5 dB is asked for, and 90 % of the labels.
"""
import mitsonar  # noqa: F401  isort: skip
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.inversion.images.image_fit import Stage
from mitsonar.inversion.images.sediment_map import fit_sediment_map
from scenes import SCENE, looked, model

pytestmark = pytest.mark.usefixtures("two_threads")
KEY = "bed.bsdf.mu_db.data"
CLASSES = {"mud": -27.0, "sand": -20.0}
PAINTED = """<bsdf type="lambert" id="sand"><texture type="bitmap" name="mu_db"><boolean name="raw" value="true"/>
    <string name="filter_type" value="bilinear"/> <string name="filename" value="{}"/></texture></bsdf>"""


def painted(folder, name, strengths, **parameters):
    mi.set_variant("llvm_ad_mono")
    mi.Bitmap(strengths[:, :, None].astype(np.float32)).write(str(folder / f"{name}.exr"))
    path = folder / f"{name}.xml"
    plain = '<bsdf type="lambert" id="sand"><float name="mu_db" value="$mu_db"/></bsdf>'
    unused = '<default name="mu_db" value="-20"/>'
    path.write_text(SCENE.replace(plain, PAINTED.format(f"{name}.exr")).replace(unused, ""))
    return mitsonar.load_file(path, **parameters)


def test_a_map_is_found_and_its_sediments_named(tmp_path):
    truth = np.where(np.arange(12)[:, None] + np.zeros(8) < 6, -20.0, -27.0)
    data = painted(tmp_path, "truth", truth, rays=8000, speckle="true")
    started = model(painted(tmp_path, "start", np.full((12, 8), -23.5), rays=800), KEY)
    fit = fit_sediment_map(started, looked(data, 4), KEY, looks=4, classes=CLASSES, farthest=22, modes=2,
                           stages=[Stage(bins=6, steps=3, products=6)])
    inside = (slice(2, 10), slice(2, 6))
    assert np.abs(fit["strength_db"].values - truth)[inside].mean() < 1.5
    assert (fit["strength_db_class"].values == (truth > -23))[inside].mean() > 0.9
    assert fit["strength_db_probability"].sum("sediment").values == pytest.approx(1)
    assert np.all(fit["strength_db_deviation"] <= fit["strength_db_prior_deviation"] + 1e-12)


def test_what_is_no_map_in_decibels_is_refused(tmp_path):
    started = model(painted(tmp_path, "start", np.full((12, 8), -23.5), rays=50), "bed.vertex_positions", KEY)
    with pytest.raises(ValueError, match="give the key of a bitmap of one channel in decibels"):
        fit_sediment_map(started, None, "bed.vertex_positions")
    with pytest.raises(ValueError, match="has no parameter 'bed.map'; make it with that key"):
        fit_sediment_map(started, None, "bed.map")
    with pytest.raises(ValueError, match="1 class is too few; give at least two, or leave them out"):
        fit_sediment_map(started, None, KEY, classes={"mud": -27})
