"""Samples of sidescan channels of XTF files as recorded, to compare pictures, not levels.

XTF contains neither the applied gain nor the scale of the samples, so that only ratios over short ranges are
meaningful. By the format's convention, port channels are stored with the farthest sample first; here both sides begin
at the near end.
"""
import numpy as np
import xarray as xr

from mitsonar.device import files
from mitsonar.device.files import FilePath

_SIDES = {1: "port", 2: "starboard"}                     # TypeOfChannel of the file's header
_TYPES = {1: np.uint8, 2: np.uint16, 4: np.uint32}


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
    import pyxtf

    files.check_readable(path, "the sidescan record", "an XTF file")
    try:
        header, packets = pyxtf.xtf_read(str(path))
    except (RuntimeError, ValueError, OSError, KeyError, IndexError) as error:
        raise ValueError(f"cannot read the sidescan record {path}: {error}") from None
    channels = [_SIDES.get(header.ChanInfo[number].TypeOfChannel)
                for number in range(min(header.channel_count(), len(header.ChanInfo)))]
    pings = packets.get(pyxtf.XTFHeaderType.sonar, [])
    missing = [side for side in _SIDES.values() if side not in channels]
    if missing or not pings:
        raise ValueError(f"cannot read the sidescan record {path}: it has no "
                         f"{'sidescan pings' if not pings else f'channel to {missing[0]}'}; give a sidescan's file.")
    sides = [_channel(path, pings, channels.index(side), header.ChanInfo[channels.index(side)].BytesPerSample)
             for side in _SIDES.values()]
    if sides[0].shape != sides[1].shape:
        raise ValueError(f"cannot read the sidescan record {path}: port has {sides[0].shape[1]} samples and starboard "
                         f"{sides[1].shape[1]}; give a file whose sides are alike.")
    sides[0] = sides[0][:, ::-1]
    longest = float(np.median([ping.ping_chan_headers[channels.index("port")].SlantRange for ping in pings]))
    if not 0 < longest < np.inf:
        raise ValueError(f"cannot read the sidescan record {path}: its slant range is {longest:g} m.")
    count = sides[0].shape[1]
    return xr.Dataset(
        {"amplitude": (("ping", "side", "range"), np.stack(sides, 1).astype(np.float32), {"units": "1"})},
        coords={"side": list(_SIDES.values()),
                "range": ("range", (np.arange(count) + 0.5) * longest / count, {"units": "m"}),
                "altitude": ("ping", np.array([ping.SensorPrimaryAltitude for ping in pings], float), {"units": "m"})})


def _channel(path, pings, number, width):
    """Return the samples (ping, sample) of a channel."""
    rows = [np.asarray(ping.data[number]) for ping in pings if len(ping.data) > number]
    if len(rows) != len(pings) or len({row.size for row in rows}) != 1 or rows[0].size < 2:
        raise ValueError(f"cannot read the sidescan record {path}: the number of samples changes from ping to ping, or "
                         "pings lack a side; give a file of one range.")
    if rows[0].dtype != _TYPES.get(width):
        raise ValueError(f"cannot read the sidescan record {path}: its samples are {rows[0].dtype}; whole numbers "
                         "without a sign are known.")
    return np.stack(rows)
