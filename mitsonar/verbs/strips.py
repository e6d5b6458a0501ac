"""Raw echoes of a synthetic aperture sonar, and the images focused from them."""
from __future__ import annotations

import operator
import os
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from typing import Any, cast

import mitsuba as mi
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.device.turns import one_at_a_time
from mitsonar.io import casts
from mitsonar.io.records import raw_echoes as raw_files
from mitsonar.io.records.records import SonarImage, not_all_nan
from mitsonar.scene.errors import as_exception
from mitsonar.survey.integrator import SoundIntegrator
from mitsonar.survey.pressure.signals import LEAD
from mitsonar.survey.sensor import Sensor
from mitsonar.survey.synthetic_aperture.image import focused, raw_pings as pings_of, survey_grid, with_truth
from mitsonar.survey.synthetic_aperture.plan import StripSurvey
from mitsonar.survey.synthetic_aperture.scatterers import scatterers_of
from mitsonar.synthetic_aperture.focusing.grids import Grid, default_grid
from mitsonar.synthetic_aperture.record import check_raw
from mitsonar.water.profile import SoundSpeedProfile

from .images import checked_seed, opened, provenance

RAW_FILES = (".nc", ".h5", ".hdf5")


@one_at_a_time
def raw_echoes(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
               progress: Callable[[int, int], None] | None = None, **parameters: object) -> SonarImage:
    """Compute the raw echoes of all pings of a scene's synthetic aperture sonar.

    Parameters
    ----------
    scene, seed, sensor, progress, parameters
        As in `mitsonar.render`.

    Returns
    -------
    SonarImage
        An `xarray.Dataset` with ``signal`` (ping, rx, sample), complex64 [µPa], the true trajectory (``motion_x`` and
        so on), the positions of the elements, the cast and the point targets; see
        `mitsonar.synthetic_aperture.record`. ``mitsonar signals`` writes the same record ping by ping.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, or if the sensor is not a synthetic aperture sonar.
    """
    total: list[int] = []
    pings = []
    scene = opened(scene, sensor, parameters)[0]
    for done, ping in enumerate(raw_pings(scene, seed, sensor=sensor, count=total.append), 1):
        pings.append(ping)
        if progress is not None:
            progress(done, total[0])
    record = xr.concat(pings, "ping", data_vars="minimal", coords="minimal", compat="override",
                       combine_attrs="override")
    return SonarImage.of(cast(xr.Dataset, record))


@one_at_a_time
def focus(scene_or_signals: mi.Scene | xr.Dataset | FilePath, grid: Grid | None = None,
          profile: SoundSpeedProfile | float | FilePath | None = None, *, seed: int = 0, sensor: int | str = 0,
          window: str | tuple | None = None, range_window: str | tuple | None = None,
          trajectory: xr.Dataset | None = None, progress: Callable[[float, float], None] | None = None,
          **parameters: object) -> SonarImage:
    """Focus the raw echoes of a synthetic aperture sonar: of a scene, of a file, or in memory.

    Parameters
    ----------
    scene_or_signals : mitsuba.Scene, xarray.Dataset, or str or path
        A scene as in `mitsonar.render`, the record of `raw_echoes`, or a netCDF file of raw echoes.
    grid : Grid or None
        A grid of `mitsonar.synthetic_aperture.focusing.grids`. None: a strip of the ground, or a square within a
        circular track.
    profile : SoundSpeedProfile, float [m/s], str or path, or None
        Water for the computation of delays: a profile, one sound speed, or the file of a cast. None: the true water.
    seed, sensor, parameters
        As in `mitsonar.render`, for a scene.
    window, range_window : str, tuple or None
        Windows over the angles of the aperture and over the band of the pulse, such as "taylor 4 30", "hann" or
        "none". None: those of the scene's sensor, or "taylor 4 30" for a record.
    trajectory : xarray.Dataset or None
        Trajectory in place of the true one, such as a navigated or a micronavigated one: ``motion_time``,
        ``motion_x`` and so on.
    progress : callable(done, total) or None
        Called after every ping.

    Returns
    -------
    SonarImage
        An `xarray.Dataset` over (bank, along_track, across_track). The squared magnitude of the complex ``image`` is
        the target strength of a point on the elements' plane of look; off this plane the two-way beam of the elements
        lowers it. ``level`` is in [dB re 1 m²]. The image of a scene has the ground truth of every point; see
        `mitsonar.synthetic_aperture.record`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, or if there are no raw echoes, fewer than two pings, or grid, windows, profile or
        trajectory do not fit them.
    """
    if grid is not None and not isinstance(grid, Grid):
        raise TypeError("grid must be a grid of mitsonar.synthetic_aperture.focusing.grids or None, got a "
                        f"{type(grid).__name__}")
    if profile is not None and not isinstance(profile, (SoundSpeedProfile, int, float)):
        profile = casts.read(profile).profile
    water: dict[str, Any] = {"profile": profile, "trajectory": trajectory}
    # records need no variant, and Mitsuba has no Scene before one is set
    if isinstance(scene_or_signals, xr.Dataset) or (
            isinstance(scene_or_signals, (str, os.PathLike))
            and str(scene_or_signals).lower().endswith(RAW_FILES)):
        if parameters:
            raise TypeError(f"{', '.join(parameters)}: no argument has this name, and raw echoes have no parameters; "
                            "give parameters with a scene")
        with (nullcontext(scene_or_signals) if isinstance(scene_or_signals, xr.Dataset)
              else raw_files.opened(scene_or_signals)) as record:
            check_raw(record)
            count = record.sizes["ping"]
            if count < 2:
                raise ValueError(f"the record has {count} pings; a synthetic aperture needs two or more")
            grid = default_grid(record.drop_vars("signal")) if grid is None else grid
            return SonarImage.of(focused(raw_files.pings(record), count, progress, grid=grid, **water,
                                         **_windows(window, range_window)))
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene_or_signals, sensor, parameters)
    survey, origin = _planned(scene, sonar, integrator, seed)
    windows = _windows(survey.aperture_window if window is None else window,
                       survey.range_window if range_window is None else range_window)
    image = focused(pings_of(survey, sonar.own_seed(seed)), survey.track.pings, progress,
                    grid=survey_grid(survey) if grid is None else grid, **water, **windows)
    image = with_truth(image.assign_attrs(seed=seed), survey, seed)
    return SonarImage.of(image.assign_attrs({**origin, **image.attrs}))


