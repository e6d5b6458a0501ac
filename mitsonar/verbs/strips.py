"""The verbs of a synthetic aperture: raw echoes of a scene's strip, and the image that is focused of them."""
from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterator
from typing import Any, cast

import mitsuba as mi
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.io import casts
from mitsonar.io.records import raw_echoes as raw_files
from mitsonar.io.records.records import SonarImage, not_all_nan
from mitsonar.scene.errors import as_exception
from mitsonar.survey.kinds import KINDS, kind_of
from mitsonar.survey.pressure.signals import LEAD
from mitsonar.survey.synthetic_aperture.image import focused, raw_pings as pings_of, survey_grid, with_truth
from mitsonar.survey.synthetic_aperture.plan import StripSurvey
from mitsonar.survey.synthetic_aperture.scatterers import scatterers_of
from mitsonar.synthetic_aperture.focusing.grids import Grid, default_grid
from mitsonar.synthetic_aperture.record import check_raw
from mitsonar.water.profile import SoundSpeedProfile

from .images import checked_seed, opened, provenance

RAW_FILES = (".nc", ".h5", ".hdf5")


def raw_echoes(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
               progress: Callable[[int, int], None] | None = None, **parameters: object) -> SonarImage:
    """Make the raw echoes of a scene's synthetic aperture, whole.

    Parameters
    ----------
    scene, seed, sensor, progress, parameters
        As of `mitsonar.render`.

    Returns
    -------
    SonarImage
        An `xarray.Dataset` with ``signal`` (ping, rx, sample), complex64 [µPa], the true trajectory ``motion_x`` and
        the like, the places of the elements, the cast and the point targets; see
        `mitsonar.synthetic_aperture.record`. `raw_pings` gives them ping by ping, and ``mitsonar signals`` writes them
        so.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, or if the sensor is no synthetic aperture.
    """
    total: list[int] = []
    made = []
    scene = opened(scene, sensor, parameters)[0]
    for done, one in enumerate(raw_pings(scene, seed, sensor=sensor, count=total.append), 1):
        made.append(one)
        if progress is not None:
            progress(done, total[0])
    whole = xr.concat(made, "ping", data_vars="minimal", coords="minimal", compat="override", combine_attrs="override")
    return SonarImage.of(cast(xr.Dataset, whole))


def focus(scene_or_signals: mi.Scene | xr.Dataset | FilePath, grid: Grid | None = None,
          profile: SoundSpeedProfile | float | FilePath | None = None, *, seed: int = 0, sensor: int | str = 0,
          window: str | tuple | None = None, range_window: str | tuple | None = None,
          trajectory: xr.Dataset | None = None, progress: Callable[[float, float], None] | None = None,
          **parameters: object) -> SonarImage:
    """Focus the raw echoes of a synthetic aperture: of a scene, of a file, or in memory.

    Parameters
    ----------
    scene_or_signals : mitsuba.Scene, xarray.Dataset, or str or path
        What `mitsonar.render` takes, what `raw_echoes` gives, or a netCDF file of raw echoes.
    grid : Grid or None
        Of `mitsonar.synthetic_aperture.focusing.grids`; None: a strip of the ground, or a square within a circle.
    profile : SoundSpeedProfile, float [m/s], str or path, or None
        Water that delays are made with, or the file of a cast; a number: one sound speed. None: the water's own.
    seed, sensor, parameters
        Of a scene, as of `mitsonar.render`.
    window, range_window : str, tuple or None
        Over the aperture's angles and over the pulse's band, such as "taylor 4 30", "hann" or "none"; None: those of
        the scene's sensor, "taylor 4 30" of signals.
    trajectory : xarray.Dataset or None
        Another than the true one, such as a navigated or a micronavigated one: ``motion_time``, ``motion_x`` ...
    progress : callable(done, total) or None
        Called after every ping.

    Returns
    -------
    SonarImage
        An `xarray.Dataset` over (bank, along_track, across_track): ``image``, complex, whose squared magnitude is the
        target strength of a point on the elements' plane of look, less off it by their two-way beam, and ``level``
        [dB re 1 m²]; of a scene with the truth of every point, see
        `mitsonar.synthetic_aperture.record`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `mitsonar.render`, or if there are no raw echoes, fewer than two pings, or grid, windows, profile or
        trajectory do not fit them.
    """
    if grid is not None and not isinstance(grid, Grid):
        raise TypeError("a grid of mitsonar.synthetic_aperture.grids, or None, was wanted, got a "
                        f"{type(grid).__name__}")
    if profile is not None and not isinstance(profile, (SoundSpeedProfile, int, float)):
        profile = casts.read(profile).profile
    how = {"profile": profile, "trajectory": trajectory}
    if isinstance(scene_or_signals, xr.Dataset):
        _refuse(parameters)
        return _of_record(scene_or_signals, grid, progress, **how, **_windows(window, range_window))
    # Mitsuba has no Scene before a variant is set, and files need none
    if isinstance(scene_or_signals, (str, os.PathLike)) and str(scene_or_signals).lower().endswith(RAW_FILES):
        _refuse(parameters)
        with raw_files.opened(scene_or_signals) as record:
            return _of_record(record, grid, progress, **how, **_windows(window, range_window))
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene_or_signals, sensor, parameters)
    survey, about = _planned(scene, sonar, integrator)
    if grid is None:
        grid = survey_grid(survey)
    own = _windows(survey.aperture_window if window is None else window,
                   survey.range_window if range_window is None else range_window)
    image = focused(pings_of(survey, sonar.own_seed(seed)), survey.track.pings, progress, grid=grid, **how, **own)
    image = with_truth(image.assign_attrs(seed=seed), survey, seed)
    return SonarImage.of(image.assign_attrs({**about, **image.attrs}))


