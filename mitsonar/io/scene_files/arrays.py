"""Arrays from CSV files: a header names the columns, then a line per element.

    x,y,z,nx,ny,nz,weight,delay
    0.0,-0.10,0.02,0,0,1,1.0,0
    0.0, 0.10,0.02,0,0,1,0.5,2.5e-6

``x`` forward, ``y`` starboard and ``z`` down [m] from the array's centre, which follows the track; ``nx, ny, nz``
normal of the element, of any length; ``ax, ay, az`` direction of its face's length; ``weight`` (0: failed) and
``delay`` [s]. Only x, y and z are required. The order of columns is free; other columns, empty lines and lines starting
with # are ignored. Commas, semicolons or tabs separate the columns.
"""
from typing import Any

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.sonar.arrays.array import Array
from mitsonar.sonar.arrays.array_makers import element_array

from . import tables

POSITION, NORMAL, ALONG = ("x", "y", "z"), ("nx", "ny", "nz"), ("ax", "ay", "az")
SINGLE = ("weight", "delay")


def read(path: FilePath, *, normal: str | np.ndarray = "down", along: str | np.ndarray = "forward",
         **face: Any) -> Array:
    """Read an array.

    Parameters
    ----------
    path : str or path
        A CSV file with the columns named above.
    normal, along : str or array (3,) [-]
        Directions for all elements, if the file has no such columns; as in `sonar.element_array`.
    **face
        length, height, pattern and baffle of the elements, as in `sonar.Array`.

    Returns
    -------
    Array
        Positions as in the file, not moved to their mean.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If a column is missing or doubled, a field is not a finite number (the line is named), a normal is zero, no
        element has a weight, or the file has no elements.
    """
    names, lines, rows = tables.records(path, "array")
    groups = [group for group in (NORMAL, ALONG) if any(name in names for name in group)]
    wanted = [*POSITION, *(name for group in groups for name in group)]
    for name in (*wanted, *SINGLE):
        count = names.count(name)
        if count > 1 or (name in wanted and count == 0):
            raise ValueError(f"cannot read the array {path}: the column {name} is "
                             f"{'given twice' if count else 'missing'}; the header has {', '.join(names)} and needs "
                             "x, y and z, and may have nx, ny and nz, ax, ay and az, weight, delay.")
    column = {name: tables.floats(path, lines, name, [row[names.index(name)] for row in rows])
              for name in (*wanted, *SINGLE) if name in names}
    vectors = {group: np.stack([column[name] for name in group], axis=-1) for group in (POSITION, *groups)}
    try:
        return element_array(vectors[POSITION], normal=vectors.get(NORMAL, normal), along=vectors.get(ALONG, along),
                             **{name: column[name] for name in SINGLE if name in column}, **face)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
