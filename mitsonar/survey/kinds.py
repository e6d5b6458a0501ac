"""Kinds of sonar: each is one file with the functions of `Kind`.

To add a kind, write KIND/kind.py and add its name to `KINDS`; its sensor plugin has the name as its attribute `kind`.
"""
from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    import mitsuba as mi
    import numpy as np
    import xarray as xr

    from mitsonar.water.profile import SoundSpeedProfile

    from .pressure.array_survey import ArraySurvey
    from .sensor import RunSettings
    from .soundings.line import SoundingLine
    from .survey import Survey

FILES = {"array": "fan.kind", "forward_looking": "fan.forward_looking"}        # of kinds without a folder of their name


class _KindFiles(Mapping[str, Any]):
    """Modules of kinds by name, imported when they are first used."""

    def __init__(self, *names: str):
        self._names = names

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(name)
        return importlib.import_module(f"{__package__}.{FILES.get(name, f'{name}.kind')}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Kind(Protocol):
    """Functions in the module of a kind of sonar; sensor and survey are those of the kind."""

    def plan(self, scene: mi.Scene, sensor: Any, settings: RunSettings) -> Survey:
        """Plan a run for a picture."""
        ...

    def picture(self, survey: Any, sensor: Any, seed: int, progress: Callable[[float, float], None] | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
        """Render the run's record as a labelled image."""
        ...

    def plan_elements(self, scene: mi.Scene, sensor: Any, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
        """Plan the same run for the elements' signals."""
        ...

    def rows(self, level: np.ndarray) -> np.ndarray:
        """Return the levels of an image as rows of one picture."""
        ...


KINDS: Mapping[str, Kind] = _KindFiles("sidescan", "array", "forward_looking", "sector_scan", "multibeam",
                                   "synthetic_aperture", "interferometric", "echo_sounder")


class FrameKind(Kind, Protocol):
    """Kind of sonar with a picture for every ping."""

    def frames(self, survey: Any, sensor: Any, seed: int) -> Iterator[xr.Dataset]:
        """Yield the pictures of pings one by one."""
        ...


FRAMES: Mapping[str, FrameKind] = _KindFiles("array", "forward_looking", "multibeam")


class SounderKind(Kind, Protocol):
    """Kind of sonar that makes soundings."""

    def sounding_line(self, survey: Any, seed: int, *, profile: SoundSpeedProfile | None, column: bool,
                      snippets: int) -> SoundingLine:
        """Make the soundings of a line; arguments are those of `mitsonar.soundings`."""
        ...


SOUNDERS: Mapping[str, SounderKind] = _KindFiles("multibeam", "interferometric")


def sounder_kind_of(sensor: Any) -> SounderKind:
    """Return the sensor's kind of sonar, which must make soundings."""
    kind_of(sensor)
    if sensor.kind not in SOUNDERS:
        raise ValueError(f"only a multibeam echo sounder or an interferometric sidescan makes soundings, and this "
                         f"sensor is a {sensor.kind}; give the scene a <sensor type=\"multibeam\"/>")
    return SOUNDERS[sensor.kind]


def frame_kind_of(sensor: Any) -> FrameKind:
    """Return the sensor's kind of sonar, which must have a picture for every ping."""
    kind_of(sensor)
    if sensor.kind not in FRAMES:
        raise ValueError(f"a {sensor.kind} has no picture of a single ping; render all pings as one picture. Sonars "
                         f"with a picture for every ping are {', '.join(FRAMES)}")
    return FRAMES[sensor.kind]


def kind_of(sensor: Any) -> Kind:
    """Return the sensor's kind of sonar."""
    kind = getattr(sensor, "kind", "")
    if kind not in KINDS:
        name = sensor.class_name() if hasattr(sensor, "class_name") else type(sensor).__name__
        raise ValueError(f"the integrator sonar_path needs a sonar, such as <sensor type=\"sidescan\">, got a {name}")
    return KINDS[kind]
