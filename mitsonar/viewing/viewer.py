"""Choose how scenes and records are shown by what they are, and record or serve that."""
from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, count
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import xarray as xr

from mitsonar.device.files import FilePath, check_writable, checked_suffix, replacing
from mitsonar.imaging.focused import is_focused
from mitsonar.imaging.gain import Tvg
from mitsonar.imaging.recording import shown as recorded
from mitsonar.io import reading
from mitsonar.io.scene_files import scenes
from mitsonar.plots.fans.fans import is_scan, name_of
from mitsonar.plots.lines.line_views import is_line

from .fan_frames import log_fan
from .focused_image import log_focused
from .page import RECORDING, ViewerPage
from .poses import log_poses
from .sounded_line import log_line
from .view_log import ViewLog, sdk
from .waterfalls import log_waterfall

if TYPE_CHECKING:                       # a page of records needs no Mitsuba
    import mitsuba as mi

SUFFIX = ".rrd"
Shown: TypeAlias = "FilePath | xr.Dataset | mi.Scene"


@dataclass(frozen=True, kw_only=True)
class ViewOptions:
    """Hold how scenes and records are shown; the fields are arguments of `view`."""

    tvg: Tvg = "recorder"
    cell: float | None = None
    sensor: int | str = 0
    parameters: Mapping[str, object] = field(default_factory=dict)


def view(*shown: Shown, save: FilePath | None = None, tvg: Tvg = "recorder",
         cell: float | None = None, sensor: int | str = 0, port: int = 0, browser: bool = False,
         **parameters: object) -> ViewerPage | None:
    """Show scenes and records in a page of the browser, with a time line, layers to switch and the sonar in space.

    Parameters
    ----------
    *shown : str, path, xarray.Dataset or mitsuba.Scene
        Scenes as in `mitsonar.render`, which are shown as before rendering; images and lines of soundings, or
        files of them.
    save : str or path, optional
        File to write instead, ending in .rrd, which ``rerun FILE`` opens.
    tvg : {'seabed', 'target', 'recorder', 'counts', None}
        Gain over range of shown levels, as for `mitsonar.plots.plot`.
    cell : float or None [m]
        Side of a cell of frames of fans. None: a bin, with at most 640 cells along a side.
    sensor : int or str
        Number or id of one of the sensors of scenes.
    port : int
        Port of the page on this machine. 0: any.
    browser : bool
        If True, open the page in the browser. A notebook shows the page that is returned.
    **parameters
        Values for the ``$parameters`` of scenes.

    Returns
    -------
    ViewerPage or None
        The page, served until it is closed or the process ends; None if a file was written.

    Raises
    ------
    ValueError
        If there is nothing to show, a record has no picture, a scene cannot be rendered, parameters are given without
        a scene, or rerun-sdk is not installed.
    FileNotFoundError, PermissionError, OSError
        If a file cannot be read or written.
    """
    page = opened(shown, ViewOptions(tvg=tvg, cell=cell, sensor=sensor, parameters=parameters), save=save, port=port)
    if browser and page is not None:
        page.open()
    return page


def opened(shown: Sequence[Shown], options: ViewOptions, *, save: FilePath | None, port: int) -> ViewerPage | None:
    """Write or serve a page; see `view`."""
    if not shown:
        raise ValueError("there is nothing to show; give one or more scenes or records.")
    if options.parameters and not any(map(_is_scene, shown)):
        raise ValueError(f"{', '.join(options.parameters)} would be of a scene, and only records are shown; leave it "
                         "out.")
    if save is not None:
        checked_suffix(save, (SUFFIX,))
        check_writable(save)
        sdk()
        with replacing(save) as temporary:
            _record(shown, temporary, options)
        return None
    sdk()
    folder = Path(tempfile.mkdtemp(prefix="mitsonar_view_"))
    try:
        title = ", ".join(_record(shown, folder / RECORDING, options))
        page = ViewerPage(folder, title, port)
    except BaseException:
        shutil.rmtree(folder, ignore_errors=True)
        raise
    return page


def _record(shown: Sequence[Shown], path: Path, options: ViewOptions) -> list[str]:
    """Write a recording of scenes and records; return their names."""
    names: list[str] = []
    with ViewLog(path).ended() as log:
        for one in shown:
            name = _word(Path(one).stem if isinstance(one, (str, os.PathLike)) else
                         name_of(one) if isinstance(one, xr.Dataset) else "scene")
            names.append(next(choice for choice in chain([name], (f"{name}_{number}" for number in count(2)))
                              if choice not in names))
            if _is_scene(one):
                from .scene_space import log_scene

                log_scene(log, names[-1], scenes.find(one) if isinstance(one, str) else one, options.sensor,
                          options.parameters)
            elif isinstance(one, (str, os.PathLike)):
                _log_file(log, names[-1], one, options)
            else:
                _log(log, names[-1], one, options)
    return names


def _is_scene(one: object) -> bool:
    """Return True for a loaded scene, and for a path that is one by its suffix, or the name of a shipped scene."""
    if isinstance(one, (str, os.PathLike)):
        return Path(one).suffix.lower() == ".xml" or str(one) in scenes.shipped() and not os.path.exists(one)
    return not isinstance(one, (xr.Dataset, xr.DataArray))


def _log_file(log: ViewLog, name: str, path: FilePath, options: ViewOptions) -> None:
    """Log the record in a file; errors name it."""
    try:
        _log(log, name, reading.read(path), options)
    except ValueError as error:
        told = str(error)
        raise ValueError(told if os.fspath(path) in told else f"cannot show {path}: {told}") from None


def _word(name: str) -> str:
    """Return a name as part of the path of an entity."""
    return re.sub(r"[^\w.-]", "_", name) or "record"


def _log(log: ViewLog, name: str, record: object, options: ViewOptions) -> None:
    """Log a record by its kind."""
    line = isinstance(record, xr.Dataset) and is_line(record)
    if not isinstance(record, xr.Dataset) or not (line or is_focused(record) and "level" in record or "level" in record
                                                  and {"ping", "range"} <= set(record["level"].dims)):
        raise ValueError("it is no image with levels and no line of soundings; give a record of mitsonar render, "
                         "soundings or focus.")
    if not all(record.sizes.values()):
        raise ValueError(f"there is nothing to show: the record has {dict(record.sizes)}.")
    record, tvg = (record, options.tvg) if line else recorded(record, options.tvg)
    fan = not line and (is_scan(record) or record.sizes.get("beam", 0) > 1)
    if options.cell is not None and not fan:
        raise ValueError("a cell is of fans of beams, and the record is none; leave it out.")
    if line:
        log_line(log, name, record, tvg)
    elif is_focused(record):
        log_focused(log, name, record)
    elif fan:
        log_fan(log, name, record, tvg, options.cell)
    else:
        log_waterfall(log, name, record.isel(beam=0, drop=True) if "beam" in record.dims else record, tvg)
    log_poses(log, name, record)
