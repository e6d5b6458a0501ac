"""Scene in, image out: the verb `render`."""
import importlib.metadata

import mitsuba as mi

from . import __version__
from .plugins.errors import plain
from .scene import load_file, prepare

__all__ = ["render"]


def render(scene, seed=0, *, sensor=0, progress=None):
    """Render a sonar scene.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        As `mitsonar.load_file` or `mi.load_file` give it, or the name of its file.
    seed : int
        Of everything random: ray directions, speckle, noise. The same scene and seed give the same bytes.
    sensor : int
        Which of the scene's sensors.
    progress : callable(done, total) or None
        Told the number of pings done, block by block.

    Returns
    -------
    xarray.Dataset
        For a sidescan over (ping, side, range): ``level`` [dB re 1 µPa], ``mean_level``, and ground truth from the same rays
        (``label``, ``depth``, ``shadow``, ``rays``); axes, units, resolved scene and versions in coordinates and attributes.

    Raises
    ------
    ValueError
        If scene, sensor and integrator do not make a sonar survey.
    """
    if not isinstance(scene, mi.Scene if mi.variant() else ()):
        scene = load_file(scene)
    prepare()
    sensors, integrator = scene.sensors(), scene.integrator()
    if not 0 <= sensor < len(sensors):
        raise ValueError(f"sensor {sensor} was asked for, but the scene has {len(sensors)}; give it a <sensor type=\"sidescan\">")
    if not hasattr(integrator, "dataset"):
        raise ValueError("the scene's integrator cannot render sound; write <integrator type=\"sonar_path\"/>")
    try:
        image = integrator.dataset(scene, sensors[sensor], seed, progress)
    except RuntimeError as error:
        raise ValueError(plain(error)) from error
    image.attrs.update(_provenance(scene, sensors[sensor]))
    return image


def _provenance(scene, sensor):
    bed = next((shape for shape in scene.shapes() if getattr(shape, "local_origin", None) is not None), None)
    known = getattr(sensor, "provenance", None) or {"file": None, "scene": None, "parameters": {}}
    versions = {"mitsonar": __version__, **{name: importlib.metadata.version(name) for name in ("mitsuba", "drjit", "numpy")}}
    return {**known, "versions": versions,
            "local_origin": None if bed is None else [float(v) for v in bed.local_origin],
            "crs": None if bed is None else getattr(bed, "crs", None)}
