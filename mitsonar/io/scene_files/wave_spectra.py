"""Spectra of waves from CSV files: the density of the surface's variance by frequency.

    frequency_hz, density_m2_hz
    0.10, 0.05
    0.12, 0.61
"""
from __future__ import annotations

from mitsonar.device.files import FilePath
from mitsonar.water.sea_waves import WaveSpectrum

from .tables import floats, records

__all__ = ["read"]

COLUMNS = "frequency_hz", "density_m2_hz"


def read(path: FilePath, *, heading: float = 0.0, spreading: float = 10.0) -> WaveSpectrum:
    """Read a spectrum of waves.

    Parameters
    ----------
    path : str or path
    heading : float [rad]
        Towards which the waves travel, clockwise from north.
    spreading : float
        s of the spread cos^2s(θ/2).

    Returns
    -------
    WaveSpectrum

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is no such table, its frequencies do not rise, or the waves are too steep.
    """
    names, lines, rows = records(path, "wave spectrum")
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise ValueError(f"{path}: the wave spectrum has no column {missing[0]}; it has {', '.join(names)}. Give the "
                         f"columns {' and '.join(COLUMNS)}.")
    frequency, density = (floats(path, lines, name, [row[names.index(name)] for row in rows]) for name in COLUMNS)
    try:
        return WaveSpectrum(frequency=frequency, density=density, heading=heading, spreading=spreading)
    except ValueError as error:
        raise ValueError(f"{path}: {error}.") from None
