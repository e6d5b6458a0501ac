"""Read files of mitsonar, lines of soundings and sidescans by content; write images, signals, soundings by suffix."""
import json
import os

import numpy as np
import xarray as xr

from mitsonar.device.files import EXR, HDF5, PNG, FilePath, check_readable

from .records import exr, hdf5, netcdf
from .records.records import SonarImage, SonarSignals, check_numbers
from .records.self_contained import DataElsewhere, check_store

__all__ = ["is_netcdf", "read", "write"]

HEAD = 8                           # first bytes, by which formats are recognised
ZARR = ("zarr.json", ".zmetadata", ".zgroup")
LARGEST_JSON = 10 ** 9             # bytes; text takes some ten times as much once it is read
GEOTIFF = (".tif", ".tiff")
IMAGES = (".exr", ".nc", *hdf5.SUFFIXES, *GEOTIFF)       # of focused images
KINDS = (".exr (images), .nc (images, signals, soundings), .h5, .tif (focused images), .gsf, .kmall, .s7k, .csv, "
         ".las (soundings)")


def read(path: FilePath) -> SonarImage | SonarSignals | dict | list | np.ndarray | xr.Dataset:
    """Read a file that mitsonar wrote, a line of soundings or a recorded sidescan.

    Parameters
    ----------
    path : str or path
        An EXR, a netCDF file, a Zarr folder, JSON or lines of JSON (annotations, splits, manifests) or PNG (masks); a
        survey line (.all, .wcd, .kmall, .kmwcd, .gsf, .s7k, .xtf, .hsx), of which `io.survey_lines.reading` also reads
        parts;
        a recorded sidescan (.xtf, .jsf, .sdf), of which `io.sidescan_lines` also reads parts;
        an echo sounder's .raw file, of which `io.echo_sounder_lines` also reads other channels and parts.

    Returns
    -------
    SonarImage, SonarSignals, dict, list or numpy.ndarray
        Images are an `xarray.Dataset`, signals an `xarray.DataArray`, pictures (row, column) or (row, column, channel).
    xarray.Dataset
        Survey line, as `hydrography.record` describes it, or sidescan, as `io.sidescan_lines.record` does.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If it is of another kind, damaged, or was not written by mitsonar.
    """
    if os.path.isdir(path):
        return _zarr(path)
    check_readable(path, wanted="a file that mitsonar wrote, or a survey line")
    with open(path, "rb") as stream:
        head = stream.read(HEAD)
    if head.startswith(EXR):
        return exr.read(path)
    if head.startswith(HDF5):
        return netcdf.read(path)
    if head.startswith(PNG):
        return _picture(path)
    if os.path.splitext(path)[1] in (".json", ".jsonl"):
        return _json(path)
    if (line := recorded(path)) is not None:
        return SonarImage.of(line)
    raise ValueError(f"cannot read {path}: it is no EXR, netCDF, JSON, PNG or survey line; give a file that "
                     "mitsonar wrote, or a line of a sounder or a sidescan.")


def recorded(path: FilePath) -> xr.Dataset | None:
    """Return what an instrument or survey software recorded in a file, recognised by its content; None for others."""
    from . import echo_sounder_lines, sidescan_lines
    from .survey_lines import reading as survey_lines

    with open(path, "rb") as stream:
        head = stream.read(HEAD)
    if sidescan_lines.recognised(path):
        return sidescan_lines.read(path)
    if echo_sounder_lines.recognised(head):
        return echo_sounder_lines.read(path)
    return survey_lines.read(path) if survey_lines.recognised(head) else None


def is_netcdf(path: FilePath) -> bool:
    """Return True if a file exists and begins as netCDF-4 files do."""
    if not os.path.isfile(path):
        return False
    with open(path, "rb") as stream:
        return stream.read(HEAD).startswith(HDF5)


