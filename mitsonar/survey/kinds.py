"""Kinds of sonar: each is one file with the functions of `Kind`.

To add a kind, write KIND/kind.py and add its name to `KINDS`; its sensor plugin has the name as its attribute `kind`.
"""
from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, Protocol, TypeVar, cast

from mitsonar.device.lazy import imports

from .sensor import RunSettings, Sensor, sonar_of

if TYPE_CHECKING:
    import mitsuba as mi
    import numpy as np
    import xarray as xr

    from .pressure.array_survey import ArraySurvey
    from .soundings.line import Instrument
    from .survey import Survey

FILES = {"array": "fan.kind", "forward_looking": "fan.forward_looking"}        # of kinds without a folder of their name
SurveyT = TypeVar("SurveyT", bound="Survey")
SensorT = TypeVar("SensorT", bound=Sensor, contravariant=True)
KindT = TypeVar("KindT", covariant=True)


class _KindFiles(Mapping[str, KindT]):
    """Modules of kinds by name, imported when they are first used.

    Their functions take the sensors of their name and the surveys that they plan themselves. No type checker can know
    the name of a sensor in a file; that of each plugin is compared in `plugins/contracts.py`.
    """

    def __init__(self, *names: str):
        self._names = names

    def __getitem__(self, name: str) -> KindT:
        if name not in self._names:
            raise KeyError(name)
        with imports():
            return cast(KindT, importlib.import_module(f"{__package__}.{FILES.get(name, f'{name}.kind')}"))

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


class Kind(Protocol[SurveyT, SensorT]):
    """Functions in the module of a kind of sonar, for the surveys and sensors of the kind."""

    def plan(self, scene: mi.Scene, sensor: SensorT, settings: RunSettings) -> SurveyT:
        """Plan a run for a picture."""
        ...

    def picture(self, survey: SurveyT, sensor: SensorT, seed: int,
                progress: Callable[[float, float], None] | None = None,
                say: Callable[[str], None] | None = None) -> xr.Dataset:
        """Render the run's record as a labelled image."""
        ...

    def plan_elements(self, scene: mi.Scene, sensor: SensorT, settings: RunSettings, lead: float = 0.0) -> ArraySurvey:
        """Plan the same run for the elements' signals."""
        ...

    def rows(self, level: np.ndarray) -> np.ndarray:
        """Return the levels of an image as rows of one picture."""
        ...


KINDS: Mapping[str, Kind[Survey, Sensor]] = _KindFiles(
    "sidescan", "array", "forward_looking", "sector_scan", "multibeam", "synthetic_aperture", "interferometric",
    "echo_sounder")


class FrameKind(Kind[SurveyT, SensorT], Protocol):
    """Kind of sonar that can render the picture of one ping."""

    def frame(self, survey: SurveyT, sensor: SensorT, seed: int) -> Callable[[int], xr.Dataset]:
        """Return the function that renders the picture of a ping, by its number."""
        ...


FRAMES = "array", "forward_looking", "multibeam"                               # each ping is a picture by itself
STEPPED: Mapping[str, FrameKind[Survey, Sensor]] = _KindFiles(*FRAMES, "sidescan", "sector_scan")
TOGETHER = "sector_scan", "synthetic_aperture"             # the picture is made of the signals of all pings


def check_parts(sensor: Sensor) -> None:
    """Raise `ValueError` if the pings of the sensor's kind of sonar cannot be shared among processes."""
    if sensor.kind in TOGETHER:
        raise ValueError(f"the pings of a {sensor.kind} cannot be shared among processes, because its picture is made "
                         "of the signals of all pings together; render it in one process, which uses all cores")


class SounderKind(Kind[SurveyT, SensorT], Protocol):
    """Kind of sonar that makes soundings."""

    def instrument(self, survey: SurveyT, seed: int, *, column: bool,
                   snippets: int) -> Instrument[Any]:           # of any measurement
        """Make the instrument that measures the pings; arguments are those of `mitsonar.soundings`."""
        ...


SOUNDERS: Mapping[str, SounderKind[Survey, Sensor]] = _KindFiles("multibeam", "interferometric")

if TYPE_CHECKING:                   # every module against its protocol
    from .echo_sounder import kind as echo_sounder
    from .energy.sidescan_survey import SidescanSurvey
    from .fan import forward_looking, kind as fan
    from .interferometric import kind as interferometric
    from .multibeam import kind as multibeam
    from .sector_scan import kind as sector_scan
    from .sidescan import kind as sidescan
    from .soundings.survey import SwathSurvey
    from .synthetic_aperture import kind as synthetic_aperture

    _SIDESCAN: FrameKind[SidescanSurvey, sidescan.SidescanSensor] = sidescan
    _ARRAY: FrameKind[ArraySurvey, fan.ArraySensor] = fan
    _FORWARD_LOOKING: FrameKind[ArraySurvey, forward_looking.ForwardLookingSensor] = forward_looking
    _SECTOR_SCAN: FrameKind[ArraySurvey, sector_scan.SectorScanSensor] = sector_scan
    _MULTIBEAM: FrameKind[SwathSurvey, multibeam.MultibeamSensor] = multibeam
    _SWATH: SounderKind[SwathSurvey, multibeam.MultibeamSensor] = multibeam
    _INTERFEROMETRIC: SounderKind[interferometric.InterferometricSurvey,
                                  interferometric.InterferometricSensor] = interferometric
    _ECHO_SOUNDER: Kind[ArraySurvey, echo_sounder.EchoSounderSensor] = echo_sounder
    _SYNTHETIC_APERTURE: Kind[synthetic_aperture.StripSurvey, synthetic_aperture.StripSensor] = synthetic_aperture


def sounder_kind_of(sensor: Sensor) -> SounderKind[Survey, Sensor]:
    """Return the sensor's kind of sonar, which must make soundings."""
    if sensor.kind not in SOUNDERS:
        raise ValueError(f"only a multibeam echo sounder or an interferometric sidescan makes soundings, and this "
                         f"sensor is a {sensor.kind}; give the scene a <sensor type=\"multibeam\"/>")
    return SOUNDERS[sensor.kind]


def check_frames(sensor: Sensor) -> None:
    """Raise `ValueError` unless the sensor's kind of sonar has a picture for every ping."""
    if sensor.kind not in FRAMES:
        raise ValueError(f"a {sensor.kind} has no picture of a single ping; render all pings as one picture. Sonars "
                         f"with a picture for every ping are {', '.join(FRAMES)}")


def stepped_kind_of(sensor: Sensor) -> FrameKind[Survey, Sensor]:
    """Return the sensor's kind of sonar, whose pings can be asked for one by one."""
    if sensor.kind not in STEPPED:
        raise ValueError(f"a {sensor.kind} cannot be stepped, because its record is made of all pings together; sonars "
                         f"that can be are {', '.join(STEPPED)}")
    return STEPPED[sensor.kind]


def kind_of(sensor: mi.Sensor | Sensor) -> Kind[Survey, Sensor]:
    """Return the sensor's kind of sonar."""
    kind = sonar_of(sensor).kind
    if kind not in KINDS:
        raise ValueError(f"a sonar of the kind {kind} was asked for; there are {', '.join(KINDS)}")
    return KINDS[kind]
