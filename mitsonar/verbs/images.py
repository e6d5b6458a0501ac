"""Images, soundings, impulse responses and element signals of a scene."""
from __future__ import annotations

import importlib.metadata
import operator
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import mitsuba as mi
import numpy as np
import xarray as xr

from mitsonar.device import llvm
from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.device.turns import one_at_a_time
from mitsonar.io import casts
from mitsonar.io.grids.separation import Separation
from mitsonar.io.records.records import SonarImage, SonarSignals, not_all_nan
from mitsonar.io.tracks import tides
from mitsonar.io.tracks.tides import Tide
from mitsonar.scene.alterations import altered
from mitsonar.scene.errors import as_exception
from mitsonar.scene.loading import load_to_render, prepare
from mitsonar.survey.integrator import SoundIntegrator, integrator_of
from mitsonar.survey.kinds import check_frames, check_parts, sounder_kind_of
from mitsonar.survey.sensor import Sensor, sonar_of
from mitsonar.version import __version__
from mitsonar.water.profile import SoundSpeedProfile

if TYPE_CHECKING:                                        # of kinds of sonar that a scene may not have
    from mitsonar.survey.pressure.array_survey import ArraySurvey
    from mitsonar.survey.soundings.heights import DepthReference
    from mitsonar.survey.soundings.survey import SoundedSurvey
    from mitsonar.survey.survey import RunParts, Survey

MOST_SNIPPETS = 10_000
SEEDS = 1 << 32                    # Mitsuba accepts no other seeds


@one_at_a_time
def render(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
           progress: Callable[[float, float], None] | None = None, say: Callable[[str], None] | None = None,
           **parameters: object) -> SonarImage:
    """Render a sonar scene.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        A scene loaded by `mitsonar.load_file` or `mi.load_file`, or a name or path for `mitsonar.load_file`.
    seed : int
        Seed of ray directions, scatterers (unless the scene sets ``ground_seed``) and noise, from 0 to 4294967295. The
        same scene and seed give the same bytes on machines with the same instruction set
        (``attrs["instruction_set"]``).
    sensor : int or str
        Number or id of one of the scene's sensors.
    progress : callable(done, total) or None
        Called after every block with the number of pings done, which for arrays may have a fractional part.
    say : callable(text) or None
        For arrays: called before long work begins, with a sentence about its amount, its duration, and faster
        alternatives.
    **parameters
        Values for the ``$parameters`` of a scene that is given by name or path, as in `mitsonar.load_file`. Use that
        function for a parameter that has the name of an argument above.

    Returns
    -------
    SonarImage
        An `xarray.Dataset`. For sidescans over (ping, side, range): ``level`` [dB re 1 µPa], ``mean_level``, and ground
        truth from the same rays (``label``, ``class``, ``share`` of every shape, ``hidden`` and ``object_shadow``,
        ``layover``, ``depth``, ``seabed_x``, ``seabed_y``, ``seabed_depth``, ``shadow``, ``rays``). Coordinates and
        attributes hold axes, units, the resolved scene, objects and versions.

    Raises
    ------
    FileNotFoundError
        If the scene's file does not exist.
    ValueError
        If scene, sensor and integrator do not make a sonar survey, or the seed is out of range.
    TypeError
        If `scene` is neither a file name nor a scene of the current variant, `seed` is not an integer, or
        parameters are given for a scene that is already loaded.
    """
    return rendered(scene, seed, sensor, progress, say, parameters)


@one_at_a_time
def rendered(scene: mi.Scene | FilePath, seed: int, sensor: int | str,
             progress: Callable[[float, float], None] | None = None, say: Callable[[str], None] | None = None,
             parameters: Mapping[str, object] | None = None, run_parts: RunParts = map) -> SonarImage:
    """Render a scene as `render` does, with parts of its record that may be computed elsewhere."""
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene, sensor, parameters)
    try:
        survey = integrator.survey(scene, sonar, seed)
        if run_parts is not map:
            check_parts(sonar)
            survey = replace(survey, run_parts=run_parts)
        image = integrator.picture(survey, sonar, seed, progress, say)
    except RuntimeError as error:
        raise as_exception(error) from error
    return SonarImage.of(not_all_nan(image).assign_attrs(provenance(scene, sonar, survey)))


