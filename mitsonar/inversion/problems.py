"""Inverse problems that `mitsonar fit` solves by name, with their inputs, options and answers.

A new problem is a function and a line in `PROBLEMS`. Any other name is a scene, whose parameters are fitted.
"""
from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import mitsuba as mi
    import xarray as xr

    from mitsonar.gradients.records.scene_model import SceneModel
    from mitsonar.water import SoundSpeedProfile

    from .fitting.iteration import Method
    from .images.scene_fit import KeyPrior

Options = Mapping[str, Any]        # given options by name, in the units of the command line
Progress = Callable[[float, float], object]


@dataclass(frozen=True, kw_only=True)
class Solved:
    """Answer of a problem."""

    dataset: xr.Dataset  # for a file
    sentences: list[str]  # on the fit, and on what the record determined
    profile: SoundSpeedProfile | None = None  # for a cast


@dataclass(frozen=True, kw_only=True)
class Problem:
    """Problem that has a name."""

    asks: str  # the inputs, as shown in the help
    summary: str
    takes: tuple[str, ...]  # names of options
    solve: Callable[[Sequence[str], Options, Progress], Solved]  # of inputs, options and progress


def image_of(record: str) -> xr.Dataset:
    """Read the image of a file."""
    import xarray as xr

    from mitsonar.io import reading

    image = reading.read(record)
    if not isinstance(image, xr.Dataset):
        raise ValueError(f"{record} holds no image; give an EXR or netCDF file of one")
    return image


def beliefs(texts: Sequence[str], names: Sequence[str]) -> dict[str, float]:
    """Read NAME=DEVIATION texts of the allowed names."""
    from mitsonar.device.spelling import meant

    found: dict[str, float] = {}
    for text in texts:
        name, _, number = text.partition("=")
        if name not in names:
            raise ValueError(f"{text!r} has an unknown name{meant(name, names)}; give NAME=DEVIATION, with NAME one of "
                             f"{', '.join(names)}")
        try:
            deviation = float(number)
        except ValueError:
            deviation = math.nan
        if not (math.isfinite(deviation) and deviation >= 0):
            raise ValueError(f"{text!r} has no deviation of 0 or more; give the standard deviation of {name}, such as "
                             f"{name}=0.01")
        if name in found:
            raise ValueError(f"{name} is given twice; leave one out")
        found[name] = deviation
    return found


