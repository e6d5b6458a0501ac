"""Load a scene file for mitsonar: variant set, shape ids kept, parameters filled in."""
from __future__ import annotations

import functools
import os
import re
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import mitsuba as mi

from mitsonar.device.files import FilePath, check_readable
from mitsonar.device.lazy import end_start
from mitsonar.device.machine import cores
from mitsonar.device.sentences import shortened
from mitsonar.device.spelling import meant
from mitsonar.device.turns import TURN, at_least_two_threads
from mitsonar.io.scene_files.scenes import filled, find, root, text

from . import files as scene_files, libraries, registration
from .alterations import held
from .protocols import SceneSonar
from .queries.height_field import without_trees

VARIANTS = ("llvm_ad_mono", "cuda_ad_mono")    # the GPU comes second until it has been tried on one
TAKEN = ("path", "parallel", "optimize")       # argument names of Mitsuba's own loader


def prepare() -> None:
    """Set a JIT variant if none is set: LLVM on all cores, or CUDA if there is a GPU but no libLLVM."""
    import drjit as dr

    from mitsonar.device import llvm

    TURN.check()
    with registration.LOCK:                    # of several threads, the first prepares and the others wait
        registration.install()                 # Mitsuba is visible before its first import has called this
        if (mi.variant() or "scalar").startswith("scalar"):
            llvm.check()
            mi.set_variant(*(VARIANTS if dr.has_backend(dr.JitBackend.LLVM) else VARIANTS[1:]))
        if (variant := mi.variant()) is not None:
            registration.register(variant)     # another thread may have set the variant just now
        _enough_threads()
    mitsuba: Any = mi                              # its type stubs lack file_resolver
    libraries.check_folders(mitsuba.file_resolver())


@functools.cache
def _enough_threads():
    """Set the threads of Dr.Jit, once, to no more than cores and no less than two, which Mitsuba's loader needs."""
    import drjit as dr

    # a container may use fewer cores than the machine has, and threads that look for work use up its time
    dr.set_thread_count(max(min(dr.thread_count(), cores()), 2))


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
        If the file may not be read.
    ValueError
        If the scene, a file that it names or a parameter is wrong. The message names file, line and attribute.
    TypeError
        If the value of a parameter cannot be written in XML.

    Notes
    -----
    Meshes stay apart even if they share a material (``optimize=False``), because their ids are the labels of the image.
    Files that the scene names are checked before Mitsuba opens them, which ``mi.load_file`` does not do.
    """
    return _loaded(path, parameters)


def load_for_sonar(path: FilePath, /, **parameters: object) -> mi.Scene:
    """Load a scene file as `load_file` does, for mitsonar alone: rays of Mitsuba's own pass large beds, without a tree.

    A tree over a million triangles takes half a second to build, and mitsonar's rays walk over such a bed without it,
    two or three times as fast.
    """
    with TURN, without_trees() as beds:
        scene = _loaded(path, parameters)
    end_start()
    shapes = scene.shapes()
    # a bed within another object, such as a group, is found by its tree only
    return scene if all(any(shape is bed for shape in shapes) for bed in beds) else load_file(path, **parameters)


def _loaded(path, parameters):
    """Return the scene of a file and parameters, checked."""
    path = find(os.fspath(path))
    check_readable(path, "the scene", "a Mitsuba XML file")
    values = {name: text(name, value) for name, value in parameters.items()}
    for name in TAKEN:
        if name in values:
            raise ValueError(f"a scene's parameter cannot be called {name}, a name that Mitsuba's loader uses "
                             "itself; rename the parameter in the scene")
    prepare()
    _first_scene()
    from .errors import as_exception

    try:
        with TURN, at_least_two_threads():     # Mitsuba's file resolver is one for all threads, too
            scene_files.check(path, values)
            # One object after the other: while a shape of ours waits for the device, Mitsuba's worker would make the
            # next one within it, and hundreds of them end in a RecursionError. This is as fast.
            scene = mi.load_file(path, optimize=False, parallel=False, **values)
    except (RuntimeError, UnicodeDecodeError) as error:
        raise _naming_parameters(as_exception(error), path) from None
    if not isinstance(scene, mi.Scene):
        raise ValueError(f"{path} holds no scene but a single object; put it into <scene version=\"3.0.0\">")
    values_now = held(scene)
    provenance = {"file": os.path.basename(path), "scene": resolved(path, values), "parameters": values}
    for sensor in scene.sensors():
        if isinstance(sensor, SceneSonar):
            sensor.provenance, sensor.loaded, sensor.path = provenance, values_now, path
    return scene


def resolved(path: FilePath, parameters: Mapping[str, str]) -> str:
    """Return the text of a scene file with its parameters filled in, which renders the same beside the original."""
    top, values = root(path), dict(parameters)
    elements = list(top.iter())                    # in document order, the order of Mitsuba's reader
    for element in elements:
        for key, template in element.attrib.items():
            element.set(key, filled(template, values))
        if element.tag == "default":
            # the caller's value wins, then the first default
            values.setdefault(element.get("name", ""), element.get("value", ""))
    for element in elements:
        for default in element.findall("default"):
            element.remove(default)
    if top.find(".//include") is not None:
        top[:0] = [ElementTree.Element("default", name=name, value=value) for name, value in values.items()]
    return ElementTree.tostring(top, encoding="unicode")


@functools.cache
def _first_scene():
    """Load an empty scene alone: the first one makes Mitsuba's Embree device, and two threads would make two."""
    with registration.LOCK:
        mi.load_dict({"type": "scene"})


def _naming_parameters(error, path):
    """Return the error, with the known parameters named if it is about an unknown one."""
    match = re.search("the scene has no parameter ([^;]*);", str(error))
    if match is None:
        return error
    names = sorted({element.get("name", "") for element in root(path).iter("default")})
    unused = [name for name in match[1].split(", ") if name in names]
    if unused:
        return ValueError(f'{path}: the parameter {unused[0]} has a <default> there, but no attribute uses it; write '
                          f'value="${unused[0]}" into the attribute that it is for, or set other parameters')
    return ValueError(shortened(f"{path}: {str(error).replace(';', f'{meant(match[1], names)};', 1)} Known: "
                                f"{', '.join(names) or 'none'}."))