def write(record: xr.Dataset | xr.DataArray, path: FilePath) -> None:
    """Write an image, signals or a line of soundings. A failed write leaves no file.

    Parameters
    ----------
    record : xarray.Dataset or xarray.DataArray
        Result of a function of mitsonar, or of xarray applied to it.
    path : str or path
        Ending in .exr (images), .nc (images, signals and soundings), .h5 (any dataset), .tif (focused images), or .gsf,
        .kmall, .s7k, .csv, .las (soundings; `io.survey_lines.write` also reports what such a file cannot hold).

    Raises
    ------
    ValueError
        If the name ends in none of them, or the record does not go into such a file.
    OSError
        If the file cannot be written there.
    """
    from . import survey_lines
    from .sidescan_lines.record import is_recorded

    suffix = os.path.splitext(path)[1].lower()
    if suffix in (".exr", *GEOTIFF) and isinstance(record, xr.Dataset) and is_recorded(record):
        raise ValueError(f"cannot write {path}: a recorded sidescan is no image; give a name that ends in .nc, or "
                         "write what sidescan_lines.as_image makes of it.")
    if suffix in (*hdf5.SUFFIXES, *GEOTIFF):
        _write_image(record, path, suffix)
    elif suffix == ".nc":
        netcdf.write(record, path)
    elif suffix == ".exr" and isinstance(record, xr.Dataset):
        exr.write(record, path)
    elif suffix == ".exr":
        raise ValueError(f"cannot write {path}: signals are no image; give a name that ends in .nc.")
    elif suffix in survey_lines.SUFFIXES and isinstance(record, xr.Dataset) and "travel_time" in record:
        survey_lines.write(record, path)
    elif suffix in survey_lines.SUFFIXES:
        raise ValueError(f"cannot write {path}: {suffix} takes lines of soundings; give a name that ends in .nc.")
    else:
        raise ValueError(f"cannot write {path}: the name has no known suffix; let it end in one of {KINDS}.")


def _write_image(record, path, suffix):
    """Write an image for other programs: HDF5, or a focused image as GeoTIFF."""
    from .records import geotiff

    if not isinstance(record, xr.Dataset):
        raise ValueError(f"cannot write {path}: signals are no image; give a name that ends in .nc.")
    if suffix in hdf5.SUFFIXES:
        hdf5.write(record, path)
    elif "along_track" in record.dims:
        geotiff.write_focused(record, path)
    else:
        raise ValueError(f"cannot write {path}: GeoTIFF takes focused images of a synthetic aperture; `mitsonar "
                         "mosaic` makes maps of sidescans, `mitsonar grid` of soundings.")


def _zarr(path):
    if not any(os.path.exists(os.path.join(path, name)) for name in ZARR):
        raise ValueError(f"cannot read {path}: it is a folder, and not one of Zarr; give a file inside it.")
    try:
        check_store(path)
        with xr.open_zarr(path) as dataset:
            dataset.load()
    except ImportError:
        raise ValueError(f"cannot read {path}: Zarr is not installed; pip install zarr.") from None
    except MemoryError:
        raise
    except DataElsewhere as error:
        raise ValueError(f"cannot read {path}: {error}") from None
    except Exception as error:                         # its type depends on where the store is damaged
        raise ValueError(f"cannot read {path}: this Zarr store is damaged, or of a kind that is not read "
                         f"({' '.join(str(error).split())}).") from None
    variables = list(dataset.data_vars.values())
    signals = len(variables) == 1 and variables[0].dtype.kind == "c"
    record = SonarSignals.of(variables[0]) if signals else SonarImage.of(dataset)
    check_numbers(record, path)
    return record


def _picture(path):
    from PIL import Image

    try:
        with Image.open(path) as picture:
            return np.asarray(picture)
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"cannot read {path}: the picture is damaged or too large ({error}).") from None


def _json(path):
    if (size := os.path.getsize(path)) > LARGEST_JSON:
        raise ValueError(f"cannot read {path}: it has {size:,} bytes, and JSON of at most {LARGEST_JSON:,} is read "
                         "whole; divide it.")
    try:
        with open(path, encoding="utf-8") as stream:
            if os.path.splitext(path)[1] == ".jsonl":
                return [json.loads(line) for line in stream]
            return json.load(stream)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"cannot read {path}: it is no JSON ({error}).") from None
