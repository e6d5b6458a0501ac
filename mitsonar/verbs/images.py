"""The verbs: a scene in, an image (`render`) or what elements hear (`impulse_response`, `element_signals`) out."""
from __future__ import annotations

import importlib.metadata
import operator
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import mitsuba as mi
import numpy as np

from mitsonar.device import llvm
from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.hydrography.record import joined
from mitsonar.io import casts
from mitsonar.io.records.records import SonarImage, SonarSignals, not_all_nan
from mitsonar.propagation.returns.vector_approximation import DIFFERENCES
from mitsonar.scene.alterations import altered
from mitsonar.scene.errors import as_exception
from mitsonar.scene.loading import load_file, prepare
from mitsonar.signal.impulses import KERNELS, make_kernel
from mitsonar.survey.kinds import sounder_kind_of
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.pressure.signals import LEAD, pair_responses, received_signals
from mitsonar.survey.survey import Survey
from mitsonar.version import __version__
from mitsonar.water.profile import SoundSpeedProfile

RETURN_PATHS = (*DIFFERENCES, "eigenray")
MOST_SNIPPETS = 10_000
SEEDS = 1 << 32                    # seeds that Mitsuba takes, and that tell rays apart


def render(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
           progress: Callable[[int, int], None] | None = None, say: Callable[[str], None] | None = None,
           **parameters: object) -> SonarImage:
    """Render a sonar scene.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        As `mitsonar.load_file` or `mi.load_file` give it, or what `mitsonar.load_file` takes.
    seed : int
        Of everything random: ray directions, speckle, noise. The same scene and seed give the same bytes
        on machines of one instruction set (``attrs["instruction_set"]``).
        From 0 to 4294967295.
    sensor : int or str
        Which of the scene's sensors: its number or its id.
    progress : callable(done, total) or None
        Called after every block with the number of pings done, which for arrays may have a fractional part.
    say : callable(text) or None
        For arrays: called before longer work begins, with a sentence that says how much there is, how long it will
        take, and what would be faster.
    **parameters
        Values for the ``$parameters`` of a scene that is given by name or path, as `mitsonar.load_file` takes them.
        A parameter that is called like an argument above is set by `mitsonar.load_file`.

    Returns
    -------
    SonarImage
        An `xarray.Dataset`; for sidescans over (ping, side, range): ``level`` [dB re 1 µPa], ``mean_level``, and ground
        truth from the same rays (``label``, ``class``, ``share`` of every shape, ``hidden`` and ``object_shadow``,
        ``layover``, ``depth``, ``seabed_x``, ``seabed_y``, ``seabed_depth``, ``shadow``, ``rays``); axes, units,
        resolved scene, objects and versions in coordinates and attributes.

    Raises
    ------
    FileNotFoundError
        If the scene's file is not there.
    ValueError
        If scene, sensor and integrator do not make a sonar survey, or the seed is out of range.
    TypeError
        If `scene` is neither a file's name nor a scene of the present variant, `seed` is no whole number, or
        parameters are given for a scene that is loaded already.
    """
    seed = checked_seed(seed)
    scene, sensor, integrator = opened(scene, sensor, parameters)
    try:
        survey = integrator.survey(scene, sensor)
        image = integrator.picture(survey, sensor, seed, progress, say)
    except RuntimeError as error:
        raise as_exception(error) from error
    return SonarImage.of(not_all_nan(image).assign_attrs(provenance(scene, sensor, survey)))


def frames(scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
           **parameters: object) -> Iterator[SonarImage]:
    """Render the pings of a sonar with a fan of beams one after the other, as many as the scene has.

    What is kept does not grow with their number: for videos, and for data sets of long runs.

    Parameters
    ----------
    scene, seed, sensor, parameters
        As of `render`.

    Yields
    ------
    SonarImage
        Of one ping; the same as that ping of what `render` gives.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `render`, or if the sonar makes one picture of all its pings.
    """
    seed = checked_seed(seed)
    scene, sensor, integrator = opened(scene, sensor, parameters)
    try:
        survey = integrator.survey(scene, sensor)
        images = integrator.frames(survey, sensor, seed)
    except RuntimeError as error:
        raise as_exception(error) from error
    about = provenance(scene, sensor, survey)
    return (SonarImage.of(not_all_nan(image).assign_attrs(about)) for image in images)


