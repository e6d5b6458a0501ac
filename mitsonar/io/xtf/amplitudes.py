"""Samples of sidescan channels of XTF files as recorded, to compare pictures, not levels.

XTF contains neither the applied gain nor the scale of the samples, so that only ratios over short ranges are
meaningful. Both sides begin at the near end. `io.sidescan_lines` reads all that such a file holds.
"""
import warnings

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath


def read_amplitudes(path: FilePath) -> xr.Dataset:
    """Read the first port and the first starboard channel.

    Parameters
    ----------
    path : str or path

    Returns
    -------
    xarray.Dataset
        ``amplitude`` (ping, side, range), in steps of the recorder; coordinates ``range`` [m], the middles of samples,
        and ``altitude`` (ping) [m] as recorded, 0 where it was not known.

    Raises
    ------
    FileNotFoundError, PermissionError
        If there is no such file, or it may not be read.
    ValueError
        If it is no XTF file, lacks a side, or its samples change in number, or are no whole numbers.
    """
    from ..sidescan_lines import read

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")                  # of further channels
        record = read(path)
    counts = np.unique(record["samples"].values, axis=0)
    if record.sizes["side"] != 2:
        missing = "starboard" if record["side"].values[0] == "port" else "port"
        raise ValueError(f"cannot read the sidescan record {path}: it has no channel to {missing}; give a sidescan's "
                         "file.")
    if counts.min() != counts.max():
        raise ValueError(f"cannot read the sidescan record {path}: its pings have {counts.min()} to {counts.max()} "
                         "samples a side; give a file of one range.")
    if record["amplitude"].dtype.kind != "u":
        raise ValueError(f"cannot read the sidescan record {path}: its samples are {record['amplitude'].dtype}; whole "
                         "numbers without a sign are known.")
    longest = float(np.nanmedian(record["slant_range"].values[:, 0]))
    count = record.sizes["sample"]
    return xr.Dataset(
        {"amplitude": (("ping", "side", "range"), record["amplitude"].values.astype(np.float32), {"units": "1"})},
        coords={"side": list(record["side"].values),
                "range": ("range", (np.arange(count) + 0.5) * longest / count, {"units": "m"}),
                "altitude": ("ping", np.nan_to_num(record["altitude"].values), {"units": "m"})})
