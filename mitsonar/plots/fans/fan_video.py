"""Videos of the pings of fans of beams, one frame per ping, all with the same levels of the first and the last colour.

Records are read and frames drawn one after another, so that memory does not grow with their number.
"""
import itertools
import os
from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
import xarray as xr

from mitsonar.device.files import FilePath
from mitsonar.imaging.gain import Tvg
from mitsonar.imaging.recording import shown
from mitsonar.io.reading import is_netcdf, read
from mitsonar.io.records import netcdf

from .. import canvas
from ..lines.column_video import column_video
from ..lines.line_views import is_line
from .fan_sheet import FanSheet, FanView
from .fans import fan_heard, fan_levels, fan_view, fan_window, name_of, words_of
from .movie_files import check_movie, movie_file

SAMPLED = 12                       # number of frames that determine the levels of the first and the last colour
USUAL_FPS = 10.0                   # if pings have no times
SLOWEST_FPS, FASTEST_FPS = 1.0, 30.0           # limits of the frame rate that follows the pings


def video(records: xr.Dataset | FilePath | Iterable[xr.Dataset | FilePath], path: FilePath, *,
          fps: float | None = None, tvg: Tvg = "seabed", limits: tuple[float, float] | None = None,
          colours: str = "copper", width: int | None = None,
          progress: Callable[[int, int], None] | None = None) -> None:
    """Draw all pings of records as frames of a video.

    Parameters
    ----------
    records : xarray.Dataset, str or path, or any number of these
        Images of an array from `mitsonar.render` or `mitsonar.frames`, or their files: ``level`` (ping, beam, range)
        [dB re 1 µPa], all with the same beams and ranges. Or one line of soundings, whose water column is drawn.
    path : str or path
        File that ends in .gif or .mp4, or a folder for one PNG per frame.
    fps : float, optional [Hz]
        Frame rate; by default the rate of the pings, limited to 1 to 30.
    tvg : {'seabed', 'target', 'recorder', 'counts', None}
        Gain for display (see `mitsonar.plots.images.gain`).
    limits : pair of float, optional [dB]
        Levels of the first and the last colour, with the gain added. By default twelve frames determine them, which are
        spread over all records; if ``records`` is an iterator, they come from its first records.
    colours : str
        ``copper`` or ``grey``.
    width : int, optional [pixels]
        Largest width of the frames, 100 or more; by default that of the sheet, about 1100.
    progress : callable(done, total), optional
        Function called after every record, if the number of records is known.

    Raises
    ------
    ValueError
        If a record has no fan, records differ in beams or ranges, or an argument is not as above.
    OSError
        If a file cannot be read or written.

    Notes
    -----
    An MP4 needs the extra ``video``: ``pip install 'mitsonar[video]'``.
    """
    if fps is not None and not 0 < fps <= 1000:
        raise ValueError(f"the video has {fps:g} frames a second; give a number above 0 and at most 1000.")
    if width is not None and not width >= 100:
        raise ValueError(f"the video is {width} pixels wide; give 100 or more, or leave the width out.")
    shades = canvas.colours_of(colours)
    check_movie(path)
    if isinstance(records, (str, os.PathLike)) and is_netcdf(records):
        with netcdf.opened(records) as opened:                     # a water column may be larger than memory
            if isinstance(opened, xr.Dataset) and is_line(opened):
                column_video(opened, path, fps=fps, tvg=tvg, limits=limits, colours=shades, width=width,
                             progress=progress)
                return
    if isinstance(records, xr.Dataset) and is_line(records):
        column_video(records, path, fps=fps, tvg=tvg, limits=limits, colours=shades, width=width, progress=progress)
        return
    sample, records, total = _sampled_records(records)
    view = fan_view(sample[0])
    frames = [(shown(_alike(dataset, view), tvg)[0], ping) for dataset in sample
              for ping in _spread(dataset.sizes["ping"], -(-SAMPLED // len(sample)))]
    of_counts, tvg = tvg, None if tvg == "counts" else tvg
    heard = max(fan_heard(dataset, [ping], tvg) for dataset, ping in frames)
    words = fan_levels(*frames[0], tvg, heard)[1]
    with movie_file(path, _fps(sample) if fps is None else fps, shades, width) as add_frame:
        window = limits or fan_window(np.stack([view.map.levels(fan_levels(*frame, tvg, heard)[0])
                                                for frame in frames]))
        sheet = FanSheet(view, title=name_of(sample[0]), colours=shades, limits=window,
                         bar=f"level{words}  [dB re 1 µPa]")
        for number, record in enumerate(records, 1):
            dataset = shown(_alike(_opened(record), view), of_counts)[0]
            for ping in range(dataset.sizes["ping"]):
                image = view.map.levels(fan_levels(dataset, ping, tvg, heard)[0])
                add_frame(sheet.pixels(image, words_of(dataset, ping)))
            if progress is not None and total:
                progress(number, total)


def _sampled_records(records: xr.Dataset | FilePath | Iterable[xr.Dataset | FilePath]) -> tuple[
        list[xr.Dataset], Iterable[xr.Dataset | FilePath], int]:
    """Return up to `SAMPLED` opened records, an iterable of all records, and their number, or 0 if it is unknown."""
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
    """Return the levels and counts of a record, without its other variables."""
    dataset = record if isinstance(record, xr.Dataset) else read(record)
    if not isinstance(dataset, xr.Dataset) or set(getattr(dataset.get("level"), "dims", ())) != {
            "ping", "beam", "range"} or dataset.sizes["beam"] < 2:
        name = "the record" if isinstance(record, xr.Dataset) else str(record)
        raise ValueError(f"a video is made of records of two or more beams, with level over (ping, beam, range); "
                         f"{name} is no such record.")
    return dataset[["level", *(name for name in ("recorded",) if name in dataset)]]


def _alike(dataset: xr.Dataset, view: FanView) -> xr.Dataset:
    """Return a dataset if it has the beams and ranges of the first, else raise ValueError."""
    if not (np.array_equal(dataset["beam"], view.angle) and np.array_equal(dataset["range"], view.slant_range)):
        raise ValueError(f"a record with {dataset.sizes['beam']} beams to {float(dataset['range'][-1]):g} m follows "
                         f"one with {len(view.angle)} to {view.slant_range[-1]:g} m; make a video of each.")
    return dataset


def _spread(count: int, most: int) -> list[int]:
    """Return up to ``most`` indices below ``count``, evenly spread from the first to the last."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int)).tolist()


def _fps(sample: Sequence[xr.Dataset]) -> float:
    """Return the rate of the pings [Hz], limited to frame rates that players show well."""
    if not all("ping_time" in dataset.coords for dataset in sample):
        return USUAL_FPS
    ping, time = (np.concatenate([dataset[name].values for dataset in sample]) for name in ("ping", "ping_time"))
    rising = np.diff(ping) > 0                         # the sample skips pings, and a record may start again at 0
    interval = float(np.median(np.diff(time)[rising] / np.diff(ping)[rising])) if rising.any() else 0.0
    return float(np.clip(1 / interval, SLOWEST_FPS, FASTEST_FPS)) if interval > 0 else USUAL_FPS