@one_at_a_time
def frames(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
           **parameters: object) -> Iterator[SonarImage]:
    """Render the pings of a sonar with a fan of beams one after the other.

    Memory does not grow with the number of pings: for videos, and for data sets of long runs.

    Parameters
    ----------
    scene, seed, sensor, parameters
        As in `render`.

    Yields
    ------
    SonarImage
        Image of one ping, equal to that ping of the image by `render`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `render`, or if the sonar makes one image of all its pings.
    """
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene, sensor, parameters)
    check_frames(sonar)
    try:
        survey = integrator.survey(scene, sonar, seed)
        frame = integrator.frame(survey, sonar, seed)
    except RuntimeError as error:
        raise as_exception(error) from error
    origin = provenance(scene, sonar, survey)
    return (SonarImage.of(not_all_nan(frame(ping)).assign_attrs(origin)) for ping in range(survey.track.pings))


@one_at_a_time
def impulse_response(scene: mi.Scene | FilePath, ping: int | Sequence[int] = 0, kernel: str = "band_limited",
                     return_path: str = "vector", seed: int = 0, *, sensor: int | str = 0,
                     paths: Sequence[str] | None = None, progress: Callable[[float, float], None] | None = None,
                     say: Callable[[str], None] | None = None, **parameters: object) -> SonarSignals:
    """Compute the response of every pair of transmit and receive elements.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        A scene as in `render`, with a sensor that has arrays, such as ``array_sonar``.
    ping : int or sequence of int
        Pings of the track, from 0.
    kernel : str
        Impulse that puts an echo on samples: ``band_limited`` (-55 dB within a third of the sampling rate of the
        carrier), ``peterson`` (low-pass impulse centred on the exact delay) or ``nearest`` (shifted impulse).
    return_path : str
        Method for delays to elements: ``vector``, ``paper`` or ``eigenray`` (exact, an eigenray for every hit and
        element; slow).
    seed : int
        Seed of the scatterers, unless the scene sets ``ground_seed``, and of rays, where rays ensonify them.
    sensor, parameters
        As in `render`.
    paths : sequence of str or None
        Names of the paths whose echoes are kept, such as ("b", "bs"); see `paths`. None: all paths.
    progress : callable(done, total) or None
        Called after every block of cells with the number of pings done, which may have a fractional part.
    say : callable(text) or None
        Called before long work begins, with a sentence about its amount, its duration, and faster alternatives.

    Returns
    -------
    SonarSignals
        An `xarray.DataArray` (ping, tx, rx, sample), complex64: pressure per unit pressure at 1 m. Coordinates are
        ``time`` [s] of the samples since transmission, element positions ``tx_x`` ... ``rx_z`` [m] in the body frame,
        and ``x``, ``y``, ``z``, ``roll``, ``pitch``, ``heading`` and ``ping_time`` of the pings. The attribute
        ``kernel_energy`` is the energy of the kernel: an echo of amplitude a has Σ|h|² = kernel_energy |a|², 0.792 with
        the default. ``lost_arrivals`` counts arrivals that no ray brings to an element although the echo meets the
        array's centre; a warning is given if it is not 0.

    Raises
    ------
    ValueError
        If scene and sensor do not fit together, the ping does not exist, or kernel or return path is unknown.
    """
    from mitsonar.signal.impulses import make_kernel
    from mitsonar.survey.pressure.pressure import PressureRecord
    from mitsonar.survey.pressure.signals import pair_responses

    _check_names(kernel, return_path)
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene, sensor, parameters)
    survey, pings = _survey(integrator, scene, sonar, ping, seed)
    record = PressureRecord(survey, seed=seed, kernel=kernel, return_path=return_path,
                            paths=_known_paths(survey, paths))
    array = pair_responses(record, pings, progress=progress, say=say)
    return _with_attributes(array, kernel=kernel, kernel_energy=make_kernel(kernel).energy, return_path=return_path,
                            **provenance(scene, sonar, survey))


