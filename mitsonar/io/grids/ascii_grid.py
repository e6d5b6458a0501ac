"""ESRI ASCII grids: six lines of header, then the heights by rows from the north.

The header is GDAL's business. The heights are read here, because GDAL takes words among them, and those that are
missing at the end of a file cut short, for 0, which is a depth.
"""
import itertools

import numpy as np

from mitsonar.device.files import FilePath

_KEYS = ("ncols", "nrows", "xllcorner", "yllcorner", "xllcenter", "yllcenter", "cellsize", "dx", "dy", "nodata_value")
_BLOCK = 1 << 22  # characters read at a time
_LONGEST = 200    # characters of a line of the header


def is_ascii_grid(path: FilePath) -> bool:
    """Tell whether a file starts as an ESRI ASCII grid does, whatever it is called."""
    try:
        with open(path, "rb") as file:
            word = file.read(40).split()[:1]
    except OSError:
        return False
    return bool(word) and word[0].lower() in (b"ncols", b"nrows")


def read_values(path: FilePath, rows: int, columns: int) -> np.ndarray:
    """Read the heights of an ESRI ASCII grid.

    Parameters
    ----------
    path : path
    rows, columns : int
        As the header says.

    Returns
    -------
    float32 array (Y, X) [m]
        Fill values as they are written.

    Raises
    ------
    ValueError
        If there are more or fewer numbers than the header says, or one is none.
    """
    count = rows * columns
    with open(path, encoding="ascii", errors="replace") as file:
        file.seek(0, 2)
        if file.tell() < 2 * count:
            raise ValueError(f"the header names {rows} x {columns} nodes, for which the file is too short; it is "
                             "cut off, or its header is wrong.")
        file.seek(0)
        values, filled = np.empty(count, np.float32), 0
        for words in _blocks(file):
            if filled + len(words) > count:
                raise ValueError(f"there are more numbers than the {rows} x {columns} of the header; repair it.")
            try:
                values[filled:filled + len(words)] = words
            except ValueError:
                word = next((word for word in words if not _is_number(word)), "a word")
                raise ValueError(f"among the heights stands {word[:40]!r}, which is no number; repair the file."
                                 ) from None
            filled += len(words)
    if filled < count:
        raise ValueError(f"there are {filled} numbers, and the header names {rows} x {columns}; the file is cut off.")
    return values.reshape(rows, columns)


def _is_number(word):
    try:
        float(word)
    except ValueError:
        return False
    return True


def _blocks(file):
    """Give the words after the header, some lines at a time."""
    rest = ""
    while (start := file.tell()) >= 0:
        line = file.readline(_LONGEST)
        if (line.split() or [""])[0].lower() not in _KEYS:
            file.seek(start)
            break
    for block in itertools.chain(iter(lambda: file.read(_BLOCK), ""), ("\n",)):
        words = (rest + block).split()
        # A word may go on in the next block.
        rest = words.pop() if words and not block[-1].isspace() else ""
        if len(rest) > _LONGEST:
            raise ValueError("among the heights is a word without an end; this is no grid.")
        yield words
