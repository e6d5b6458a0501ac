"""Tables of backscatter strength: CSV, grazing angle [degrees] and strength [dB], for one or several frequencies.

    grazing, 30 kHz, 100 kHz
    5, -38.2, -34.0
    45, -24.1, -21.5

The first column is the grazing angle. A single further column, of any name, is valid at all frequencies; several are
named by their frequencies in kHz. Rows may have any order.
"""
import re
from pathlib import Path

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.scattering.laws.empirical import EmpiricalSeabed
from mitsonar.units import hertz_from_khz

from .tables import floats, records

__all__ = ["read"]

FREQUENCY = re.compile(r"(\d+(?:\.\d*)?)\s*khz")


def read(path: FilePath) -> EmpiricalSeabed:
    """Read a table of backscatter strength.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    EmpiricalSeabed

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no such table, or more power would be scattered than arrives.
    """
    names, lines, rows = records(path, "backscatter table")
    if len(names) < 2:
        raise ValueError(f"cannot read the backscatter table {path}: it has one column; give the grazing angle "
                         "[degrees] and, beside it, the strength [dB].")
    columns = [floats(path, lines, name, [row[k] for row in rows]) for k, name in enumerate(names)]
    angle = columns[0]
    if not ((angle > 0) & (angle <= 90)).all():
        wrong = np.flatnonzero(~((angle > 0) & (angle <= 90)))[0]
        raise ValueError(f"{path}, line {lines[wrong]}: the grazing angle is {angle[wrong]:g}; it must be above 0 and "
                         "at most 90 degrees.")
    order = np.argsort(angle)
    same = np.flatnonzero(np.diff(angle[order]) == 0)
    if same.size:
        raise ValueError(f"{path}: the grazing angle {angle[order][same[0]]:g} is there twice; remove one.")
    frequencies = None
    if len(names) > 2:
        frequencies = hertz_from_khz(np.array([_frequency(path, name) for name in names[1:]]))
        columns[1:] = [columns[1 + k] for k in np.argsort(frequencies)]
        frequencies = np.sort(frequencies)
        if frequencies[0] <= 0 or (np.diff(frequencies) == 0).any():
            raise ValueError(f"{path}: the frequencies of the columns must be above 0, and each be there once.")
    return EmpiricalSeabed(angles=np.radians(angle[order]), strengths_db=np.stack(columns[1:], 1)[order],
                           frequencies=frequencies, name=Path(path).name)


def _frequency(path, name):
    found = FREQUENCY.search(name)
    if not found:
        raise ValueError(f'{path}: the column "{name}" has no frequency in its name; name it as "100 kHz".')
    return float(found[1])
