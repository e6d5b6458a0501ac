"""Fits of a scene's parameters to an image that it rendered, and of a record of a fake model by the command's words."""
import numpy as np
import pytest
import xarray as xr
from closed_models import Matrix
from gradient_scenes import sidescan

import mitsonar
from mitsonar.inversion.images.scene_fit import KeyPrior, fit_scene
from mitsonar.inversion.problems import solve


def _quiet(done, total):
    pass


@pytest.fixture(scope="module")
def scenes(tmp_path_factory):
    """A wavy bed with its image, and a scene that believes it flat and twice as strong."""
    folder = tmp_path_factory.mktemp("fit")
    sonar = '<boolean name="speckle" value="false"/> '
    truth, start = folder / "truth.xml", folder / "start.xml"
    truth.write_text(sidescan(rays=5000, pings=4, sonar=sonar))
    start.write_text(sidescan(rays=3000, pings=4, waves="", sonar=sonar).replace('"-25"', '"-22"'))
    image = mitsonar.render(mitsonar.load_file(truth), seed=3)
    mitsonar.write(image, folder / "image.nc")
    return folder, image


def test_heights_and_strength_come_from_an_image(scenes):
    # without speckle, other rays (looks 100 for what they differ by): strength within 0.5 dB, heights more than half
    folder, image = scenes
    options = {"looks": 100.0, "length": 3.0, "truth": str(folder / "truth.xml"), "iterations": 3, "directions": 8}
    found = solve(str(folder / "start.xml"),
                  [str(folder / "image.nc"), "bed.heights=0.3", "bed.bsdf.strength=0.005:0.0005:0.05"], options, _quiet)
    answer = found.dataset
    strength = float(answer["bed.bsdf.strength"].values.item())
    assert 10 * np.log10(strength / 10 ** -2.5) == pytest.approx(0, abs=0.5)
    told = answer["bed.heights_resolved"].values > 0.5
    off = [np.sqrt(np.mean((answer[name] - answer["bed.heights_truth"]).values[told] ** 2))
           for name in ("bed.heights", "bed.heights_start")]
    assert told.sum() > 20
    assert off[0] < 0.5 * off[1]
    assert any("off by" in one for one in found.sentences)
    assert answer["bed.heights_east"].shape == answer["bed.heights"].shape


@pytest.mark.parametrize("priors, options, words", [
    ([KeyPrior(key="bed.height", deviation=1.0)], {}, "did you mean \"bed.heights\""),
    ([KeyPrior(key="bed.heights", deviation=1.0), KeyPrior(key="bed.pose", deviation=1.0)], {}, "the same object"),
    ([KeyPrior(key="bed.heights", deviation=1.0)] * 2, {}, "given twice"),
    ([KeyPrior(key="bed.bsdf.strength", deviation=1.0)], {"length": 2.0}, "no parameter has a number a vertex"),
    ([KeyPrior(key="bed.heights", deviation=1.0)], {"looks": 0.0}, "give looks above zero"),
])
def test_what_cannot_be_fitted_is_told(scenes, priors, options, words):
    folder, image = scenes
    with pytest.raises(ValueError, match=words):
        fit_scene(folder / "start.xml", image, priors, **options)


def test_a_record_with_other_pings_is_told(scenes):
    folder, image = scenes
    with pytest.raises(ValueError, match="3 x 2 x 100 pings, rows and bins, and the scene's sonar makes 4 x 2 x 100"):
        fit_scene(folder / "start.xml", image.isel(ping=slice(3)), [KeyPrior(key="bed.heights", deviation=1.0)])


def test_every_option_of_a_problem_is_one_of_the_command():
    from mitsonar.cli.fitting import OPTIONS
    from mitsonar.inversion.problems import PROBLEMS, SCENE

    taken = {name for problem in (SCENE, *PROBLEMS.values()) for name in problem.takes}
    assert taken == {*OPTIONS, "parameters"}


def test_an_answer_can_be_drawn_and_written(scenes, tmp_path):
    from mitsonar.inversion import Gaussian, Prior, fit
    from mitsonar.plots.sheets.fit_sheet import fit_figure

    found = fit(Matrix(np.random.default_rng(0).standard_normal((40, 20)), (4, 5)), Gaussian(np.ones(40), 1.0),
                {"x": Prior(deviation=1.0)})
    figure = fit_figure(found.to_dataset())
    found.to_dataset().to_netcdf(tmp_path / "answer.nc")
    assert {axes.get_title() for axes in figure.axes} >= {"x: start", "answer", "one deviation", "share determined"}
    with pytest.raises(ValueError, match="no answer of a fit"):
        fit_figure(xr.Dataset())