def _windows(window: str | tuple | None, range_window: str | tuple | None) -> dict[str, str | tuple]:
    """Return the windows that are not None, by the names of their arguments."""
    return {name: value for name, value in (("window", window), ("range_window", range_window)) if value is not None}


@one_at_a_time
def raw_pings(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0, start: int = 0,
              count: Callable[[int], object] | None = None) -> Iterator[SonarImage]:
    """Yield the raw echoes of one ping after the other, so that memory does not grow with their number."""
    seed, start = checked_seed(seed), operator.index(start)
    scene, sonar, integrator = opened(scene, sensor)
    survey, origin = _planned(scene, sonar, integrator, seed)
    if not 0 <= start <= survey.track.pings:
        raise ValueError(f"start is ping {start}, but the strip has {survey.track.pings} pings, counted from 0")
    if count is not None:
        count(survey.track.pings)
    return (SonarImage.of(not_all_nan(ping).assign_attrs({**origin, **ping.attrs, "seed": seed}))
            for ping in pings_of(survey, sonar.own_seed(seed), start))


@one_at_a_time
def scatterers(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0) -> SonarImage:
    """Return the scatterers of a scene's seabeds and objects that make its raw echoes: the ground truth of speckle."""
    survey, origin = _planned(*opened(scene, sensor), checked_seed(seed))
    return SonarImage.of(scatterers_of(survey).assign_attrs(origin))


@one_at_a_time
def strip_survey(scene: mi.Scene | FilePath, *, sensor: int | str = 0) -> StripSurvey:
    """Return the planned strip of a scene's synthetic aperture sonar; arguments and errors as in `raw_echoes`."""
    return _planned(*opened(scene, sensor))[0]


def _planned(scene: mi.Scene, sonar: Sensor, integrator: SoundIntegrator,
             seed: int = 0) -> tuple[StripSurvey, dict[str, Any]]:
    """Return the survey of a synthetic aperture sonar, and the provenance of its results."""
    if sonar.kind != "synthetic_aperture":
        raise ValueError(f"raw echoes are those of a synthetic aperture, but this sensor is a {sonar.kind}; give the "
                         "scene a <sensor type=\"synthetic_aperture\"/>, or use mitsonar.element_signals")
    try:
        survey = cast(StripSurvey, integrator.array_survey(scene, sonar, LEAD, seed))
    except RuntimeError as error:
        raise as_exception(error) from error
    return survey, provenance(scene, sonar, survey)
