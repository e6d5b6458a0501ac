"""Hold images and signals as xarray objects that netCDF files can store.

netCDF has no dictionaries, booleans, None or complex numbers. Attributes that are not plain values become JSON in text
that begins with "json:", complex signals become the variables ``real`` and ``imag``, and `complex_parts` splits complex
variables of a dataset. xarray reads such files without mitsonar; `mitsonar.read` restores the record bit for bit. Zarr
stores all of this directly.
"""
import json
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.sonar.pulses.pulses import Pulse, pulse_of

from . import complex_parts

JSON = "json:"                     # begins an attribute that was not a plain value
ENGINE = "h5netcdf"
RECORDED = ("level", "image", "signal")            # variables that a check for NaN looks at
# variables of interferometric sidescans before version 0.3, which called the truth true_depth
MEASURED = {"depth": "measured_depth", "point_x": "measured_x", "point_y": "measured_y",
            "across_track": "measured_across_track"}
Record = TypeVar("Record", bound=xr.Dataset | xr.DataArray)


class SonarImage(xr.Dataset):
    """Hold an image as an `xarray.Dataset` that can be written to netCDF directly."""

    __slots__ = ()

    @classmethod
    def of(cls, dataset: xr.Dataset) -> "SonarImage":
        """Return the dataset as an image."""
        return cls(dataset.data_vars, dataset.coords, dataset.attrs)

    def to_netcdf(self, path: FilePath | None = None, *arguments: Any, **options: Any) -> Any:
        """Write to netCDF-4; the arguments are those of `xarray.Dataset.to_netcdf`, with h5netcdf as default engine."""
        return encoded(self).to_netcdf(path, *arguments, **_engine(arguments, options))


class SonarSignals(xr.DataArray):
    """Hold element signals, responses or beams as an `xarray.DataArray` that can be written to netCDF directly."""

    __slots__ = ()

    @classmethod
    def of(cls, array: xr.DataArray) -> "SonarSignals":
        """Return the array as signals."""
        return cls(array.variable, array.coords, name=array.name)

    @property
    def pulse(self) -> Pulse:
        """Return the transmitted pulse."""
        if self.attrs.get("pulse") is None:
            raise ValueError("these signals do not say which pulse was transmitted; take that of the scene's sensor.")
        return pulse_of(self.attrs["pulse"])

    def to_netcdf(self, path: FilePath | None = None, *arguments: Any, **options: Any) -> Any:
        """Write to netCDF-4 as `encoded` does; the arguments are those of `xarray.DataArray.to_netcdf`."""
        return encoded(self).to_netcdf(path, *arguments, **_engine(arguments, options))


def with_present_names(image: SonarImage) -> SonarImage:
    """Return an image with the names of today: depth once was a measurement, or the depth of a focused image's grid."""
    if "along_track" in image.dims and "depth" in image.variables and "grid_depth" not in image.variables:
        return SonarImage.of(image.rename(depth="grid_depth"))
    if not {"true_depth", "point_x"} <= set(image):
        return image
    renamed = image.rename({**{name: new for name, new in MEASURED.items() if name in image}, "true_depth": "depth"})
    if "error" in renamed:
        renamed["error"].attrs["long_name"] = "measured_depth - depth"
    return SonarImage.of(renamed)


def not_all_nan(record: Record) -> Record:
    """Return a record; raise `ValueError` if its levels or samples are not numbers, or all NaN."""
    arrays = [record] if isinstance(record, xr.DataArray) else [record[name] for name in RECORDED if name in record]
    for array in arrays:
        values = array.values
        if values.dtype.kind not in "biufc":
            raise ValueError(f"{array.name or 'the signals'} holds {values.dtype}, which is no number; write it again")
        # few records begin with NaN: in the others only one number is looked at
        if values.dtype.kind in "fc" and values.size and np.isnan(values.flat[0]) and np.isnan(values).all():
            raise ValueError(f"all numbers of {array.name or 'the signals'} are NaN, so the record holds nothing; "
                             "check the largest and smallest numbers of the scene")
    return record


def encoded(record: xr.Dataset | xr.DataArray, *, whole: bool = False) -> xr.Dataset:
    """Return a dataset that netCDF can hold."""
    attrs = {key: plain_value(value) for key, value in record.attrs.items()}
    if isinstance(record, xr.DataArray):
        parts = {"real": np.real, "imag": np.imag} if np.iscomplexobj(record) else {"values": np.asarray}
        units = {"units": record.attrs.get("units", "1")}
        variables = {name: (record.dims, part(record.values), units) for name, part in parts.items()}
        return xr.Dataset({**variables, **_replica(record)}, record.coords, {"name": record.name or "signals", **attrs})
    record = record if whole else complex_parts.split(record)
    plain = xr.Dataset(record.data_vars, record.coords, attrs)
    for name, variable in record.variables.items():
        plain[name].attrs = {key: plain_value(value) for key, value in variable.attrs.items()}
    return plain


def decoded(dataset: xr.Dataset) -> SonarImage | SonarSignals:
    """Return the record that `encoded` was given."""
    dataset = dataset.assign_coords({name: (coord.dims, coord.values.astype(str), coord.attrs)
                                     for name, coord in dataset.coords.items() if coord.dtype.kind not in "biufmMU"})
    attrs = {key: _value(value) for key, value in dataset.attrs.items()}
    if {"real", "imag"} <= set(dataset):
        signals = xr.DataArray(complex_parts.together(dataset["real"].variable, dataset["imag"].variable),
                               dataset["real"].coords)
    elif set(dataset) - {"replica_real", "replica_imag"} == {"values"}:
        signals = dataset["values"]
    else:
        whole = complex_parts.joined(dataset)
        image = SonarImage(whole.data_vars, whole.coords, attrs)
        for variable in image.variables.values():
            variable.attrs = {key: _value(value) for key, value in variable.attrs.items()}
        return with_present_names(image)
    signals.name, signals.attrs = attrs.pop("name", None), attrs
    return SonarSignals.of(signals)


def check_numbers(record: SonarImage | SonarSignals, path: FilePath) -> None:
    """Refuse an image without any level, or signals or raw echoes without any sample, that is a number."""
    try:
        not_all_nan(record)
    except ValueError as error:
        raise ValueError(f"cannot use {path}: {error}.") from None


def _replica(record):
    """Return the samples of the pulse at the signals' sampling rate."""
    pulse, rate = (record.attrs.get(name) for name in ("pulse", "sampling_rate"))
    if pulse is None or rate is None:
        return {}
    samples = pulse_of(pulse).sampled_at(rate)
    about = {"long_name": "transmitted envelope", "sampling_rate": rate}
    return {f"replica_{part}": ("replica", getattr(samples, part), about) for part in ("real", "imag")}


def plain_value(value: Any) -> str | int | float | np.integer | np.floating:
    """Return a value that files can hold, or JSON."""
    if isinstance(value, (str, int, float, np.integer, np.floating)) and not isinstance(value, bool):
        return value
    return JSON + json.dumps(value)


def _value(value):
    if isinstance(value, str) and value.startswith(JSON):
        return json.loads(value[len(JSON):])
    return value.item() if isinstance(value, np.generic) else value


def _engine(arguments, options):
    """Return the options with an engine, unless one is given by name or position."""
    return options if len(arguments) > 3 else {"engine": ENGINE, **options}
