"""Plots without a file: in axes of one's own, or as figures that pyplot, and so a notebook, shows."""
import subprocess
import sys

import numpy as np
import pytest
import xarray as xr
from focused_image import focused_image
from matplotlib import pyplot
from matplotlib.figure import Figure
from soundings_line import soundings_line
from synthetic_fan import fan
from synthetic_sidescan import sidescan

from mitsonar import plots


@pytest.fixture(autouse=True)
def no_figures():
    yield
    pyplot.close("all")


def small():
    return sidescan(6, 20)


def fan_image():
    return fan(beams=32, bins=60)


RECORDS = {small: ("waterfall", "ping", "mean", "labels", "depth", "shadow", "rays"),
           fan_image: ("waterfall", "labels", "objects"), focused_image: plots.FOCUSED_VIEWS,
           soundings_line: ("overview", "swath", "smile")}
EVERY = [pytest.param(make, what, id=f"{make.__name__}-{what}") for make, known in RECORDS.items() for what in known]


@pytest.mark.parametrize("make, what", EVERY)
def test_without_a_path_a_plot_is_one_figure_of_pyplot(make, what):
    axes = plots.plot(make(), what)
    assert pyplot.get_fignums() == [axes.figure.number] and axes.figure.axes[0] is axes


def test_the_usual_plot_is_drawn_where_none_is_named():
    assert plots.plot(small()).get_xlabel() == plots.preview(small()).get_xlabel() != ""


def test_a_figure_that_fails_is_closed():
    with pytest.raises(ValueError, match="there is no ping 99"):
        plots.plot(small(), "ping", ping=99)
    assert pyplot.get_fignums() == []


@pytest.mark.parametrize("record, axes, said", [
    ("image.exr", None, "xarray.Dataset such as mitsonar.read returns; got 'image.exr'"),
    (small(), Figure(), "axes must be matplotlib Axes, .* got <Figure"), (small(), "here", "got 'here'")])
def test_what_is_no_record_and_what_are_no_axes_is_said(record, axes, said):
    with pytest.raises(TypeError, match=said):
        plots.plot(record, axes=axes)


@pytest.mark.parametrize("make, what, square", [
    (small, "waterfall", False), (small, "labels", False), (small, "depth", False), (small, "mean", False),
    (fan_image, "waterfall", True), (fan_image, "labels", True), (focused_image, "image", True)])
def test_a_plot_in_axes_shows_what_its_sheet_shows(make, what, square):
    own = plots.plot(make(), what)
    figure = Figure(figsize=(9, 4))
    left, right = figure.subplots(1, 2)
    axes = plots.plot(make(), what, axes=right)
    assert axes is right and axes.figure is figure and not left.images
    assert len(axes.images) == len(own.images) and len(axes.lines) == len(own.lines)
    for mine, theirs in zip(axes.images, own.images):
        np.testing.assert_array_equal(mine.get_array(), theirs.get_array())
        assert mine.get_extent() == theirs.get_extent() and mine.get_transform().contains_branch(axes.transData)
    assert (axes.get_xlim(), axes.get_ylim()) == (own.get_xlim(), own.get_ylim())
    assert axes.get_xlabel() == own.get_xlabel() and axes.get_title()
    figure.canvas.draw()
    assert (axes.get_aspect() == 1) == square              # metres along both axes
    assert len(figure.axes) - 2 == len(own.figure.axes) - 1      # a bar, where its sheet has one


def test_plots_of_several_panels_do_not_fit_into_axes():
    with pytest.raises(ValueError, match="2 panels, which do not fit into the given axes; leave axes out"):
        plots.plot(small(), "ping", axes=Figure().add_subplot())


def test_fans_and_patterns_of_beams_return_axes(tmp_path):
    azimuth = np.radians(np.linspace(-50, 50, 41))
    beams = xr.DataArray(np.ones((1, 41, 60), np.complex64), dims=("ping", "beam", "sample"),
                         attrs={"sound_speed": 1500.0},
                         coords={"time": ("sample", 0.01 + np.arange(60) / 3e3), "azimuth": ("beam", azimuth)})
    axes = Figure().add_subplot()
    assert plots.fan(beams, axes=axes) is axes and axes.images
    assert plots.beam_pattern(beams, tmp_path / "pattern.png").lines and (tmp_path / "pattern.png").exists()
    assert pyplot.get_fignums() == []                      # what goes into a file or into axes is none of pyplot's


def test_importing_plots_leaves_pyplot_alone():
    code = "import mitsonar.plots, sys; print('matplotlib.pyplot' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "False\n"
