"""Measured beam patterns: CSV, angle [degrees] and one-way level [dB].

    angle_deg, level_db
    -60, -24.5
    0, 0
    60, -21.0

Angles are those to the face's normal, forward or downwards positive, within -90 to 90; levels lie within 300 dB of 0.
Rows may come in any order.
"""
import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.sonar.faces.faces import MeasuredBeam

from .tables import floats, records

__all__ = ["read"]

COLUMNS = ("angle_deg", "level_db")
LARGEST_DB = 300.0                 # of a level, either way


def read(path: FilePath) -> MeasuredBeam:
    """Read a measured beam pattern.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    MeasuredBeam

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no such table, has an angle twice, one that no face sees, or a level that is none.
    """
    names, lines, rows = records(path, "beam pattern")
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise ValueError(f"cannot read the beam pattern {path}: it has no column {missing[0]}; name the columns "
                         f"{' and '.join(COLUMNS)}.")
    angle, level = (floats(path, lines, name, [row[names.index(name)] for row in rows]) for name in COLUMNS)
    wrong = np.flatnonzero(np.abs(angle) > 90)
    if wrong.size:
        raise ValueError(f"{path}, line {lines[wrong[0]]}: the angle is {angle[wrong[0]]:g}; it must lie within -90 to "
                         "90 degrees of the face's normal.")
    wrong = np.flatnonzero(np.abs(level) > LARGEST_DB)
    if wrong.size:
        raise ValueError(f"{path}, line {lines[wrong[0]]}: the level is {level[wrong[0]]:g} dB; it must lie within "
                         f"-{LARGEST_DB:g} to {LARGEST_DB:g} dB.")
    order = np.argsort(angle, kind="stable")
    angle, level = angle[order], level[order]
    same = np.flatnonzero(np.diff(angle) == 0)
    if same.size:
        raise ValueError(f"{path}: the angle {angle[same[0]]:g} is there twice; remove one.")
    if len(angle) < 2:
        raise ValueError(f"{path}: one angle makes no pattern; give two or more.")
    return MeasuredBeam(angle=np.radians(angle), level_db=level)
