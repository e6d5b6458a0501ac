"""Pings of a sonar with a fan of beams as a video: one frame a ping, one dynamic range for all.

Records are read one after another and frames drawn one after another, so memory does not grow with their number.
"""
from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr

from ..io.files import FilePath
from ..io.reading import read
from . import canvas
from .fan_sheet import FanSheet, FanView
from .fans import fan_heard, fan_levels, fan_view, fan_window, name_of, words_of
from .gain import Tvg
from .movie_files import movie_file

__all__ = ["video"]

SAMPLED = 12                       # frames that the dynamic range is taken from
USUAL_FPS = 10.0                   # where pings have no times
SLOWEST_FPS, FASTEST_FPS = 1.0, 30.0           # where it is not written: slower pings are shown faster, and so on


def video(records: xr.Dataset | FilePath | Sequence[xr.Dataset | FilePath], path: FilePath, *,
          fps: float | None = None, tvg: Tvg = "seabed", limits: tuple[float, float] | None = None,
          colours: str = "copper", progress: Callable[[int, int], None] | None = None) -> None:
    """Draw all pings of records as frames of a video.

    Parameters
    ----------
    records : xarray.Dataset, str or path, or a sequence of these
        What `mitsonar.render` gives of an array, or files of it: ``level`` (ping, beam, range) [dB re 1 µPa], all of
        the same beams and ranges.
    path : str or path
        Ending in .gif or .mp4, or the name of a folder that gets a PNG a frame.
    fps : float, optional [Hz]
        Frames a second; by default that of the pings, from 1 to 30.
    tvg : {'seabed', 'target', None}
        Gain for display (see `mitsonar.plots.gain`).
    limits : pair of float, optional [dB]
        Levels of the first and the last colour, with their gain; by default what twelve of the frames need.
    colours : str
        ``copper`` or ``grey``.
    progress : callable(done, total), optional
        Called after every record with the number of records.

    Raises
    ------
    ValueError
        If there is no fan in a record, they differ in beams or ranges, or an argument is not as above.
    FileNotFoundError, PermissionError, OSError
        If a file cannot be read or written.

    Notes
    -----
    An MP4 needs the program ffmpeg, as the package ``imageio-ffmpeg`` brings it.
    """
    given = [records] if isinstance(records, xr.Dataset) or not isinstance(records, Sequence) or isinstance(
        records, str) else list(records)
    if not given:
        raise ValueError("there is no record to make a video of; give one or more.")
    if fps is not None and not 0 < fps <= 1000:
        raise ValueError(f"the video has {fps:g} frames a second; give a number above 0 and at most 1000.")
    shades = canvas.colours_of(colours)
    first = _opened(given[0])
    view = fan_view(first)
    heard = fan_heard(first, _spread(first.sizes["ping"], SAMPLED), tvg)
    words = fan_levels(first, 0, tvg, heard)[1]
    with movie_file(path, _fps(first) if fps is None else fps, shades) as movie:
        sheet = FanSheet(view, title=name_of(first), colours=shades, limits=limits or _limits(given, view, tvg, heard),
                         bar=f"level{words}  [dB re 1 µPa]")
        for number, record in enumerate(given):
            dataset = first if number == 0 else _alike(_opened(record), view)
            for ping in range(dataset.sizes["ping"]):
                image = view.map.levels(fan_levels(dataset, ping, tvg, heard)[0])
                movie.add(sheet.pixels(image, words_of(dataset, ping)))
            if progress is not None:
                progress(number + 1, len(given))


def _opened(record: xr.Dataset | FilePath) -> xr.Dataset:
    dataset = record if isinstance(record, xr.Dataset) else read(record)
    if not isinstance(dataset, xr.Dataset) or set(getattr(dataset.get("level"), "dims", ())) != {
            "ping", "beam", "range"} or dataset.sizes["beam"] < 2:
        name = "the record" if isinstance(record, xr.Dataset) else str(record)
        raise ValueError(f"a video is made of records of two or more beams, level over (ping, beam, range); {name} is "
                         "none.")
    return dataset


def _alike(dataset: xr.Dataset, view: FanView) -> xr.Dataset:
    """The dataset, if it has the beams and ranges of the first."""
    if not (np.array_equal(dataset["beam"], view.angle) and np.array_equal(dataset["range"], view.slant_range)):
        raise ValueError(f"a record with {dataset.sizes['beam']} beams to {float(dataset['range'][-1]):g} m follows "
                         f"one with {len(view.angle)} to {view.slant_range[-1]:g} m; make a video of each.")
    return dataset


def _limits(records: Sequence[xr.Dataset | FilePath], view: FanView, tvg: Tvg, heard: int) -> tuple[float, float]:
    """The window of frames that are spread over all records."""
    chosen, images = _spread(len(records), SAMPLED), []
    for record in chosen:
        dataset = _alike(_opened(records[record]), view)
        images += [view.map.levels(fan_levels(dataset, ping, tvg, heard)[0])
                   for ping in _spread(dataset.sizes["ping"], -(-SAMPLED // len(chosen)))]
    return fan_window(np.stack(images))


def _spread(count: int, most: int) -> list[int]:
    """Numbers below ``count`` that are spread evenly, the first and the last among them."""
    return np.unique(np.linspace(0, count - 1, most).round().astype(int)).tolist()


def _fps(dataset: xr.Dataset) -> float:
    """Pings a second, as far as a video can show them."""
    if "ping_time" not in dataset.coords or dataset.sizes["ping"] < 2:
        return USUAL_FPS
    apart = float(np.median(np.diff(dataset["ping_time"].values.astype(float))))
    return float(np.clip(1 / apart, SLOWEST_FPS, FASTEST_FPS)) if apart > 0 else USUAL_FPS