def _refuse(parameters: dict[str, object]) -> None:
    """Refuse parameters that are given with raw echoes."""
    if parameters:
        raise TypeError(f"{', '.join(parameters)}: no argument has this name, and raw echoes have no parameters; give "
                        "parameters with a scene")


def _of_record(record: xr.Dataset, grid: Grid | None, progress: Callable[[float, float], None] | None,
               **how: Any) -> SonarImage:
    """Focus raw echoes ping by ping."""
    check_raw(record)
    count = record.sizes["ping"]
    if count < 2:
        raise ValueError(f"an aperture is made of two or more pings, got {count}")
    if grid is None:
        grid = default_grid(record.drop_vars("signal"))
    return SonarImage.of(focused(raw_files.pings(record), count, progress, grid=grid, **how))


def _windows(window: str | tuple | None, range_window: str | tuple | None) -> dict[str, str | tuple]:
    """The windows that are asked for, by the names of their arguments."""
    return {name: value for name, value in (("window", window), ("range_window", range_window)) if value is not None}


def raw_pings(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0, start: int = 0,
              count: Callable[[int], object] | None = None) -> Iterator[SonarImage]:
    """Make raw echoes ping by ping: what is kept does not grow with their number."""
    seed, start = checked_seed(seed), operator.index(start)
    scene, sonar, integrator = opened(scene, sensor)
    survey, about = _planned(scene, sonar, integrator)
    if not 0 <= start <= survey.track.pings:
        raise ValueError(f"start is ping {start}, and the strip has {survey.track.pings}, counted from 0")
    if count is not None:
        count(survey.track.pings)
    return (SonarImage.of(not_all_nan(one).assign_attrs({**about, **one.attrs, "seed": seed}))
            for one in pings_of(survey, sonar.own_seed(seed), start))


def scatterers(scene: mi.Scene | FilePath, *, sensor: int | str = 0) -> SonarImage:
    """Return the scatterers that the raw echoes of a scene's seabeds and objects are made of: the truth of its speckle.
    """
    scene, sonar, integrator = opened(scene, sensor)
    survey, about = _planned(scene, sonar, integrator)
    return SonarImage.of(scatterers_of(survey).assign_attrs(about))


def strip_survey(scene: mi.Scene | FilePath, *, sensor: int | str = 0) -> StripSurvey:
    """Plan the strip of a scene's synthetic aperture; arguments and errors as of `raw_echoes`."""
    return _planned(*opened(scene, sensor))[0]


def _planned(scene: mi.Scene, sonar: Any, integrator: Any) -> tuple[Any, dict[str, Any]]:
    """The survey of a synthetic aperture, and where its results come from."""
    if kind_of(sonar) is not KINDS["synthetic_aperture"]:
        raise ValueError(f"raw echoes are those of a synthetic aperture, and this sensor is a {sonar.kind}; give the "
                         "scene a <sensor type=\"synthetic_aperture\"/>, or take mitsonar.element_signals")
    try:
        survey = integrator.array_survey(scene, sonar, LEAD)
    except RuntimeError as error:
        raise as_exception(error) from error
    return survey, provenance(scene, sonar, survey)