def impulse_response(scene: mi.Scene | FilePath, ping: int | Sequence[int] = 0, kernel: str = "band_limited",
                     return_path: str = "vector", seed: int = 0, *, sensor: int | str = 0,
                     paths: Sequence[str] | None = None, progress: Callable[[float, int], None] | None = None,
                     say: Callable[[str], None] | None = None, **parameters: object) -> SonarSignals:
    """Compute the response of every pair of transmit and receive elements.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        With a sensor that has arrays, such as ``array_sonar``.
    ping : int or sequence of int
        Which of the track's pings, from 0.
    kernel : str
        How an echo is put on samples: ``band_limited`` (-55 dB within a third of the sampling rate of the carrier),
        ``peterson`` (low-pass impulse centred on the exact delay) or ``nearest`` (shifted impulse).
    return_path : str
        How delays to elements are found: ``vector``, ``paper`` or ``eigenray`` (exact, an eigenray for every hit and
        element; slow).
    seed : int
        Of rays, where they ensonify the scatterers; the scatterers themselves belong to the scene.
    sensor : int or str
        Which of the scene's sensors: its number or its id.
    paths : sequence of str or None
        Only echoes along these, such as ("b", "bs"), see `paths`; None: all.
    progress : callable(done, total) or None
        Called after every block of cells with how much is done, which may be a fraction of a ping or an element.
    say : callable(text) or None
        Called before longer work begins, with a sentence that says how much there is, how long it will take, and
        what would be faster.
    **parameters
        As of `render`.

    Returns
    -------
    SonarSignals
        An `xarray.DataArray` (ping, tx, rx, sample), complex64: pressure per unit pressure at 1 m. ``time`` [s] of the
        samples since the transmission, element positions ``tx_x`` ... ``rx_z`` [m] in the body frame, and of the pings
        ``x``, ``y``, ``z``, ``roll``, ``pitch``, ``heading`` and ``ping_time``. The attribute ``kernel_energy`` is what
        the kernel makes of the energy of an echo of amplitude a: Σ|h|² = kernel_energy |a|², 0.792 with the default;
        ``lost_arrivals`` counts the arrivals at elements that no ray brings although the echo meets the array's centre,
        and a warning tells it where it is not 0.

    Raises
    ------
    ValueError
        If scene and sensor do not fit together, there is no such ping, or kernel or return path is unknown.
    """
    _check_names(kernel, return_path)
    scene, sensor, integrator = opened(scene, sensor, parameters)
    survey, chosen = _survey(integrator, scene, sensor, ping)
    record = PressureRecord(survey, seed=checked_seed(seed), kernel=kernel, return_path=return_path,
                            paths=_known_paths(survey, paths))
    array = pair_responses(record, chosen, progress=progress, say=say)
    return _with_attributes(array, kernel=kernel, kernel_energy=make_kernel(kernel).energy, return_path=return_path,
                 **provenance(scene, sensor, survey))


def element_signals(scene: mi.Scene | FilePath, ping: int | Sequence[int] = 0, kernel: str = "band_limited",
                    return_path: str = "vector", seed: int = 0, *, sensor: int | str = 0,
                    paths: Sequence[str] | None = None, progress: Callable[[float, int], None] | None = None,
                    say: Callable[[str], None] | None = None, **parameters: object) -> SonarSignals:
    """Compute what every receive element records of a ping: echoes of the pulse, and noise.

    All transmit elements send together, with their weights and delays. Doppler from the platform's motion stretches
    every echo; absorption is that of each frequency of the pulse; noise is that of the sea and of the receivers.

    Parameters
    ----------
    scene, ping, kernel, return_path, sensor, paths, progress, say, parameters
        As of `impulse_response`.
    seed : int
        Of noise, and of rays where they ensonify the scatterers.

    Returns
    -------
    SonarSignals
        An `xarray.DataArray` (ping, tx, rx, sample), complex64 [µPa], tx of size 1: the whole transmit array; with its
        ``pulse``. An echo of delay t begins at time t, later by the element's own delay where the receive
        array is steered or focused. Coordinates as of `impulse_response`, and ``rx_weight``, ``rx_delay`` [s].

    Notes
    -----
    The record has the band of its sampling rate: kernels are flat to a third of it either side of the carrier. At the
    rate taken where the scene writes none, what an unshaded pulse has beyond costs its echoes 0.1 to 0.3 dB of energy
    (an lfm of 10 kHz and 1 ms 0.12 dB, a cw of 0.1 ms 0.25 dB); ``sample_rate_khz`` of the film keeps more of it.

    Raises
    ------
    ValueError
        As `impulse_response`, or if the sampling rate is below the pulse's bandwidth, or the pulse longer than the
        record.
    """
    _check_names(kernel, return_path)
    seed = checked_seed(seed)
    scene, sonar, integrator = opened(scene, sensor, parameters)
    survey, chosen = _survey(integrator, scene, sonar, ping, lead=LEAD)
    record = PressureRecord(survey, seed=sonar.own_seed(seed), kernel=kernel, return_path=return_path,
                            paths=_known_paths(survey, paths))
    array = received_signals(record, chosen, progress=progress, say=say)
    return _with_attributes(array, seed=seed, kernel=kernel, return_path=return_path,
                            **provenance(scene, sonar, survey))