@one_at_a_time
def element_signals(scene: mi.Scene | FilePath, ping: int | Sequence[int] = 0, kernel: str = "band_limited",
                    return_path: str = "vector", seed: int = 0, *, sensor: int | str = 0,
                    paths: Sequence[str] | None = None, progress: Callable[[float, float], None] | None = None,
                    say: Callable[[str], None] | None = None, **parameters: object) -> SonarSignals:
    """Compute the signal of every receive element: echoes of the pulse, and noise.

    All transmit elements send together, with their weights and delays. The platform's motion stretches every echo
    (Doppler). Each frequency of the pulse has its own absorption. Noise is that of the sea and of the receivers.

    Parameters
    ----------
    scene, ping, kernel, return_path, sensor, paths, progress, say, parameters
        As in `impulse_response`.
    seed : int
        Seed of noise, of the scatterers unless the scene sets ``ground_seed``, and of rays where rays ensonify them.

    Returns
    -------
    SonarSignals
        An `xarray.DataArray` (ping, tx, rx, sample), complex64 [µPa]. tx has size 1 and stands for the whole transmit
        array. An echo of delay t begins at time t, or later by the element's own delay if the receive array is
        steered or focused. Coordinates are those of `impulse_response`, with ``rx_weight`` and ``rx_delay`` [s]; the
        record also holds the ``pulse``.

    Notes
    -----
    Kernels are flat to a third of the sampling rate on either side of the carrier. With the default sampling rate, an
    unshaded pulse loses 0.1 to 0.3 dB of its echo energy outside this band (an lfm of 10 kHz and 1 ms 0.12 dB, a cw of
    0.1 ms 0.25 dB). A higher ``sample_rate_khz`` of the film keeps more of it.

    Raises
    ------
    ValueError
        As in `impulse_response`, or if the sampling rate is below the pulse's bandwidth, or the pulse is longer than
        the record.
    """
    from mitsonar.survey.pressure.pressure import PressureRecord
    from mitsonar.survey.pressure.signals import LEAD, received_signals

    _check_names(kernel, return_path)
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene, sensor, parameters)
    survey, pings = _survey(integrator, scene, sonar, ping, seed, lead=LEAD)
    record = PressureRecord(survey, seed=sonar.own_seed(seed), kernel=kernel, return_path=return_path,
                            paths=_known_paths(survey, paths))
    array = received_signals(record, pings, progress=progress, say=say)
    return _with_attributes(array, seed=seed, kernel=kernel, return_path=return_path,
                            **provenance(scene, sonar, survey))


def soundings(scene: mi.Scene | FilePath, seed: int = 0, profile: SoundSpeedProfile | FilePath | None = None, *,
              tide: float | FilePath | None = None, separation: float | FilePath | None = None, heights: str = "tide",
              sensor: int | str = 0, column: bool = False, snippets: int = 0,
              progress: Callable[[int, int], None] | None = None, **parameters: object) -> SonarImage:
    """Compute the soundings of a scene's multibeam echo sounder or interferometric sidescan.

    Parameters
    ----------
    scene, seed, sensor, progress, parameters
        As in `render`.
    profile : SoundSpeedProfile, str or path, or None
        Sound speeds used to process the soundings, or the file of a cast. They may differ from those of the scene's
        water, as the cast of a survey does. None: the scene's own.
    tide : float [m], str or path, or None
        Water level above the datum used to reduce the soundings: a constant, 0 for none, or a CSV file as the water's
        ``tide``. It may differ from the scene's own. None: the scene's own.
    separation : float [m], str or path, or None
        Height of the vertical datum above the ellipsoid used to reduce the soundings: a constant, or the file of a
        grid. None: that of the scene's water.
    heights : {"tide", "gnss"}
        Depths by draft, heave and tide; or by heights of the vessel above the ellipsoid, less the separation.
    column : bool
        Keep the water column: levels of all beams.
    snippets : int
        Number of backscatter samples around each sounding to keep.

    Returns
    -------
    SonarImage
        An `xarray.Dataset` over (ping, beam) with ``depth``, ``x``, ``y``, ``across_track``, ``along_track`` [m],
        ``travel_time``, ``angle``, ``quality``, ``uncertainty``, ``backscatter_db``, ``valid``, and their ground
        truth: ``true_depth``, ``error`` and its causes, ``label``; see `mitsonar.hydrography.record`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `render`, or if the sensor makes no soundings, or the profile's file is not a cast.
    """
    from mitsonar.hydrography.record import joined

    total: list[int] = []
    pings = []
    scene = opened(scene, sensor, parameters)[0]
    for done, image in enumerate(sounded_pings(scene, seed, profile, tide=tide, separation=separation, heights=heights,
                                               sensor=sensor, column=column, snippets=snippets,
                                               count=total.append), 1):
        pings.append(image)
        if progress is not None:
            progress(done, total[0])
    return SonarImage.of(joined(pings))


