"""Load a scene file as mitsonar means it: variant set, ids kept, parameters filled in."""
import os
from xml.etree import ElementTree

import mitsuba as mi

__all__ = ["VARIANTS", "load_file", "prepare"]

VARIANTS = ("cuda_ad_mono", "llvm_ad_mono")


def prepare():
    """Set a JIT variant if none is set: CUDA where there is a GPU, else LLVM on all cores.

    Raises
    ------
    BackendError
        If neither can be used; says what to install.
    """
    import drjit as dr

    from . import llvm

    if mi.variant() is None or mi.variant().startswith("scalar"):
        cuda = dr.has_backend(dr.JitBackend.CUDA)
        if not cuda:
            llvm.check()
        mi.set_variant(*(VARIANTS if cuda else VARIANTS[1:]))
    if dr.thread_count() < 2:
        dr.set_thread_count(2)                 # with one worker Mitsuba's file readers wait for themselves for ever


def load_file(path, **parameters):
    """Load a scene file.

    Parameters
    ----------
    path : str or path
        Mitsuba XML.
    **parameters
        Values for the scene's ``$parameters``: numbers and strings.

    Returns
    -------
    mitsuba.Scene

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the scene or a parameter is wrong; names file, line and attribute.

    Notes
    -----
    Meshes stay apart even if they share a material (``optimize=False``), because their ids are the labels of the image.
    """
    path = os.fspath(path)
    if not os.path.isfile(path):
        raise FileNotFoundError(f"scene file {path} does not exist; give the path of a Mitsuba XML file")
    prepare()
    from .plugins.errors import plain

    try:
        scene = mi.load_file(path, optimize=False, **{name: _text(value) for name, value in parameters.items()})
    except RuntimeError as error:
        raise ValueError(plain(error)) from None
    for sensor in scene.sensors():
        if hasattr(sensor, "provenance"):
            sensor.provenance = {"file": os.path.basename(path), "scene": resolved(path, parameters),
                                 "parameters": {name: _text(value) for name, value in parameters.items()}}
    return scene


def resolved(path, parameters):
    """Text of a scene file with its ``<default>``s and parameters filled in, included files left as they are."""
    tree = ElementTree.parse(path)
    root = tree.getroot()
    values = {}
    for element in root.findall("default"):
        values[element.get("name")] = element.get("value")
        root.remove(element)
    values.update({name: str(_text(value)) for name, value in parameters.items()})
    # longest names first: $rays must not eat the start of $rays_far
    names = sorted(values, key=len, reverse=True)
    for element in root.iter():
        for key, text in element.attrib.items():
            for name in names:
                text = text.replace(f"${name}", values[name])
            element.set(key, text)
    return ElementTree.tostring(root, encoding="unicode")


def _text(value):
    return value if isinstance(value, (int, float, str)) and not isinstance(value, bool) else str(value).lower()
