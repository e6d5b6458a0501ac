"""The verbs of a synthetic aperture: raw echoes of a scene's strip, and the image that is focused of them."""
from __future__ import annotations

import operator
from collections.abc import Callable, Iterator
from typing import Any

import mitsuba as mi
import xarray as xr

from .io.files import FilePath
from .io.records import SonarImage
from .scene.errors import as_exception
from .survey.kinds import KINDS, kind_of
from .survey.signals import LEAD
from .survey.strip.raw import raw_pings as pings_of
from .survey.strip.scatterers import scatterers_of
from .verbs import checked_seed, opened, provenance

__all__ = ["raw_echoes", "raw_pings", "scatterers"]


def raw_echoes(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
               progress: Callable[[int, int], None] | None = None) -> SonarImage:
    """Make the raw echoes of a scene's synthetic aperture, whole.

    Parameters
    ----------
    scene, seed, sensor, progress
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
    for done, one in enumerate(raw_pings(scene, seed, sensor=sensor, count=total.append), 1):
        made.append(one)
        if progress is not None:
            progress(done, total[0])
    return SonarImage.of(xr.concat(made, "ping", data_vars="minimal", coords="minimal", compat="override",
                                   combine_attrs="override"))


def raw_pings(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0, start: int = 0,
              count: Callable[[int], object] | None = None) -> Iterator[SonarImage]:
    """Make raw echoes ping by ping: what is kept does not grow with their number.

    Parameters
    ----------
    scene, seed, sensor
        As of `raw_echoes`.
    start : int
        The first ping that is made; it is the same wherever one starts.
    count : callable(pings) or None
        Called with the number of the strip's pings before the first.

    Yields
    ------
    SonarImage
        Of one ping, with what all pings have in common.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `raw_echoes`, or if there is no such ping to start at.
    """
    seed, start = checked_seed(seed), operator.index(start)
    scene, sonar, integrator = opened(scene, sensor)
    survey, about = _planned(scene, sonar, integrator)
    if not 0 <= start <= survey.track.pings:
        raise ValueError(f"start is ping {start}, and the strip has {survey.track.pings}, counted from 0")
    if count is not None:
        count(survey.track.pings)
    return (SonarImage.of(one.assign_attrs({**about, **one.attrs, "seed": seed}))
            for one in pings_of(survey, sonar.own_seed(seed), start))


def scatterers(scene: mi.Scene | FilePath, *, sensor: int | str = 0) -> SonarImage:
    """Give the scatterers that the raw echoes of a scene's seabeds and objects are made of: the truth of its speckle.

    Parameters
    ----------
    scene, sensor
        As of `raw_echoes`.

    Returns
    -------
    SonarImage
        Over ``scatterer``, see `survey.strip.scatterers.scatterers_of`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `raw_echoes`, or if there are too many.
    """
    scene, sonar, integrator = opened(scene, sensor)
    survey, about = _planned(scene, sonar, integrator)
    return SonarImage.of(scatterers_of(survey).assign_attrs(about))


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