@one_at_a_time
def sounder(scene: mi.Scene | FilePath, seed: int = 0, profile: SoundSpeedProfile | FilePath | None = None, *,
            tide: float | FilePath | None = None, separation: float | FilePath | None = None,
            heights: str = "tide", sensor: int | str = 0, column: bool = False,
            snippets: int = 0) -> tuple[int, Callable[[Iterable[int]], Iterator[SonarImage]]]:
    """Return the number of pings of a line, and a function that yields the soundings of pings by their numbers.

    Arguments and errors are as in `soundings`. A ping does not depend on which others are made.
    """
    from mitsonar.survey.soundings.line import SoundingLine

    seed = checked_seed(seed)
    samples, profile = checked_snippets(snippets), read_profile(profile)
    by = read_reference(tide, separation, heights)
    scene, sonar, integrator = opened(scene, sensor)
    kind = sounder_kind_of(sonar)
    try:
        survey = integrator.survey(scene, sonar, seed)
        own = sonar.own_seed(seed)
        instrument = kind.instrument(survey, own, column=column, snippets=samples)
        line = SoundingLine(cast("SoundedSurvey", survey), instrument, own, profile=profile, by=by)
    except RuntimeError as error:
        raise as_exception(error) from error
    origin = {**provenance(scene, sonar, survey), "seed": seed}

    @one_at_a_time
    def pings_of(numbers: Iterable[int]) -> Iterator[SonarImage]:
        return (SonarImage.of(image.assign_attrs({**origin, **image.attrs, "seed": seed}))
                for image in line.pings(numbers))

    return survey.track.pings, pings_of


def sounded_pings(scene: mi.Scene | FilePath, seed: int = 0, profile: SoundSpeedProfile | FilePath | None = None, *,
                  tide: float | FilePath | None = None, separation: float | FilePath | None = None,
                  heights: str = "tide", sensor: int | str = 0, column: bool = False, snippets: int = 0, start: int = 0,
                  count: Callable[[int], object] | None = None) -> Iterator[SonarImage]:
    """Yield the soundings of one ping after the other, so that memory does not grow with their number."""
    total, pings_of = sounder(scene, seed, profile, tide=tide, separation=separation, heights=heights, sensor=sensor,
                              column=column, snippets=snippets)
    if count is not None:
        count(total)
    return pings_of(range(operator.index(start), total))


@one_at_a_time
def pings(scene: mi.Scene | FilePath, *, sensor: int | str = 0) -> int:
    """Return the number of pings of a scene's sensor."""
    scene, sonar, integrator = opened(scene, sensor)
    return integrator.survey(scene, sonar).track.pings


def opened(scene: mi.Scene | FilePath, sensor: int | str = 0,
           parameters: Mapping[str, object] | None = None) -> tuple[mi.Scene, Sensor, SoundIntegrator]:
    """Return the scene, loaded if it is a path, the sensor of a number or id, and the integrator of sound."""
    sensor = sensor if isinstance(sensor, str) else operator.index(sensor)
    prepare()
    if not isinstance(scene, mi.Scene):
        if not isinstance(scene, (str, os.PathLike)):
            raise TypeError(f"expected a scene of the variant {mi.variant()} or the path of a file, got a "
                            f"{type(scene).__name__}; load the scene after mi.set_variant")
        scene = load_to_render(scene, parameters or {})
    elif parameters:
        raise TypeError(f"{', '.join(parameters)}: no argument has this name, and this scene is already loaded, so it "
                        "takes no parameters; give them to mitsonar.load_file")
    sensors = scene.sensors()
    if not sensors:
        raise ValueError("the scene has no sensor; write <sensor type=\"sidescan\"> ... </sensor>")
    if isinstance(sensor, str):
        ids = [candidate.id() for candidate in sensors]
        if sensor not in ids:
            raise ValueError(f'sensor "{sensor}" was asked for{meant(sensor, ids)}; the scene has {", ".join(ids)}')
        sensor = ids.index(sensor)
    if not 0 <= sensor < len(sensors):
        raise ValueError(f"sensor {sensor} was asked for, but the scene has {len(sensors)}, counted from 0")
    integrator = integrator_of(scene)
    return scene, sonar_of(sensors[sensor]), integrator


def checked_snippets(snippets: int) -> int:
    """Return a number of samples as an int; raise ValueError if it is out of range."""
    samples = operator.index(snippets)
    if not 0 <= samples <= MOST_SNIPPETS:
        raise ValueError(f"snippets is {samples}; give a number of samples from 0, for none, to {MOST_SNIPPETS}")
    return samples


def read_profile(profile: SoundSpeedProfile | FilePath | None) -> SoundSpeedProfile | None:
    """Return a profile, read if it is the file of a cast."""
    return profile if profile is None or isinstance(profile, SoundSpeedProfile) else casts.read(profile).profile


