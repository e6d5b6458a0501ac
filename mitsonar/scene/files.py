"""Checks of the files that a scene names, before Mitsuba opens them.

Mitsuba's readers trust their files: a mesh face that names a missing vertex is read and written outside memory, and a
picture gets as much memory as its header claims. The scene is therefore parsed first, by Mitsuba's own parser, with
parameters filled in and included files followed; each file that an object names is checked here before any object is
made. The scene's plugins are compared with those that may run (`libraries`).
"""
import os
import re
from collections.abc import Mapping
from typing import Any
from xml.etree import ElementTree

import mitsuba as mi

from mitsonar.device import files
from mitsonar.io.scene_files import meshes, pictures, scenes

from . import labels, libraries

MESHES = ("ply", "obj", "serialized", "linearcurve", "bsplinecurve")
PICTURES, VOLUMES = ("bitmap", "envmap"), ("gridvolume", "sdfgrid")
# their readers take memory, or write outside of it, as the file says; none of these plugins is useful for sound
REFUSED = ("ellipsoids", "ellipsoidsmesh", "measured", "measured_polarized")
MOST_WAYS = 100_000
TAKEN = ("config", "filename")     # argument names of Mitsuba's parser


def check(path: str, values: Mapping[str, str]) -> None:
    """Check every plugin and every file that a scene names; missing files are left to the readers."""
    folders = scenes.check(path, values)
    mitsuba: Any = mi                              # its type stubs lack file_resolver
    former = mitsuba.file_resolver()
    resolver = mitsuba.FileResolver(former)
    resolver.prepend(os.path.dirname(path))
    if set(TAKEN) & set(values):                   # Mitsuba forgets the folders of <path> within an include
        for folder in reversed(folders):
            resolver.prepend(folder)
    mitsuba.set_file_resolver(resolver)
    try:
        state = _parsed(path, values)
    finally:
        mitsuba.set_file_resolver(former)
    libraries.check_folders(resolver)
    for node in state.nodes:
        try:
            libraries.check_type(node.props.plugin_name())
        except ValueError as error:
            raise ValueError(f"{_place_or(state, node, path)}: {error}.") from None
    _check_ways(state, path)
    for index, node in enumerate(state.nodes):
        kind = node.props.plugin_name()
        if kind == "bitmap" and not any(name in node.props for name in ("filename", "bitmap", "data")):
            # Mitsuba 3.9 ends the process on such a bitmap
            raise ValueError(f'{path}: the bitmap "{_name(state, index)}" has no filename; write <string '
                             'name="filename" value="..."/> into it')
        try:
            _check_node(node, resolver)
        except (ValueError, OSError) as error:
            raise ValueError(f"{_place_or(state, node, path)}: {kind}: {str(error).rstrip('.')}.") from None


def _parsed(path, values):
    config = mi.parser.ParserConfig(mi.variant() or "")
    if not set(TAKEN) & set(values):
        return mi.parser.parse_file(config, path, **values)
    wrapper = ElementTree.Element("scene", version="3.0.0")
    wrapper.extend(ElementTree.Element("default", name=name, value=value) for name, value in values.items()
                   if name in TAKEN)
    ElementTree.SubElement(wrapper, "include", filename=os.path.abspath(path))
    others = {name: value for name, value in values.items() if name not in TAKEN}
    return mi.parser.parse_string(config, ElementTree.tostring(wrapper, encoding="unicode"), **others)


def _check_node(node, resolver):
    props, kind = node.props, node.props.plugin_name()
    if node.type == mi.ObjectType.Shape:
        labels.check_name(props.id())
    # Mitsuba reads a radius of -1 as a ball turned inside out
    if "radius" in props and props.type("radius").name in ("Float", "Integer") and props["radius"] < 0:
        raise ValueError(f"radius is {props['radius']:g}; expected a number [m] above 0")
    if "filename" not in props or props.type("filename").name != "String":
        return
    path = str(resolver.resolve(props["filename"]))
    if kind in REFUSED:
        raise ValueError(f"{kind} cannot be used here: Mitsuba's reader of its files is not safe; remove the object")
    if not props["filename"] or not os.path.exists(path):
        return
    if kind in MESHES:
        index = props["shape_index"] if "shape_index" in props else 0
        meshes.check(path, kind, index if isinstance(index, int) else 0)
    elif kind in PICTURES:
        pictures.check(path)
    elif kind in VOLUMES:
        pictures.check_volume(path)
    else:
        files.check_readable(path)


def _check_ways(state, path):
    """Refuse objects reached in too many ways: Mitsuba takes memory for each way down, and visits each."""
    places = {node.props.id(): index for index, node in enumerate(state.nodes) if node.props.id()}
    ways: dict[int, int] = {}
    waiting: list[tuple[int, list[int] | None]] = [(0, None)]
    while waiting:
        index, held = waiting.pop()
        if index in ways:
            continue
        if held is None:
            props = state.nodes[index].props
            kinds = [(props.type(name).name, name) for name in props.keys()]
            held = [props[name].index() for kind, name in kinds if kind == "ResolvedReference"]
            held += [places[props[name].id()] for kind, name in kinds
                     if kind == "Reference" and props[name].id() in places]
            waiting += [(index, held), *((other, None) for other in held if other not in ways)]
            if len(waiting) > MOST_WAYS:
                raise ValueError(f"{path}: objects refer to one another in a circle, or more than {MOST_WAYS} times")
        else:
            ways[index] = 1 + sum(ways.get(other, 0) for other in held)
            if index and ways[index] > MOST_WAYS:
                raise ValueError(f"{_place(state, state.nodes[index])}: {state.nodes[index].props.plugin_name()}: it "
                                 f"holds other objects in more than {MOST_WAYS} ways, each of which is computed by "
                                 "itself; simplify it.")


def _name(state, index):
    """Return an object's id, or its name in the object that holds it."""
    if state.nodes[index].props.id():
        return state.nodes[index].props.id()
    for node in state.nodes:
        for name in node.props.keys():
            if node.props.type(name).name == "ResolvedReference" and node.props[name].index() == index:
                return "" if name.startswith("_arg_") else name
    return ""


def _place_or(state, node, path):
    """Return the place of an object in its file, or the path if Mitsuba has parsed the scene from a string."""
    return _place(state, node) if len(state.files) and state.files[0] != "<string>" else path


def _place(state, node):
    match = re.fullmatch(r"(.*) \(line (\d+), col \d+\)(?: \[.*\])?", mi.parser.file_location(state, node), re.DOTALL)
    return f"{match[1]}, line {match[2]}" if match else "the scene"
