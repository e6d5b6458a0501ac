"""Element signals and impulse responses in netCDF-4 files.

netCDF has no complex numbers: the variables ``real`` and ``imag`` (ping, tx, rx, sample) hold the two parts; axes,
units and provenance are coordinates and attributes, what is no plain value among them as JSON. xarray reads the file
without mitsonar; `read` gives the complex array back.
"""
import errno
import json
import os

import numpy as np
import xarray as xr

from .files import check_readable, check_writable, replacing

__all__ = ["read", "write"]

JSON = "json:"                     # marks an attribute that was no plain value


def write(path, signals):
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
    check_writable(path)
    values = np.asarray(signals.values)
    units = {"units": signals.attrs.get("units", "1")}
    dataset = xr.Dataset({"real": (signals.dims, values.real, units), "imag": (signals.dims, values.imag, units)},
                         coords=signals.coords, attrs={"name": signals.name or "signals"})
    dataset.attrs.update({key: _plain(value) for key, value in signals.attrs.items()})
    with replacing(path) as temporary:
        try:
            dataset.to_netcdf(temporary, engine="h5netcdf",
                              encoding={name: {"zlib": True, "complevel": 1} for name in ("real", "imag")})
        except (OSError, RuntimeError) as error:
            # HDF5 tells the reason in words alone
            if os.strerror(errno.ENOSPC) not in str(error):
                raise
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from error


def read(path):
    """Read what `write` wrote.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    xarray.DataArray
        Complex64.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it holds no signals of mitsonar.
    """
    check_readable(path, "the signals", "a netCDF file")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            dataset.load()
    except (OSError, ValueError, KeyError) as error:
        raise ValueError(f"{path} is no netCDF-4 file that can be read ({error}).") from None
    if not {"real", "imag"} <= set(dataset):
        raise ValueError(f"{path} holds no signals: the variables real and imag are wanted, it has "
                         f"{', '.join(map(str, dataset)) or 'none'}.")
    signals = (dataset["real"] + 1j * dataset["imag"]).astype(np.complex64)
    attributes = {key: _value(value) for key, value in dataset.attrs.items()}
    signals.name = attributes.pop("name", None)
    return signals.assign_attrs(attributes)


def _plain(value):
    if isinstance(value, (str, int, float, np.integer, np.floating)) and not isinstance(value, bool):
        return value
    return JSON + json.dumps(value)


def _value(value):
    if isinstance(value, str) and value.startswith(JSON):
        return json.loads(value[len(JSON):])
    return value.item() if isinstance(value, np.generic) else value