def array(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Calibrate an array: the scene with its water and targets, the signals, and NAME=DEVIATION of prior deviations."""
    if len(inputs) < 2:
        raise ValueError("fit array takes a scene with point targets and the signals of its sonar's elements, and then "
                         f"prior deviations, such as rx_position=0.002; got {' '.join(inputs)}")
    import numpy as np
    import xarray as xr

    from mitsonar.io import reading
    from mitsonar.io.scene_files import scenes
    from mitsonar.scene.errors import as_exception
    from mitsonar.scene.loading import load_file
    from mitsonar.verbs.images import opened

    from .arrays.calibration import BELIEVED, calibrated

    path, record, *believed = inputs
    deviations = beliefs(believed, list(BELIEVED))
    path, signals = scenes.find(path), reading.read(record)
    if not isinstance(signals, xr.DataArray):
        raise ValueError(f"{record} holds no signals of elements; give a netCDF file that mitsonar signals writes")
    scene, sensor, integrator = opened(load_file(path, **options.get("parameters", {})), options.get("sensor", 0))
    try:
        survey = integrator.array_survey(scene, sensor, 0)
    except RuntimeError as error:
        raise as_exception(error) from error
    targets = [target.position for target in survey.world.still.targets()]
    if not targets:
        raise ValueError(f"{path} has no point targets; put a point_target at the assumed place of each")
    found = calibrated(signals, np.array(targets, float), sensor.water.profile,
                       transmit=np.mean(survey.transmit.position, axis=0), believed=deviations)
    progress(1, 1)
    return Solved(dataset=found.to_dataset(), sentences=found.sentences())


def sway(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Estimate the sway of a synthetic aperture from raw echoes; the answer is a trajectory to focus with."""
    if len(inputs) != 1:
        raise ValueError("fit sway takes one file of raw echoes, from a part of a strip about as long as its aperture; "
                         f"got {' '.join(inputs) or 'none'}")
    from mitsonar.io.records import raw_echoes

    from .arrays.sharpness import sharpened

    rounds, done = 3, []

    def say(text: str) -> None:
        done.append(text)
        progress(len(done), rounds)

    found = sharpened(raw_echoes.read(inputs[0]), rounds=rounds, say=say)
    return Solved(dataset=found.to_dataset(), sentences=found.sentences())


METHODS = "trust-region", "l-bfgs"
RAYS_PER_BIN = 10                  # in fits to a speckled image: 156 gave no better heights, in five times the time


def solve(what: str, inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Solve the problem of a name, or fit parameters of a scene."""
    problem = PROBLEMS.get(what, SCENE)
    for name in options:
        if name not in problem.takes:
            said = f"the problem {what}" if what in PROBLEMS else "a scene"
            raise ValueError(f"{_flag(name)} is not an option of {said}; leave it out. The options are "
                             f"{', '.join(map(_flag, problem.takes))}")
    return problem.solve(inputs if what in PROBLEMS else [what, *inputs], options, progress)


def _flag(name: str) -> str:
    return "-D" if name == "parameters" else f"--{name.replace('_', '-')}"


# ---- a scene's parameters

def _scene(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Fit the parameters of a scene: the scene, the record, and KEY=DEVIATION of each."""
    if len(inputs) < 3:
        raise ValueError(f"fit takes a scene, a record and one KEY=DEVIATION or more, such as bed.heights=0.5, or "
                         f"one of {', '.join(PROBLEMS)}; got {' '.join(inputs)}")
    from mitsonar.io.scene_files import scenes
    from mitsonar.scene.loading import load_file

    from .fitting.iteration import Stopping
    from .images.scene_fit import fit_scene, vertex_places

    path, record, *keys = inputs
    path = scenes.find(path)
    priors = [_key_prior(text) for text in keys]
    image, plain = image_of(record), Stopping()
    noise = options.get("noise", plain.noise)
    stopping = Stopping(iterations=options.get("iterations", plain.iterations), noise=noise or None)
    given = {name: options[name] for name in ("looks", "length", "model_error", "sensor", "seed", "directions")
             if name in options}
    scene = load_file(path, **options.get("parameters", {}))
    found = fit_scene(scene, image, priors, stopping=stopping, method=_method(options.get("method", METHODS[0])),
                      state_file=options.get("state"), progress=progress, **given)
    dataset, sentences = found.to_dataset(), found.sentences()
    for name, places in vertex_places(scene, found.values).items():
        for axis, direction in enumerate(("east", "north")):
            dataset[f"{name}_{direction}"] = dataset[name].dims, places[:, axis], {"units": "m"}
    if "truth" in options:
        _add_truth(dataset, sentences, options)
    return Solved(dataset=dataset, sentences=sentences)


def _add_truth(dataset: xr.Dataset, sentences: list[str], options: Options) -> None:
    """Add the true parameters of another scene to the answer, and its errors at the start and at the end."""
    import numpy as np

    from mitsonar.io.scene_files import scenes
    from mitsonar.scene.loading import load_file

    from .fitting.answer import TOLD
    from .images.scene_fit import scene_values

    truth = scene_values(load_file(scenes.find(options["truth"]), **options.get("parameters", {})),
                         dataset.attrs["parameters"], sensor=options.get("sensor", 0))
    for name, value in truth.items():
        if value.shape != dataset[name].shape:
            raise ValueError(f"{name} has the shape {value.shape} in {options['truth']}, and {dataset[name].shape} in "
                             "the scene that is fitted; give a truth of the same mesh")
        told = dataset[f"{name}_resolved"].values > TOLD
        which = f"the {int(told.sum())} of {told.size} that the record determined"
        if not told.any():
            told, which = np.ones(told.shape, bool), f"all {told.size}, of which the record determined none"
        dataset[f"{name}_truth"] = dataset[name].dims, value, dict(dataset[name].attrs)
        off = [float(np.sqrt(np.mean((dataset[one].values - value)[told] ** 2))) for one in (f"{name}_start", name)]
        unit = dataset[name].attrs["units"]
        said = f"{off[0]:.3g}{'' if unit == '1' else f' {unit}'} before and is by {off[1]:.3g} now"
        sentences.append(f"{name} was off by {said}, root mean square over {which}")


def _key_prior(text: str) -> KeyPrior:
    """Read KEY=DEVIATION or KEY=DEVIATION:LOWER:UPPER."""
    from .images.scene_fit import KeyPrior

    key, _, rest = text.partition("=")
    try:
        numbers = [float(number) for number in rest.split(":")]
    except ValueError:
        numbers = []
    if not key or len(numbers) not in (1, 3) or any(map(math.isnan, numbers)):
        raise ValueError(f"{text!r} is not KEY=DEVIATION or KEY=DEVIATION:LOWER:UPPER; give the standard deviation of "
                         "the parameter, such as bed.heights=0.5")
    return KeyPrior(key=key, deviation=numbers[0], lower=numbers[1] if len(numbers) > 1 else -math.inf,
                    upper=numbers[2] if len(numbers) > 1 else math.inf)


def _method(name: str) -> Method:
    from .fitting.steps import LBFGS, TrustRegion

    return {"trust-region": TrustRegion, "l-bfgs": LBFGS}[name]()


# ---- heights, maps and poses from a speckled image

def _heights(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Fit the heights of a bed of unknown tilt and level to one image of a sidescan."""
    if len(inputs) != 3:
        raise ValueError(f"fit heights takes a scene, a record, and the bed's id in the scene; got {' '.join(inputs)}")
    from .images.heights import HeightPrior, fit_heights

    key, strength = f"{inputs[2]}.vertex_positions", options.get("strength")
    prior = HeightPrior(**{name: options[name] for name in ("deviation", "length") if name in options})
    model, image = _model(inputs, options, [key] if strength is None else [key, strength])
    return _solved(fit_heights(model, image, key, strength=strength, prior=prior, modes=options.get("directions", 60),
                               **_common(options, progress)))


def _map(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Fit a texture of the bed's strength to one image of a sidescan."""
    if len(inputs) != 3:
        raise ValueError("fit map takes a scene, a record, and the key of a texture in decibels, such as "
                         f"bed.bsdf.mu_db.data; got {' '.join(inputs)}")
    from .images.sediment_map import StrengthPrior, fit_sediment_map

    classes = dict(_class(text) for text in options["class"]) if "class" in options else None
    prior = StrengthPrior() if "deviation" not in options else StrengthPrior(deviation_db=options["deviation"])
    model, image = _model(inputs, options, [inputs[2]])
    return _solved(fit_sediment_map(model, image, inputs[2], classes=classes, prior=prior,
                                    modes=options.get("directions", 20), **_common(options, progress)))


def _class(text: str) -> tuple[str, float]:
    """Read NAME=DB."""
    name, _, level = text.partition("=")
    try:
        return name, float(level)
    except ValueError:
        raise ValueError(f"--class is {text!r}; give NAME=DB, such as sand=-27") from None


def _pose(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Fit the pose of an object: the scene, the record, its id, and NAME=DEVIATION of prior deviations."""
    if len(inputs) < 3:
        raise ValueError("fit pose takes a scene, a record and the object's id in the scene, and then prior "
                         f"deviations, such as east=0.5 yaw=0.3; got {' '.join(inputs)}")
    from mitsonar.gradients.parameters.scene_values import differentiable
    from mitsonar.verbs.images import opened

    from .images.pose import NAMES, PosePrior, fit_pose

    plain, owner = PosePrior(), inputs[2]
    deviation = dict(zip(NAMES, (*plain.place, *plain.angles)))
    deviation |= {"level_db": plain.level_db, "track": 0.0, **beliefs(inputs[3:], [*NAMES, "level_db", "track"])}
    scene, sonar, _ = opened(_scene_of(inputs, options), options.get("sensor", 0))
    track = f"{sonar.id()}.position_offset" if deviation["track"] else None
    key = f"{owner}.{'to_world' if f'{owner}.to_world' in differentiable(scene) else 'vertex_positions'}"
    strengths = [options["strength"]] if "strength" in options else []
    prior = PosePrior(place=(deviation["east"], deviation["north"], deviation["up"]),
                      angles=(deviation["yaw"], deviation["pitch"], deviation["roll"]),
                      level_db=deviation["level_db"], track=deviation["track"] or plain.track)
    model, image = _model(inputs, options, [key, *strengths, *([track] if track else [])], scene)
    return _solved(fit_pose(model, image, key, prior=prior, strengths=strengths, track=track,
                            **_common(options, progress)))


def _scene_of(inputs: Sequence[str], options: Options) -> mi.Scene:
    from mitsonar.io.scene_files import scenes
    from mitsonar.scene.loading import load_file

    return load_file(scenes.find(inputs[0]), **options.get("parameters", {}))


def _model(inputs: Sequence[str], options: Options, keys: Sequence[str],
           scene: mi.Scene | None = None) -> tuple[SceneModel, xr.Dataset]:
    """Return the model of a scene's image, with as many rays as speckle needs, and the image."""
    from mitsonar.verbs.gradients import scene_model

    image, rays = image_of(inputs[1]), None
    if "level" in image and image["level"].ndim == 3:
        rays = RAYS_PER_BIN * math.prod(size for name, size in image["level"].sizes.items() if name != "ping")
    scene = _scene_of(inputs, options) if scene is None else scene
    return scene_model(scene, keys, sensor=options.get("sensor", 0), seed=options.get("seed", 0), rays=rays), image


def _common(options: Options, progress: Progress) -> dict[str, Any]:
    """Return the arguments that all fits to a speckled image share."""
    return {"looks": options.get("looks", 1.0), "farthest": options.get("farthest"),
            "state_file": options.get("state"), "told": progress}


# ---- the sound-speed profile

def _profile(inputs: Sequence[str], options: Options, progress: Progress) -> Solved:
    """Fit a sound-speed profile to lines of soundings; no cast is written if they do not determine it."""
    if not inputs:
        raise ValueError("fit profile takes one line of soundings or more: .nc, .gsf, .kmall, .all, .s7k, .xtf or .hsx")
    from mitsonar.io import casts

    from .profile.profile import fit_lines

    given = {name: options[name] for name in ("nodes", "deviation", "length", "cell", "under_way") if name in options}
    start = casts.read(options["cast"]).profile if "cast" in options else None
    steps = options.get("iterations", 30)
    found = fit_lines(inputs, start, noise=1e-6 * options.get("noise", 20.0), iterations=steps,
                      progress=lambda done, _: progress(done, steps), **given)
    return Solved(dataset=found.to_dataset(), sentences=[f"{found.verdict[0].upper()}{found.verdict[1:]}"],
                  profile=found.profile if "profile" in options else None)


def _solved(found: xr.Dataset) -> Solved:
    return Solved(dataset=found, sentences=[found.attrs["stopped"], *found.attrs["observable"].split("; ")])


SCENE = Problem(asks="SCENE RECORD KEY=DEVIATION[:LOWER:UPPER] ...", summary="parameters of a scene, from an image",
                takes=("looks", "length", "model_error", "sensor", "seed", "iterations", "noise", "method",
                       "directions", "state", "truth", "parameters"), solve=_scene)

PROBLEMS = {
    "heights": Problem(asks="SCENE RECORD ID", summary="the heights of a bed of unknown tilt, from a sidescan's image",
                       takes=("looks", "length", "deviation", "farthest", "strength", "sensor", "seed", "directions",
                              "state", "parameters"), solve=_heights),
    "map": Problem(asks="SCENE RECORD KEY", summary="a texture of the bed's strength, from a sidescan's image",
                   takes=("looks", "class", "deviation", "farthest", "sensor", "seed", "directions", "state",
                          "parameters"),
                   solve=_map),
    "pose": Problem(asks="SCENE RECORD ID [NAME=DEVIATION ...]", summary="the position and attitude of an object, "
                    "from an image of it", takes=("looks", "farthest", "strength", "sensor", "seed", "state",
                                                         "parameters"), solve=_pose),
    "profile": Problem(asks="LINE ...", summary="the sound-speed profile, from lines of soundings that overlap or "
                       "cross; or why they do not determine it", takes=("cast", "nodes", "noise", "deviation", "length",
                                                                   "cell", "under_way", "iterations", "profile"),
                       solve=_profile),
    "array": Problem(asks="SCENE SIGNALS [NAME=DEVIATION ...]", summary="an array's elements and navigation, from "
                     "echoes of the scene's point targets", takes=("sensor", "parameters"), solve=array),
    "sway": Problem(asks="ECHOES", summary="sway of a synthetic aperture, from the sharpness of its image", takes=(),
                    solve=sway),
}
