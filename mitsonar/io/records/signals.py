"""Write element signals and impulse responses to netCDF-4 files, and read them.

netCDF has no complex numbers: the variables ``real`` and ``imag`` (ping, tx, rx, sample) hold the two parts. Axes,
units and provenance are coordinates and attributes, as JSON where they are not plain values; ``replica_real`` and
``replica_imag`` are samples of the pulse. xarray reads the file without mitsonar; `read` restores the complex array.
"""
import xarray as xr

from mitsonar.device.files import FilePath

from . import netcdf
from .records import SonarSignals

__all__ = ["read", "write"]


def write(path: FilePath, signals: xr.DataArray) -> None:
    """Write element signals or impulse responses to a netCDF-4 file, whole or not at all.

    Parameters
    ----------
    path : str or path
    signals : xarray.DataArray
        Complex signals of `mitsonar.element_signals` or `mitsonar.impulse_response`.

    Raises
    ------
    ValueError, OSError
        If the file cannot be written there.
    """
    netcdf.write(signals, path)


def read(path: FilePath) -> SonarSignals:
    """Read signals written by `write`.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    SonarSignals
        An `xarray.DataArray`, complex64; its ``pulse`` is the transmitted pulse.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file has no signals of mitsonar.
    """
    signals = netcdf.read(path)
    if not isinstance(signals, SonarSignals):
        raise ValueError(f"{path} holds no signals: the variables real and imag are wanted, it has "
                         f"{', '.join(map(str, signals)) or 'none'}.")
    return signals
