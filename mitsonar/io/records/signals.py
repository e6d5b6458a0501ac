"""Element signals and impulse responses in netCDF-4 files.

netCDF has no complex numbers: the variables ``real`` and ``imag`` (ping, tx, rx, sample) hold the two parts; axes,
units and provenance are coordinates and attributes, what is no plain value among them as JSON; ``replica_real`` and
``replica_imag`` are samples of the pulse. xarray reads the file without mitsonar; `read` gives the complex array back.
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
        Complex, as `mitsonar.element_signals` and `mitsonar.impulse_response` give them.

    Raises
    ------
    ValueError, OSError
        If the file cannot be written there.
    """
    netcdf.write(signals, path)


def read(path: FilePath) -> SonarSignals:
    """Read what `write` wrote.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    SonarSignals
        An `xarray.DataArray`, complex64; its ``pulse`` is what was transmitted.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it holds no signals of mitsonar.
    """
    found = netcdf.read(path)
    if not isinstance(found, SonarSignals):
        raise ValueError(f"{path} holds no signals: the variables real and imag are wanted, it has "
                         f"{', '.join(map(str, found)) or 'none'}.")
    return found
