"""Statements about the meshes of a folder, in a file ``meshes.toml`` beside them.

    licence = "CC-BY-4.0"        # of all meshes in the folder, like any other key here
    author = "A. Maker"
    unit = "mm"

    [manta]                      # manta.ply or manta.obj
    class = "mine"               # in labels; without it, the name of the file
    source = "https://example.org/manta"
    licence = "CC0-1.0"

A folder without such a file says nothing about its meshes, which are then in metres with z up.
"""
import os
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from mitsonar.device.files import FilePath, check_readable
from mitsonar.device.spelling import meant

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # pyright: ignore[reportMissingImports]  # installed on Python 3.10 alone

NAME = "meshes.toml"
LARGEST = 1_000_000                # bytes
LONGEST = 500                      # letters of a text
LONGEST_CLASS = 100                # letters of a class, which is part of the names of channels
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}        # [m]
UP = ("z", "y")
NOT_STATED = "not stated"
TEXTS = ("class", "licence", "author", "source")
KEYS = (*TEXTS, "unit", "scale", "up")


@dataclass(frozen=True, kw_only=True)
class MeshStatement:
    """Statement about a mesh.

    Attributes
    ----------
    class_name : str or None
        Class of its objects in labels; None: the name of the file.
    licence, author, source : str
        As stated, or `NOT_STATED`.
    scale : float [m]
        Length of a unit of the file.
    up : {"z", "y"}
        Axis of the file that points up; with "y" the front is at -z.
    """

    class_name: str | None = None
    licence: str = NOT_STATED
    author: str = NOT_STATED
    source: str = NOT_STATED
    scale: float = 1.0
    up: str = "z"

    def placed(self, vertices: np.ndarray) -> np.ndarray:
        """Return vertices (V, 3) of the file in metres, z up and with the front to +y."""
        if (self.scale, self.up) == (1.0, "z"):
            return vertices
        x, y, z = self.scale * np.asarray(vertices, float).T
        return np.stack([x, y, z] if self.up == "z" else [x, -z, y], axis=1)


def statement(path: FilePath) -> MeshStatement:
    """Return what the folder of a mesh states about it.

    Parameters
    ----------
    path : str or path
        Mesh.

    Returns
    -------
    MeshStatement

    Raises
    ------
    ValueError
        If the statements are damaged, or name meshes that are not there.
    """
    path = Path(path)
    known = path.parent / NAME
    if not os.path.lexists(known):
        return MeshStatement()
    check_readable(known, "the list of meshes", "a TOML file")
    stat = known.stat()
    if stat.st_size > LARGEST:
        raise ValueError(f"{known} has {stat.st_size:,} bytes; give a TOML file of at most {LARGEST:,}")
    stated = _read(known, stat.st_mtime_ns, stat.st_size)
    return stated.get(path.stem, stated[""])


@lru_cache(maxsize=64)
def _read(path: Path, *_: int) -> dict[str, MeshStatement]:
    """Return the statements of a file by mesh; the one of all others is named ``""``."""
    try:
        with open(path, "rb") as file:
            given = tomllib.load(file)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"cannot read {path}: {' '.join(str(error).split())[:300]}") from None
    common = {key: item for key, item in given.items() if not isinstance(item, dict)}
    there = {name.stem for name in path.parent.iterdir() if name.suffix.lower() in (".ply", ".obj")}
    found = {"": _statement(common, f"{path}")}
    for name, table in given.items():
        if not isinstance(table, dict):
            continue
        if name not in there:
            raise ValueError(f"{path} has the table [{name[:100]}]{meant(name, there)}, and no mesh of that name is "
                             "beside it")
        found[name] = _statement({**common, **table}, f"{path}, [{name}]")
    return found


def _statement(given: Mapping[str, Any], where: str) -> MeshStatement:
    for key, item in given.items():
        if key not in KEYS:
            raise ValueError(f"{where} has the unknown key {key[:100]!r}{meant(key, KEYS)}; known: {', '.join(KEYS)}")
        if key in TEXTS and not (isinstance(item, str) and item.strip() and item.isprintable()
                                 and len(item) <= (LONGEST_CLASS if key == "class" else LONGEST)):
            raise ValueError(f"{where}: {key} is {item!r:.100}; give a text of one line and at most {LONGEST} letters, "
                             f"of a class {LONGEST_CLASS}")
    _check_one_of(given, "unit", UNITS, where)
    _check_one_of(given, "up", UP, where)
    scale, name = given.get("scale", 1.0), given.get("class")
    if isinstance(scale, bool) or not isinstance(scale, (int, float)) or not 1e-9 <= scale <= 1e9:
        raise ValueError(f"{where}: scale is {scale!r:.100}; give metres per unit of the file, such as 0.001")
    if "unit" in given and "scale" in given:
        raise ValueError(f"{where}: unit and scale are given; leave one out")
    if name is not None and ("." in name or name.strip() != name or name.endswith(" shadow")):
        raise ValueError(f"{where}: class is {name!r}; give a name without dots, without spaces at its ends, and "
                         "without \" shadow\", by which labels name the shadows of a class")
    return MeshStatement(class_name=name, scale=UNITS[given.get("unit", "m")] * scale, up=given.get("up", "z"),
                         **{key: given.get(key, NOT_STATED) for key in ("licence", "author", "source")})


def _check_one_of(given, key, known: Iterable[str], where):
    if given.get(key, next(iter(known))) not in [*known]:
        raise ValueError(f"{where}: {key} is {given[key]!r:.100}; give {', '.join(known)}")
