"""Pings of a sonar with a fan of beams as a video: one frame a ping, one dynamic range for all.

Records are read one after another and frames drawn one after another, so memory does not grow with their number.
"""
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.imaging.gain import Tvg
from mitsonar.io.reading import is_netcdf, read
from mitsonar.io.records import netcdf

from .. import canvas
from ..lines.column_video import column_video
from ..lines.line_views import is_line
from .fan_sheet import FanSheet, FanView
from .fans import fan_heard, fan_levels, fan_view, fan_window, name_of, words_of
from .movie_files import check_movie, movie_file

SAMPLED = 12                       # frames that the dynamic range is taken from
USUAL_FPS = 10.0                   # where pings have no times
SLOWEST_FPS, FASTEST_FPS = 1.0, 30.0           # where it is not written: slower pings are shown faster, and so on


def video(records: xr.Dataset | FilePath | Iterable[xr.Dataset | FilePath], path: FilePath, *,
          fps: float | None = None, tvg: Tvg = "seabed", limits: tuple[float, float] | None = None,
          colours: str = "copper", progress: Callable[[int, int], None] | None = None) -> None:
    """Draw all pings of records as frames of a video.

    Parameters
    ----------
    records : xarray.Dataset, str or path, or any number of these
        What `mitsonar.render` or `mitsonar.frames` give of an array, or files of it: ``level`` (ping, beam, range)
        [dB re 1 µPa], all of the same beams and ranges. Or one line of soundings, whose water column is drawn.
    path : str or path
        Ending in .gif or .mp4, or the name of a folder that gets a PNG a frame.
    fps : float, optional [Hz]
        Frames a second; by default that of the pings, from 1 to 30.
    tvg : {'seabed', 'target', 'recorder', None}
        Gain for display (see `mitsonar.plots.images.gain`).
    limits : pair of float, optional [dB]
        Levels of the first and the last colour, with their gain; by default what twelve of the frames need: spread
        over all records, or the first where these are made one after the other.
    colours : str
        ``copper`` or ``grey``.
    progress : callable(done, total), optional
        Called after every record with the number of records, where that is known.

    Raises
    ------
    ValueError
        If there is no fan in a record, they differ in beams or ranges, or an argument is not as above.
    FileNotFoundError, PermissionError, OSError
        If a file cannot be read or written.

    Notes
    -----
    An MP4 needs the extra ``video``: ``pip install 'mitsonar[video]'``.
    """
    if fps is not None and not 0 < fps <= 1000:
        raise ValueError(f"the video has {fps:g} frames a second; give a number above 0 and at most 1000.")
    shades = canvas.colours_of(colours)
    check_movie(path)
    if isinstance(records, (str, os.PathLike)) and is_netcdf(records):
        with netcdf.opened(records) as opened:                     # a water column may be larger than memory
            if isinstance(opened, xr.Dataset) and is_line(opened):
                column_video(opened, path, fps=fps, tvg=tvg, limits=limits, colours=shades, progress=progress)
                return
    if isinstance(records, xr.Dataset) and is_line(records):
        column_video(records, path, fps=fps, tvg=tvg, limits=limits, colours=shades, progress=progress)
        return
    sample, given, total = _looked_into(records)
    view = fan_view(sample[0])
    frames = [(_alike(dataset, view), ping) for dataset in sample
              for ping in _spread(dataset.sizes["ping"], -(-SAMPLED // len(sample)))]
    heard = max(fan_heard(dataset, [ping], tvg) for dataset, ping in frames)
    words = fan_levels(*frames[0], tvg, heard)[1]
    with movie_file(path, _fps(sample) if fps is None else fps, shades) as movie:
        window = limits or fan_window(np.stack([view.map.levels(fan_levels(*frame, tvg, heard)[0])
                                                for frame in frames]))
        sheet = FanSheet(view, title=name_of(sample[0]), colours=shades, limits=window,
                         bar=f"level{words}  [dB re 1 µPa]")
        for number, record in enumerate(given, 1):
            dataset = _alike(_opened(record), view)
            for ping in range(dataset.sizes["ping"]):
                image = view.map.levels(fan_levels(dataset, ping, tvg, heard)[0])
                movie.add(sheet.pixels(image, words_of(dataset, ping)))
            if progress is not None and total:
                progress(number, total)


def _looked_into(records: xr.Dataset | FilePath | Iterable[xr.Dataset | FilePath]) -> tuple[
        list[xr.Dataset], Iterable[xr.Dataset | FilePath], int]:
    """Some of the records, at least one, of which the view and the window are made; all; how many, 0 if unknown."""
    if isinstance(records, (xr.Dataset, str, os.PathLike)):
        records = [records]
    if isinstance(records, Sequence) and records:
        return [_opened(records[number]) for number in _spread(len(records), SAMPLED)], records, len(records)
    rest: Iterator[xr.Dataset | FilePath] = iter(records)
    first = [_opened(record) for record in itertools.islice(rest, SAMPLED)]
    if not first:
        raise ValueError("there is no record to make a video of; give one or more.")
    return first, itertools.chain(first, rest), 0


def _opened(record: xr.Dataset | FilePath) -> xr.Dataset:
    """The levels of a record, of which several are kept at a time."""
    dataset = record if isinstance(record, xr.Dataset) else read(record)
    if not isinstance(dataset, xr.Dataset) or set(getattr(dataset.get("level"), "dims", ())) != {
            "ping", "beam", "range"} or dataset.sizes["beam"] < 2:
        name = "the record" if isinstance(record, xr.Dataset) else str(record)
        raise ValueError(f"a video is made of records of two or more beams, level over (ping, beam, range); {name} is "
                         "none.")
    return dataset[["level"]]


def _alike(dataset: xr.Dataset, view: FanView) -> xr.Dataset:
    """The dataset, if it has the beams and ranges of the first."""
    if not (np.array_equal(dataset["beam"], view.angle) and np.array_equal(dataset["range"], view.slant_range)):
        raise ValueError(f"a record with {dataset.sizes['beam']} beams to {float(dataset['range'][-1]):g} m follows "
                         f"one with {len(view.angle)} to {view.slant_range[-1]:g} m; make a video of each.")
    return dataset


def _spread(count: int, most: int) -> list[int]:
    """Numbers below ``count`` that are spread evenly, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int)).tolist()


def _fps(sample: Sequence[xr.Dataset]) -> float:
    """Pings a second, as far as a video can show them."""
    if not all("ping_time" in dataset.coords for dataset in sample):
        return USUAL_FPS
    ping, time = (np.concatenate([dataset[name].values for dataset in sample]) for name in ("ping", "ping_time"))
    on = np.diff(ping) > 0                             # the sample leaves pings out, and records may count anew
    apart = float(np.median(np.diff(time)[on] / np.diff(ping)[on])) if on.any() else 0.0
    return float(np.clip(1 / apart, SLOWEST_FPS, FASTEST_FPS)) if apart > 0 else USUAL_FPS