def read_reference(tide: float | FilePath | None, separation: float | FilePath | None = None,
                   heights: str = "tide") -> DepthReference:
    """Return what depths are reduced with, from constants [m] or files."""
    from mitsonar.survey.soundings.heights import DepthReference

    return DepthReference(tide=read_tide(tide), separation=read_separation(separation), heights=heights)


def read_separation(separation: float | FilePath | None) -> Separation | None:
    """Return a separation, of a grid if it is a file, or constant [m]."""
    if separation is None:
        return None
    is_file = isinstance(separation, (str, os.PathLike))
    return Separation(path=separation) if is_file else Separation(constant=float(separation))


def read_tide(tide: float | FilePath | None) -> Tide | float | None:
    """Return a tide, read if it is a file, or a constant water level [m]."""
    if tide is None or isinstance(tide, (str, os.PathLike)):
        return None if tide is None else tides.load(tide)
    level = float(tide)
    if not abs(level) <= tides.HIGHEST:
        raise ValueError(f"tide is {level:g} m; give a water level within +-{tides.HIGHEST:g} m, or the file of a tide")
    return level


def checked_seed(seed: int) -> int:
    """Return a seed as an int; raise ValueError if it is out of range."""
    number = operator.index(seed)
    if not 0 <= number < SEEDS:
        raise ValueError(f"seed is {number}; give a whole number from 0 to {SEEDS - 1}")
    return number


def provenance(scene: mi.Scene, sensor: Sensor, survey: Survey) -> dict[str, object]:
    """Return attributes of a result that record its scene, parameters, versions and origin."""
    passage, world = survey.passage, survey.world
    origin, crs = world.local_origin, world.crs
    if origin is None and passage.frame is not None:
        # without a surveyed seabed, the track's latitudes and longitudes locate the scene
        origin, crs = passage.frame.origin, passage.frame.crs
    known = sensor.provenance or {"file": None, "scene": None, "parameters": {}}
    lengths = {} if passage.planned is None else {"course_sailed": passage.sailed, "course_planned": passage.planned}
    instruction_set = "CUDA" if str(mi.variant()).startswith("cuda") else llvm.instruction_set()
    versions = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "numpy")}
    return {**known, **lengths, **survey.waters.attributes,
            "altered": None if sensor.loaded is None else altered(scene, sensor.loaded),
            "versions": {"mitsonar": __version__, **versions}, "instruction_set": instruction_set,
            "local_origin": None if origin is None else [float(v) for v in origin], "crs": crs}


def _with_attributes(array: xr.DataArray, **attributes: object) -> SonarSignals:
    return SonarSignals.of(not_all_nan(array).assign_attrs(attributes))


def _check_names(kernel: str, return_path: str) -> None:
    from mitsonar.propagation.returns.vector_approximation import DIFFERENCES
    from mitsonar.signal.impulses import KERNELS

    return_paths = (*DIFFERENCES, "eigenray")
    for name, value, known in (("kernel", kernel, KERNELS), ("return_path", return_path, return_paths)):
        if value not in known:
            raise ValueError(f"{name} is {value!r}{meant(value, known)}; choose one of {', '.join(known)}")


def _known_paths(survey: Survey, paths: Sequence[str] | None) -> list[str] | None:
    """Return the survey's names of paths, which users may also give in reverse; None stands for all paths."""
    if paths is None:
        return None
    known = survey.paths.names
    chosen = [name if name in known else name[::-1] for name in map(str, paths)]
    for name in chosen:
        if name not in known:
            raise ValueError(f"path {name[::-1]!r} was asked for, but the scene has {', '.join(known)}; raise "
                             "max_depth for longer paths, or leave this one out")
    return chosen


def _survey(integrator: SoundIntegrator, scene: mi.Scene, sensor: Sensor, ping: int | Sequence[int],
            seed: int, lead: float = 0.0) -> tuple[ArraySurvey, list[int]]:
    """Plan the run; return it with the pings that are asked for. `lead` is in pulse lengths before the transmission."""
    try:
        survey = integrator.array_survey(scene, sensor, lead, seed)
    except RuntimeError as error:
        raise as_exception(error) from error
    pings = [operator.index(number) for number in np.atleast_1d(ping).tolist()]
    for number in pings:
        if not 0 <= number < survey.track.pings:
            raise ValueError(f"ping {number} was asked for, but the track has {survey.track.pings}, counted from 0")
    if not pings:
        raise ValueError("no ping was asked for; give at least one number")
    return survey, pings
