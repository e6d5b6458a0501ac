"""The image of a strip: raw echoes focused ping by ping, and the truth of every point."""
from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import drjit as dr
import xarray as xr

from ...scene import objects
from ...scene.labels import classes_of
from ...synthetic_aperture.focusing import Focuser
from ...synthetic_aperture.grids import Grid, default_grid
from ..cost import sentence
from ..pressure import PressureRecord
from .raw import common, raw_pings
from .survey import StripSurvey
from .truth import strip_truth

__all__ = ["focused", "strip_image", "survey_grid", "with_truth"]

Progress = Callable[[float, float], None]


def strip_image(survey: StripSurvey, seed: int, progress: Progress | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
    """Make the image that a strip's sensor asks for, with its truth; memory does not grow with the pings.

    Parameters
    ----------
    survey : StripSurvey
        It must lead by a pulse.
    seed : int
    progress, say
        As of `mitsonar.render`.

    Returns
    -------
    xarray.Dataset
        As `synthetic_aperture.record` says of focused images.
    """
    if say is not None:
        words = sentence(PressureRecord(survey, seed=seed), range(survey.track.pings), threads=dr.thread_count())
        if words:
            say(words)
    image = focused(raw_pings(survey, seed), survey.track.pings, progress, grid=survey_grid(survey),
                    window=survey.aperture_window, range_window=survey.range_window)
    return with_truth(image.assign_attrs(seed=seed), survey, seed)


def survey_grid(survey: StripSurvey) -> Grid:
    """Give the grid that a strip's sensor asks for; `ValueError` where there is but one ping."""
    if survey.track.pings < 2:
        raise ValueError("an aperture is made of two or more pings, and the strip has one; give pings more, or take "
                         "its raw echoes")
    return default_grid(common(survey).assign(ping_time=("ping", survey.track.time)), spacing=survey.grid_spacing,
                        kind=survey.grid)


def focused(pings: Iterable[xr.Dataset], count: int, progress: Progress | None = None, **how: Any) -> xr.Dataset:
    """Focus pings one after the other; `how` is passed on to `synthetic_aperture.focusing.Focuser`."""
    focuser: Focuser | None = None
    for done, one in enumerate(pings, 1):
        if focuser is None:
            focuser = Focuser(one, **how)
        focuser.add(one)
        if progress is not None:
            progress(done, count)
    if focuser is None:
        raise ValueError("there are no pings to be focused; give two or more")
    return focuser.image()


def with_truth(image: xr.Dataset, survey: StripSurvey, seed: int) -> xr.Dataset:
    """Put the truth of every point beside a focused image of a survey."""
    truth = strip_truth(survey, image["x"].values, image["y"].values, image["depth"].values, seed)
    whole = image.assign(truth.data_vars).assign_coords(truth.coords)
    whole = whole.assign_attrs(labels={str(number): name for number, name in survey.labels.items()})
    classes, class_of = classes_of(survey.labels)
    if "share" in truth:
        return objects.annotated(whole, classes, class_of, survey.geometry, survey.track.position)
    return whole.assign_attrs(objects.known(classes, class_of, survey.geometry, survey.track.position))