def soundings(scene: mi.Scene | FilePath, seed: int = 0, profile: SoundSpeedProfile | FilePath | None = None, *,
              sensor: int | str = 0, column: bool = False, snippets: int = 0,
              progress: Callable[[int, int], None] | None = None, **parameters: object) -> SonarImage:
    """Sound the bed of a scene with its multibeam echo sounder, or its interferometric sidescan.

    Parameters
    ----------
    scene, seed, sensor, progress, parameters
        As of `render`.
    profile : SoundSpeedProfile, str or path, or None
        Sound speeds that the soundings are made with, or the file of a cast: a survey's, where the scene has the
        water's. None: the scene's own.
    column : bool
        Whether the water column is kept: levels of all beams.
    snippets : int
        Samples of the bed's strength about each sounding that are kept.

    Returns
    -------
    SonarImage
        An `xarray.Dataset` over (ping, beam) with ``depth``, ``x``, ``y``, ``across_track``, ``along_track`` [m],
        ``travel_time``, ``angle``, ``quality``, ``uncertainty``, ``backscatter_db``, ``valid``, and beside each the
        truth: ``true_depth``, ``error`` and its causes, ``label``; see `mitsonar.hydrography.record`.

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As `render`, or if the sensor makes no soundings, or the profile's file is no cast.
    """
    total: list[int] = []
    pings = []
    scene = opened(scene, sensor, parameters)[0]
    for done, one in enumerate(sounded_pings(scene, seed, profile, sensor=sensor, column=column, snippets=snippets,
                                             count=total.append), 1):
        pings.append(one)
        if progress is not None:
            progress(done, total[0])
    return SonarImage.of(joined(pings))


def sounded_pings(scene: mi.Scene | FilePath, seed: int = 0, profile: SoundSpeedProfile | FilePath | None = None, *,
                  sensor: int | str = 0, column: bool = False, snippets: int = 0, start: int = 0,
                  count: Callable[[int], object] | None = None) -> Iterator[SonarImage]:
    """Sound the bed ping by ping: what is kept does not grow with their number."""
    seed = checked_seed(seed)
    if profile is not None and not isinstance(profile, SoundSpeedProfile):
        profile = casts.read(profile).profile
    scene, sonar, integrator = opened(scene, sensor)
    kind = sounder_kind_of(sonar)
    try:
        survey = integrator.survey(scene, sonar)
        line = kind.sounding_line(survey, sonar.own_seed(seed), profile=profile, column=column,
                                  snippets=_samples(snippets))
    except RuntimeError as error:
        raise as_exception(error) from error
    if count is not None:
        count(survey.track.pings)
    about = {**provenance(scene, sonar, survey), "seed": seed}
    return (SonarImage.of(one.assign_attrs({**about, **one.attrs, "seed": seed}))
            for one in line.pings(range(operator.index(start), survey.track.pings)))


def _samples(snippets: int) -> int:
    """Return a number of samples, or refuse it."""
    number = operator.index(snippets)
    if not 0 <= number <= MOST_SNIPPETS:
        raise ValueError(f"snippets is {number}; give a number of samples from 0, for none, to {MOST_SNIPPETS}")
    return number


def pings(scene: mi.Scene | FilePath, *, sensor: int | str = 0) -> int:
    """Number of pings of a scene's sensor."""
    scene, sensor, integrator = opened(scene, sensor)
    return integrator.survey(scene, sensor).track.pings


