"""Scene in, image out: the verb `render`."""
import importlib.metadata
import operator
import os

import mitsuba as mi

from . import __version__
from .alterations import altered
from .io.records import SonarImage
from .plugins.errors import as_exception
from .scene import load_file, prepare

__all__ = ["checked_seed", "opened", "provenance", "render"]

SEEDS = 1 << 32                    # what Mitsuba takes, and what tells rays apart


def render(scene, seed=0, *, sensor=0, progress=None, say=None):
    """Render a sonar scene.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        As `mitsonar.load_file` or `mi.load_file` give it, or what `mitsonar.load_file` takes.
    seed : int
        Of everything random: ray directions, speckle, noise. The same scene and seed give the same bytes.
        From 0 to 4294967295.
    sensor : int
        Which of the scene's sensors.
    progress : callable(done, total) or None
        Told the number of pings done, block by block; of arrays with parts of a ping.
    say : callable(text) or None
        Of arrays: told in a sentence, before work of more than a moment begins, how much there is, how long it will
        take, and what would be faster.

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
        If `scene` is neither a file's name nor a scene of the present variant, or `seed` or `sensor` no whole number.
    """
    seed = checked_seed(seed)
    scene, sensor, integrator = opened(scene, sensor)
    try:
        image = integrator.dataset(scene, sensor, seed, progress, say)
    except RuntimeError as error:
        raise as_exception(error) from error
    return SonarImage.of(image.assign_attrs(provenance(scene, sensor)))


def opened(scene, sensor=0):
    """Give a scene (loaded if it is a path), the sensor of that number, and an integrator that renders sound.

    Raises
    ------
    ValueError, TypeError, FileNotFoundError
        As `render`.
    """
    sensor = operator.index(sensor)
    prepare()
    if not isinstance(scene, mi.Scene):
        if not isinstance(scene, (str, os.PathLike)):
            raise TypeError(f"a scene of the variant {mi.variant()} or the path of a file was wanted, got a "
                            f"{type(scene).__name__}; load the scene after mi.set_variant")
        scene = load_file(scene)
    sensors, integrator = scene.sensors(), scene.integrator()
    if not sensors:
        raise ValueError("the scene has no sensor; write <sensor type=\"sidescan\"> ... </sensor>")
    if not 0 <= sensor < len(sensors):
        raise ValueError(f"sensor {sensor} was asked for, but the scene has {len(sensors)}, counted from 0")
    if not hasattr(integrator, "dataset"):
        raise ValueError("the scene's integrator cannot render sound; write <integrator type=\"sonar_path\"/>")
    return scene, sensors[sensor], integrator


def checked_seed(seed):
    """Give a seed as a number, or refuse it."""
    number = operator.index(seed)
    if not 0 <= number < SEEDS:
        raise ValueError(f"seed is {number}; give a whole number from 0 to {SEEDS - 1}")
    return number


def provenance(scene, sensor):
    """Where a result comes from: scene, parameters, versions, origin."""
    bed = next((shape for shape in scene.shapes() if getattr(shape, "local_origin", None) is not None), None)
    # without a surveyed seabed, the track's latitudes and longitudes say where the scene lies
    frame = getattr(getattr(sensor, "platform", None), "frame", None)
    origin, crs = (None, None) if frame is None else (frame.origin, frame.crs)
    if bed is not None:
        origin, crs = bed.local_origin, getattr(bed, "crs", None)
    known = getattr(sensor, "provenance", None) or {"file": None, "scene": None, "parameters": {}}
    loaded = getattr(sensor, "loaded", None)
    versions = {name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "numpy")}
    way = getattr(getattr(sensor, "platform", None), "way", None)
    sailed = {} if way is None else {"course_sailed": way[0], "course_planned": way[1]}
    return {**known, **sailed, "altered": None if loaded is None else altered(scene, loaded),
            "versions": {"mitsonar": __version__, **versions},
            "local_origin": None if origin is None else [float(v) for v in origin], "crs": crs}
