"""Choose how scenes and records are shown by what they are, and record or serve that."""
from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import xarray as xr

from mitsonar.device.files import FilePath, check_writable, checked_suffix, replacing
from mitsonar.imaging.gain import Tvg
from mitsonar.imaging.recording import shown as recorded
from mitsonar.plots.fans.fans import is_scan, name_of

from .fan_frames import log_fan
from .page import RECORDING, ViewerPage
from .poses import log_poses
from .view_log import ViewLog, sdk
from .waterfalls import log_waterfall

SUFFIX = ".rrd"


def view(*shown: FilePath | xr.Dataset, save: FilePath | None = None, tvg: Tvg = "recorder",
         cell: float | None = None, port: int = 0, browser: bool = False) -> ViewerPage | None:
    """Show records in a page of the browser, with a time line, layers to switch and the sonar in space.

    Parameters
    ----------
    *shown : str, path or xarray.Dataset
        Images, or files of them.
    save : str or path, optional
        File to write instead, ending in .rrd, which ``rerun FILE`` and the page of app.rerun.io open.
    tvg : {'seabed', 'target', 'recorder', 'counts', None}
        Gain over range of shown levels, as for `mitsonar.plots.plot`.
    cell : float or None [m]
        Side of a cell of frames of fans. None: a bin, with at most 640 cells along a side.
    port : int
        Port of the page on this machine. 0: any.
    browser : bool
        If True, open the page in the browser. A notebook shows the page that is returned.

    Returns
    -------
    ViewerPage or None
        The page, served until it is closed or the process ends; None if a file was written.

    Raises
    ------
    ValueError
        If there is nothing to show, a record has no picture, or rerun-sdk is not installed.
    FileNotFoundError, PermissionError, OSError
        If a file cannot be read or written.
    """
    if not shown:
        raise ValueError("there is nothing to show; give one or more records.")
    if save is not None:
        checked_suffix(save, (SUFFIX,))
        check_writable(save)
        sdk()
        with replacing(save) as temporary:
            _record(shown, temporary, tvg, cell)
        return None
    sdk()
    folder = Path(tempfile.mkdtemp(prefix="mitsonar_view_"))
    try:
        title = ", ".join(_record(shown, folder / RECORDING, tvg, cell))
        page = ViewerPage(folder, title, port)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    if browser:
        page.open()
    return page


def _record(shown, path: Path, tvg: Tvg, cell: float | None) -> list[str]:
    """Write a recording of records; return their names."""
    names: list[str] = []
    with ViewLog(path).ended() as log:
        for one in shown:
            with _named(one) as (name, record):
                name = next(choice for choice in (name, *(f"{name}_{number}" for number in range(2, len(shown) + 2)))
                            if choice not in names)
                names.append(name)
                _log(log, name, record, tvg, cell)
    return names


@contextmanager
def _named(one: FilePath | xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Open a record; errors name its file."""
    from mitsonar.io import reading

    if not isinstance(one, (str, os.PathLike)):
        yield _word(name_of(one) if isinstance(one, xr.Dataset) else ""), one
        return
    try:
        yield _word(Path(one).stem), reading.read(one)     # pyright: ignore[reportReturnType]  checked by `_log`
    except ValueError as error:
        told = str(error)
        raise ValueError(told if os.fspath(one) in told else f"cannot show {one}: {told}") from None


def _word(name: str) -> str:
    """Return a name as part of the path of an entity."""
    return re.sub(r"[^\w.-]", "_", name) or "record"


def _log(log: ViewLog, name: str, record: xr.Dataset, tvg: Tvg, cell: float | None) -> None:
    """Log a record by its kind."""
    if not isinstance(record, xr.Dataset) or not {"ping", "range"} <= set(record["level"].dims if "level" in record
                                                                           else ()):
        raise ValueError("it is no image with levels over pings and range, as mitsonar render makes it; give one.")
    if cell is not None and not ("beam" in record.dims or is_scan(record)):
        raise ValueError("a cell is of fans of beams, and the record is none; leave it out.")
    if not all(record.sizes.values()):
        raise ValueError(f"there is nothing to show: the record has {dict(record.sizes)}.")
    record, tvg = recorded(record, tvg)
    if is_scan(record) or record.sizes.get("beam", 0) > 1:
        log_fan(log, name, record, tvg, cell)
    else:
        log_waterfall(log, name, record.isel(beam=0, drop=True) if "beam" in record.dims else record, tvg)
    log_poses(log, name, record)