def opened(scene: mi.Scene | FilePath, sensor: int | str = 0,
           parameters: Mapping[str, object] | None = None) -> tuple[mi.Scene, Any, Any]:
    """Return a scene (loaded if it is a path), the sensor of that number or id, and an integrator that renders sound.
    """
    sensor = sensor if isinstance(sensor, str) else operator.index(sensor)
    prepare()
    if not isinstance(scene, mi.Scene):
        if not isinstance(scene, (str, os.PathLike)):
            raise TypeError(f"a scene of the variant {mi.variant()} or the path of a file was wanted, got a "
                            f"{type(scene).__name__}; load the scene after mi.set_variant")
        scene = load_file(scene, **(parameters or {}))
    elif parameters:
        raise TypeError(f"{', '.join(parameters)}: no argument has this name, and parameters go to scenes that are "
                        "given by name or path; this scene is loaded already: give them to mitsonar.load_file")
    sensors, integrator = scene.sensors(), scene.integrator()
    if not sensors:
        raise ValueError("the scene has no sensor; write <sensor type=\"sidescan\"> ... </sensor>")
    if isinstance(sensor, str):
        ids = [one.id() for one in sensors]
        if sensor not in ids:
            raise ValueError(f'sensor "{sensor}" was asked for{meant(sensor, ids)}; the scene has {", ".join(ids)}')
        sensor = ids.index(sensor)
    if not 0 <= sensor < len(sensors):
        raise ValueError(f"sensor {sensor} was asked for, but the scene has {len(sensors)}, counted from 0")
    if not hasattr(integrator, "picture"):
        raise ValueError("the scene's integrator cannot render sound; write <integrator type=\"sonar_path\"/>")
    return scene, sensors[sensor], integrator


def checked_seed(seed: int) -> int:
    """Return a seed as a number, or refuse it."""
    number = operator.index(seed)
    if not 0 <= number < SEEDS:
        raise ValueError(f"seed is {number}; give a whole number from 0 to {SEEDS - 1}")
    return number


def provenance(scene: mi.Scene, sensor: Any, survey: Survey) -> dict[str, Any]:
    """Return the provenance of a result: scene, parameters, versions, origin."""
    passage, geometry = survey.passage, survey.geometry
    origin, crs = geometry.local_origin, geometry.crs
    if origin is None and passage.frame is not None:
        # without a surveyed seabed, the track's latitudes and longitudes say where the scene lies
        origin, crs = passage.frame.origin, passage.frame.crs
    known = sensor.provenance or {"file": None, "scene": None, "parameters": {}}
    lengths = {} if passage.planned is None else {"course_sailed": passage.sailed, "course_planned": passage.planned}
    instruction_set = "CUDA" if str(mi.variant()).startswith("cuda") else llvm.instruction_set()
    versions = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "numpy")}
    return {**known, **lengths, "altered": None if sensor.loaded is None else altered(scene, sensor.loaded),
            "versions": {"mitsonar": __version__, **versions}, "instruction_set": instruction_set,
            "local_origin": None if origin is None else [float(v) for v in origin], "crs": crs}


def _with_attributes(array, **attributes):
    """Signals that say where they come from."""
    return SonarSignals.of(not_all_nan(array).assign_attrs(attributes))


def _check_names(kernel, return_path):
    for name, value, known in (("kernel", kernel, KERNELS), ("return_path", return_path, RETURN_PATHS)):
        if value not in known:
            raise ValueError(f"{name} is {value!r}{meant(value, known)}; give one of {', '.join(known)}")


def _known_paths(survey, paths):
    """Names of the paths asked for, either way round; None for all."""
    if paths is None:
        return None
    known = survey.paths.names
    chosen = [name if name in known else name[::-1] for name in map(str, paths)]
    for name in chosen:
        if name not in known:
            raise ValueError(f"path {name[::-1]!r} was asked for, but the scene has {', '.join(known)}; raise "
                             "max_depth for longer ones, or leave it out")
    return chosen


def _survey(integrator, scene, sensor, ping, lead=0.0):
    """Plan the run, and say which pings are meant."""
    try:
        survey = integrator.array_survey(scene, sensor, lead)
    except RuntimeError as error:
        raise as_exception(error) from error
    wanted = [operator.index(one) for one in np.atleast_1d(ping).tolist()]
    for one in wanted:
        if not 0 <= one < survey.track.pings:
            raise ValueError(f"ping {one} was asked for, but the track has {survey.track.pings}, counted from 0")
    if not wanted:
        raise ValueError("no ping was asked for; give at least one number")
    return survey, wanted
