"""The picture of a fit: maps and numbers, with the truth beside them where it is known."""
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from mitsonar.inversion.fitting.answer import FittedParameter, named
from mitsonar.plots.sheets.fit_sheet import fit_figure


def answer():
    """Heights over five places east and four north, and a pose of six numbers."""
    values, numbers = np.outer(np.arange(5.0), np.ones(4)), np.arange(6.0)
    height = FittedParameter.still(0 * values, "m")
    height = replace(height, value=values, uncertainty=0 * values + 0.1, prior_deviation=0 * values + 1,
                     resolved=0 * values + 0.9)
    pose = replace(FittedParameter.still(0 * numbers, "m, rad"), value=numbers, uncertainty=numbers)
    variables = {**named("height", ("x", "y"), height), **named("pose", ("number",), pose)}
    return xr.Dataset(variables, {"x": np.arange(5.0), "y": np.arange(4.0)},
                      {"kind": "fit", "parameters": ["height", "pose"], "stopped": "it is done"})


def titles(figure):
    return [axes.get_title() for axes in figure.axes if axes.get_title() and not axes.get_title().startswith("[")]


def test_start_answer_deviation_and_share_are_drawn_east_to_the_right():
    figure = fit_figure(answer())
    assert titles(figure) == ["height: start", "answer", "one deviation", "share determined"]
    drawn = figure.axes[1].collections[0].get_array()
    assert drawn.shape == (4, 5) and np.all(np.diff(np.asarray(drawn), axis=1) == 1)


def test_a_truth_is_drawn_and_how_far_off_the_answer_is():
    found = answer()
    found["height_truth"] = found["height"] + 0.5
    figure = fit_figure(found)
    assert titles(figure) == ["height: truth", "start", "answer", "answer - truth", "one deviation", "share determined"]
    error = figure.axes[3].collections[0]
    assert np.all(np.asarray(error.get_array()) == -0.5) and error.get_clim() == (-0.5, 0.5)


def test_what_is_no_fit_is_refused():
    with pytest.raises(ValueError, match="no answer of a fit"):
        fit_figure(answer().drop_vars("height_deviation"))
    with pytest.raises(ValueError, match="no answer of a fit"):
        fit_figure(xr.Dataset())
