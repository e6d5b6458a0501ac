"""Pictures of fits in the plane."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.plots.fits import fit_figure


def answer():
    values = np.outer(np.arange(5.0), np.ones(4))
    return xr.Dataset({"start": (("x", "y"), 0 * values), "height": (("x", "y"), values, {"units": "m"}),
                       "deviation": (("x", "y"), 0 * values + 0.1)}, {"x": np.arange(5.0), "y": np.arange(4.0)})


def test_truth_start_answer_error_and_deviation_are_drawn_north_up():
    figure = fit_figure(answer(), answer()["height"].values + 0.5)
    titles = [axis.get_title() for axis in figure.axes if axis.get_title()]
    assert titles == ["truth [m]", "start [m]", "answer [m]", "error [m]", "deviation [m]"]
    picture = figure.axes[2].images[0]
    assert picture.get_array().shape == (4, 5) and picture.origin == "lower"
    assert np.ptp(np.asarray(figure.axes[3].images[0].get_array())) == 0


def test_without_a_truth_the_change_is_drawn():
    titles = [axis.get_title() for axis in fit_figure(answer()).axes if axis.get_title()]
    assert titles == ["start [m]", "answer [m]", "change [m]", "deviation [m]"]


def test_other_datasets_and_shapes_are_refused():
    with pytest.raises(ValueError, match="needs start, deviation and height or strength_db"):
        fit_figure(answer().drop_vars("height"))
    with pytest.raises(ValueError, match="the truth has the shape"):
        fit_figure(answer(), np.zeros((2, 2)))
