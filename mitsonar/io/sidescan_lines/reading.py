"""Read recorded sidescans; the content of a file selects its format.

    xtf     Triton: sonar packets, with the navigation of their headers or of the packets between them
    jsf     EdgeTech: sonar messages, with the navigation of their headers or of the messages of sensors between them
    sdf     Klein: pages of the UUV-3500, not proven by a recorded file
"""
from __future__ import annotations

import importlib
import os
import warnings
from collections.abc import Sequence

from mitsonar.device.files import FilePath, check_readable

from ..records.records import SonarImage
from ..xtf.navigation import recognised as recognised_xtf
from ..xtf.packets import SONAR, holds
from . import jsf_messages, sdf_line

# module of each format; all have read(path, channels, frequency, pings)
FORMATS = {"xtf": "xtf_line", "jsf": "jsf_line", "sdf": "sdf_line"}


def recognised(path: FilePath) -> str | None:
    """Return the format of a file, one of `FORMATS`, or None, by its content."""
    with open(path, "rb") as file:
        head = file.read(16)
    if head.startswith(jsf_messages.SYNC) and len(head) == 16 and head[2]:
        return "jsf"
    if head.startswith(sdf_line.START) and int.from_bytes(head[4:8], "little") > sdf_line.LEAST_HEADER:
        return "sdf"
    # Kongsberg's datagrams may begin with the same byte, and have 2 or # at the fifth; multibeams have no sonar packets
    return "xtf" if recognised_xtf(path) and head[4:5] not in (b"\2", b"#") and holds(path, SONAR) else None


def read(path: FilePath, *, channels: Sequence[int] | None = None, frequency: float | None = None,
         pings: slice | None = None) -> SonarImage:
    """Read a recorded sidescan, with samples as its instrument wrote them.

    Parameters
    ----------
    path : str or path
        An XTF, JSF or SDF file, recognised by its content.
    channels : sequence of int, optional
        Numbers of the channels, at most one of each side; the attribute ``channels`` lists those of the file.
    frequency : float, optional [Hz]
        Selects the pair of channels of that frequency, within a tenth. Without a choice, the first pair is read, with a
        warning if there are others.
    pings : slice, optional
        Consecutive pings to read, counted from 0; bounds the memory. The default is all.

    Returns
    -------
    xarray.Dataset
        ``amplitude`` (ping, side, sample): integers as recorded, nearest sample first, zeros behind the last of a row.
        Over ping: ``ping_time`` [s since 1970], ``ping_number``, ``lost``, ``altitude``, ``sensor_depth`` [m],
        ``longitude`` and ``latitude`` [degrees] or ``x`` and ``y`` [m], ``heading``, ``pitch``, ``roll`` [rad],
        ``heave`` [m], ``speed``, ``sound_speed`` [m/s]. Over ping and side: ``samples``, ``sample_interval``,
        ``sample_start`` [s], ``slant_range`` [m], ``weight``, and where the file has them ``gain_code``,
        ``initial_gain_code``, ``processing_flags``, ``pulse_length`` [s], ``pulse_start_frequency``,
        ``pulse_end_frequency`` [Hz], ``source_level_percent``. Coordinates ``ping``, ``side`` and ``range`` [m], the
        middles of samples. Unknown values are NaN. `sidescan_lines.record` describes variables and attributes.

    Raises
    ------
    FileNotFoundError, PermissionError
        If there is no such file, or it may not be read.
    ValueError
        If the file is of no known format, is damaged, has no sidescan, or lacks the channels or pings asked for.

    Examples
    --------
    ``mitsonar.io.sidescan_lines.read("line.xtf")["amplitude"].sel(side="port")``
    """
    check_readable(path, "the sidescan record", "an XTF, JSF or SDF file")
    kind = recognised(path)
    if kind is None:
        raise ValueError(f"cannot read the sidescan record {path}: it is no XTF file with sonar packets, and no JSF "
                         "or SDF file; give a recorded sidescan.")
    some = pings or slice(None)
    if some.step not in (None, 1) or (some.start or 0) < 0 or some.stop is not None and some.stop <= (some.start or 0):
        raise ValueError(f"the pings to read of {path} are {pings}; give a slice from a first ping, counted from 0, to "
                         "a later one.")
    module = importlib.import_module(f"{__package__}.{FORMATS[kind]}")
    try:
        record = module.read(path, channels, frequency, some)
    except ValueError as error:
        raise ValueError(f"cannot read the sidescan record {path}: {error}") from None
    others = [text for text in record.attrs["left_out"] if text.startswith("channels ")]
    if others and channels is None and frequency is None:
        warnings.warn(f"{path} has several pairs of channels, and the first was read; left out: {others[0]}.",
                      stacklevel=2)
    return SonarImage.of(record.assign_attrs(format=kind, source=os.path.basename(path)))
