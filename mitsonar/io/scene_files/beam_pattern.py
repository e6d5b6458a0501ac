"""Patterns of a multibeam's sectors: CSV, number of the sector, angle [degrees], level [dB].

    sector, angle, level
    0, -70, -1.5
    0, -35, 0.5

Sectors count from 0, from port to starboard. Angles are across the track, from the normal of the receiving line,
positive to starboard. Rows may have any order.
"""
import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.hydrography.detection.written_strength import BeamPattern

from .tables import floats, records

__all__ = ["read"]

MOST_DB = 60.0


def read(path: FilePath) -> BeamPattern:
    """Read the patterns of a multibeam's sectors.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no such table.
    """
    names, lines, rows = records(path, "beam pattern")
    if len(names) != 3:
        raise ValueError(f"cannot read the beam pattern {path}: it has {len(names)} columns; give the sector, the "
                         "angle [degrees] and the level [dB].")
    sector, angle, level = (floats(path, lines, name, [row[k] for row in rows]) for k, name in enumerate(names))
    for k, line in enumerate(lines):
        if sector[k] < 0 or sector[k] != np.floor(sector[k]) or abs(angle[k]) > 90 or abs(level[k]) > MOST_DB:
            raise ValueError(f"{path}, line {line}: sector {sector[k]:g}, {angle[k]:g} degrees, {level[k]:g} dB; give "
                             f"whole sectors from 0, angles within 90 degrees and levels within {MOST_DB:g} dB.")
    return BeamPattern(sector=sector.astype(int), angle=np.deg2rad(angle), level_db=level)
