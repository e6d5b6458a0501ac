"""Scene files as text: found by name, parsed, their ``$parameters`` filled in as Mitsuba does it."""
import numbers
import os
from importlib.resources import files
from xml.etree import ElementTree

import numpy as np

__all__ = ["filled", "find", "root", "text"]


def find(name):
    """Find a scene: a file, or one that comes with mitsonar by its name.

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
        If there is neither; lists the scenes that come with mitsonar.
    """
    if os.path.isfile(name):
        return name
    if os.path.dirname(name) == "":
        shipped = files("mitsonar.scenes") / (name if name.endswith(".xml") else f"{name}.xml")
        if shipped.is_file():                          # also where a sweep has made a folder of that name
            return str(shipped)
    if os.path.exists(name):
        return name
    known = ", ".join(sorted(os.path.splitext(entry.name)[0] for entry in files("mitsonar.scenes").iterdir()
                             if entry.name.endswith(".xml")))
    raise FileNotFoundError(f"scene {name} does not exist; give the path of a Mitsuba XML file or one of: {known}")


def root(path):
    """Parse a scene file and give its outermost element.

    Raises
    ------
    ValueError
        If the file is no XML.
    """
    try:
        return ElementTree.parse(path).getroot()
    except ElementTree.ParseError as error:
        raise ValueError(f"{path}: the XML is broken: {error}") from None


def filled(template, values):
    """Give an attribute's text with its ``$names`` replaced, longest first: $rays must not eat the start of $rays_far.

    Parameters
    ----------
    template : str
    values : dict of str to str
    """
    for name in sorted(values, key=len, reverse=True):
        # a dollar behind a backslash is no parameter, and both stay for Mitsuba to read
        parts = template.replace(r"\$", "\0").split(f"${name}")
        template = values[name].join(parts).replace("\0", r"\$")
    return template


def text(name, value):
    """Write a parameter's value as XML has it.

    Parameters
    ----------
    name : str
        Of the parameter.
    value : number, str, bool, path, or a list of these

    Returns
    -------
    str

    Raises
    ------
    TypeError
        If the value is of another kind.
    """
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
