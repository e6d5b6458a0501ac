"""Scene files as text: found by name, parsed, their ``$parameters`` filled in as Mitsuba does it."""
import numbers
import os
from collections.abc import Mapping
from importlib import resources
from xml.etree import ElementTree
from xml.parsers import expat

from mitsonar.device import files
from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant

__all__ = ["check", "filled", "find", "place", "root", "shipped", "text"]

LARGEST = 100_000_000              # bytes
DEEPEST = 200                      # elements within elements; Mitsuba's reader calls itself for each
MOST_INCLUDED = 1000               # files


def find(name: str) -> str:
    """Find a scene: a file, or a scene of mitsonar by its name.

    Parameters
    ----------
    name : str
        Path of a file, or a name such as ``sidescan_flat``.

    Returns
    -------
    str

    Raises
    ------
    FileNotFoundError
        If neither exists; lists the scenes of mitsonar.
    """
    if os.path.isfile(name):
        return name
    if os.path.dirname(name) == "":
        ours = resources.files("mitsonar.scenes") / (name if name.endswith(".xml") else f"{name}.xml")
        if ours.is_file():                             # also where a sweep has made a folder of that name
            return str(ours)
    if os.path.exists(name):
        return name
    known = shipped()
    raise FileNotFoundError(f"scene {name} does not exist{meant(os.path.splitext(name)[0], known)}; give the path of a "
                            f"Mitsuba XML file or one of: {', '.join(known)}")


def shipped() -> list[str]:
    """Return the sorted names of the scenes that mitsonar includes."""
    return sorted(os.path.splitext(entry.name)[0] for entry in resources.files("mitsonar.scenes").iterdir()
                  if entry.name.endswith(".xml"))


def root(path: FilePath) -> ElementTree.Element:
    """Parse a scene file and return its outermost element.

    Raises
    ------
    FileNotFoundError, PermissionError
        If the file does not exist, or may not be read.
    ValueError
        If it is no ordinary file, too large, or no XML.
    """
    files.check_readable(path, "the scene", "a Mitsuba XML file")
    if os.path.getsize(path) > LARGEST:
        raise ValueError(f"the scene {path} has {os.path.getsize(path):,} bytes; give at most {LARGEST:,}")
    try:
        return ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        if what := files.described(path):
            raise ValueError(f"{path} is {what}, not a scene; give a Mitsuba XML file") from None
        what = str(error).partition(": line ")[0]
        raise ValueError(f"{path}, line {error.position[0]}: the XML is broken: {what}") from None


def place(path: FilePath, tag: str, name: str) -> str:
    """Return the file and the line that set an attribute of a kind of element, such as ``bins`` of a ``film``.

    The line is left out if several lines write it, or none does, as with an included file.
    """
    parser, within, lines = expat.ParserCreate(), [], []

    def start(element: str, attributes: dict[str, str]) -> None:
        if tag in within[-1:] and attributes.get("name") == name:
            lines.append(parser.CurrentLineNumber)
        within.append(element)

    parser.StartElementHandler, parser.EndElementHandler = start, lambda _: within.pop()
    try:
        with open(path, "rb") as file:
            parser.ParseFile(file)
    except (OSError, expat.ExpatError):                # changed since it was loaded
        pass
    return f"{os.fspath(path)}, line {lines[0]}" if len(lines) == 1 else os.fspath(path)


def check(path: str, values: Mapping[str, str]) -> list[str]:
    """Check all files that are opened while a scene is parsed: itself, what it includes, and spectra.

    Parameters
    ----------
    path : str
    values : dict of str to str
        Values of its parameters.

    Returns
    -------
    list of str
        The folders in which the scene's files are looked for: those of ``<path>``, the last one first, and its own.

    Raises
    ------
    FileNotFoundError, PermissionError, ValueError
        As `root`, for any of these files, or if elements are nested too deep for Mitsuba's reader. Missing files are
        left to Mitsuba, which reports where they are named.
    """
    known, folders, seen = dict(values), [os.path.dirname(path)], set()

    def walk(file):
        if file in seen:
            return
        seen.add(file)
        if len(seen) > MOST_INCLUDED:
            raise ValueError(f"{path}: it includes more than {MOST_INCLUDED} files")
        waiting = [(root(file), 1)]                # in the order of the document, which is that of Mitsuba's reader
        while waiting:
            element, depth = waiting.pop()
            if depth > DEEPEST:
                raise ValueError(f"{file}: more than {DEEPEST} elements are nested in one another; flatten them")
            waiting += [(child, depth + 1) for child in reversed(element)]
            if element.tag == "default":
                known.setdefault(element.get("name", ""), filled(element.get("value", ""), known))
            elif element.tag == "path":
                value = filled(element.get("value", ""), known)
                folders.insert(0, next((found for folder in (os.path.dirname(file), *folders, "")
                                        if os.path.exists(found := os.path.join(folder, value))), value))
            elif template := element.get("filename"):
                name = filled(template, known)
                beside = [os.path.dirname(file)] if element.tag == "include" else []
                found = next((found for folder in (*beside, *folders, "")
                              if os.path.exists(found := os.path.join(folder, name))), None)
                if found and element.tag == "include":
                    walk(found)
                elif found:
                    files.check_readable(found, f"what <{element.tag}> names,")

    walk(path)
    return folders


def filled(template: str, values: Mapping[str, str]) -> str:
    """Return an attribute's text with its ``$names`` replaced, longest first: $rays must not eat the start of
    $rays_far.

    Parameters
    ----------
    template : str
    values : dict of str to str
    """
    if "$" not in template:
        return template
    for name in sorted(filter(None, values), key=len, reverse=True):
        # a dollar behind a backslash is no parameter, and both stay for Mitsuba to read
        parts = template.replace(r"\$", "\0").split(f"${name}")
        template = values[name].join(parts).replace("\0", r"\$")
    return template


def text(name: str, value: object) -> str:
    """Return the text of a parameter's value in XML.

    Parameters
    ----------
    name : str
        Name of the parameter.
    value : number, str, bool, path, or a list of these

    Returns
    -------
    str

    Raises
    ------
    TypeError
        If the value is of another kind.
    """
    import numpy as np  # a tenth of a second, which help and completion do without

    if isinstance(value, (bool, np.bool_)):
        return "true" if value else "false"
    if isinstance(value, (str, numbers.Real)):
        return str(value)
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, (list, tuple, np.ndarray)):
        return ", ".join(text(name, item) for item in value)
    raise TypeError(f"the parameter {name} is {value!r}; give a number, a string, true or false, a path, or a list of "
                    "these")
