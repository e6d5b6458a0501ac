"""Load a scene file as mitsonar means it: variant set, ids kept, parameters filled in."""
from __future__ import annotations

import functools
import os
import re
import threading
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import mitsuba as mi

from mitsonar.device.files import FilePath, check_readable
from mitsonar.device.sentences import shortened
from mitsonar.device.spelling import meant
from mitsonar.io.scene_files.scenes import filled, find, root, text

from . import files as scene_files, libraries
from .alterations import held

VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")    # the GPU comes second until it has been tried on one
TAKEN = ("path", "parallel", "optimize")       # arguments of Mitsuba's own loader
_LOADING = threading.RLock()       # the folder in which files are looked for is Mitsuba's, one for all threads


def prepare() -> None:
    """Set a JIT variant if none is set: LLVM on all cores, or CUDA where there is a GPU but no libLLVM."""
    import drjit as dr

    from mitsonar import plugins
    from mitsonar.device import llvm

    with plugins.LOCK:                         # of several threads, the first prepares and the others wait
        plugins.install()                      # Mitsuba can be seen before its first import has come to that
        if (mi.variant() or "scalar").startswith("scalar"):
            llvm.check()
            mi.set_variant(*(VARIANTS if dr.has_backend(dr.JitBackend.LLVM) else VARIANTS[1:]))
        if (variant := mi.variant()) is not None:
            plugins.register(variant)          # another thread may have set the variant just now
        if dr.thread_count() < 2:
            dr.set_thread_count(2)             # with one worker Mitsuba's file readers wait for themselves for ever
    mitsuba: Any = mi                              # whose declarations know no resolver of files
    libraries.check_folders(mitsuba.file_resolver())


def load_file(path: FilePath, /, **parameters: object) -> mi.Scene:
    """Load a scene file.

    Parameters
    ----------
    path : str or path
        Mitsuba XML, or the name of a scene that comes with mitsonar, such as ``sidescan_flat``.
    **parameters
        Values for the scene's ``$parameters``: numbers, strings, true or false, paths, or lists of these.

    Returns
    -------
    mitsuba.Scene

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    PermissionError
        If it may not be read.
    ValueError
        If the scene, a file that it names or a parameter is wrong; names file, line and attribute.
    TypeError
        If a parameter's value is of a kind that cannot be written in XML.

    Notes
    -----
    Meshes stay apart even if they share a material (``optimize=False``), because their ids are the labels of the image.
    What the scene names is checked before Mitsuba opens it (`scene_files`), which ``mi.load_file`` does not do.
    """
    path = find(os.fspath(path))
    check_readable(path, "the scene", "a Mitsuba XML file")
    values = {name: text(name, value) for name, value in parameters.items()}
    for name in TAKEN:
        if name in values:
            raise ValueError(f"a scene's parameter cannot be called {name}, which means something to Mitsuba's loader; "
                             "rename it in the scene")
    prepare()
    _first_scene()
    from .errors import as_exception

    try:
        with _LOADING:
            scene_files.check(path, values)
            # one after the other: a shape of ours that waits for the device while it is made lets Mitsuba's worker make
            # the next one meanwhile, within it, and hundreds of them end in a RecursionError; it is as fast
            scene = mi.load_file(path, optimize=False, parallel=False, **values)
    except (RuntimeError, UnicodeDecodeError) as error:
        raise _naming_parameters(as_exception(error), path) from None
    if not isinstance(scene, mi.Scene):
        raise ValueError(f"{path} holds no scene but a single object; put it into <scene version=\"3.0.0\">")
    values_now = held(scene)
    provenance = {"file": os.path.basename(path), "scene": resolved(path, values), "parameters": values}
    for sensor in scene.sensors():
        if getattr(sensor, "kind", None):                # a sonar, no camera
            sensor.provenance, sensor.loaded, sensor.path = provenance, values_now, path
    return scene


def resolved(path: FilePath, parameters: Mapping[str, str]) -> str:
    """Text of a scene file with its parameters filled in, so that it renders the same beside the original."""
    top, values = root(path), dict(parameters)
    elements = list(top.iter())                    # in the order of the document, which is that of Mitsuba's reader
    for element in elements:
        for key, template in element.attrib.items():
            element.set(key, filled(template, values))
        if element.tag == "default":
            # the first one, or who loads it, wins
            values.setdefault(element.get("name", ""), element.get("value", ""))
    for element in elements:
        for default in element.findall("default"):
            element.remove(default)
    if top.find(".//include") is not None:
        top[:0] = [ElementTree.Element("default", name=name, value=value) for name, value in values.items()]
    return ElementTree.tostring(top, encoding="unicode")


@functools.cache
def _first_scene():
    """Load nothing, alone: with the first scene Mitsuba makes its Embree device, and two of them with two at once."""
    from mitsonar import plugins

    with plugins.LOCK:
        mi.load_dict({"type": "scene"})


def _naming_parameters(error, path):
    """The same error; where it is about an unknown parameter, with the names of the known ones."""
    said = re.search("the scene has no parameter ([^;]*);", str(error))
    if said is None:
        return error
    names = sorted({element.get("name", "") for element in root(path).iter("default")})
    unused = [name for name in said[1].split(", ") if name in names]
    if unused:
        name = unused[0]
        return ValueError(f'{path}: no attribute takes the parameter {name}, which has a <default> there; write '
                          f'value="${name}" into the attribute that it is for, or set other parameters')
    return ValueError(shortened(f"{path}: {str(error).replace(';', f'{meant(said[1], names)};', 1)} Known: "
                                f"{', '.join(names) or 'none'}."))
