"""Water column of a line as a video: a frame for each ping with its soundings, in one dynamic range."""
from __future__ import annotations

from collections.abc import Callable

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap
from matplotlib.figure import Figure

from mitsonar.device.files import FilePath
from mitsonar.hydrography.record import check
from mitsonar.imaging.gain import Tvg

from .. import canvas
from ..fans.movie_files import movie_file
from .column_plot import soundings_of
from .line_sheet import line_title
from .water_column import BLOCK, Box, ColumnFan, column_window, fan_of_ping, has_column

SAMPLED = 12                       # pings that determine the frame and the dynamic range
SLOWEST_FPS, FASTEST_FPS = 1.0, 30.0
WIDE, HIGHEST = 900, 800           # width of the fan and its largest height, in pixels
BEFORE, BEHIND, UNDER, OVER = 84, 128, 62, 86


def column_video(line: xr.Dataset, path: FilePath, *, fps: float | None = None, tvg: Tvg = "recorder",
                 limits: tuple[float, float] | None = None, colours: Colormap = canvas.COPPER,
                 width: int | None = None, progress: Callable[[int, int], None] | None = None) -> None:
    """Draw the fans of all pings of a line as frames of a video; arguments and errors as in `mitsonar.plots.video`.

    Pings without samples are left out. Only a few pings are in memory at a time.
    """
    check(line)
    pings = line.sizes["ping"]
    sample = [fan for ping in np.unique(np.linspace(0, max(pings - 1, 0), SAMPLED).astype(int)).tolist()
              if has_column(line) and pings and (fan := _fan(line, ping, tvg)) is not None]
    if not sample:
        raise ValueError("the line has no ping with a water column, so there is no video to make; keep the column when "
                         "the line is made.")
    box = (min(fan.box[0] for fan in sample), max(fan.box[1] for fan in sample), max(fan.box[2] for fan in sample))
    window = limits or column_window(*(fan.image for fan in sample))
    frame = _VideoFrame(line, sample, window, colours)
    with movie_file(path, _fps(line) if fps is None else fps, colours, width) as add_frame:
        for first in range(0, pings, BLOCK):
            block = line.isel(ping=slice(first, first + BLOCK)).load()
            for ping in range(block.sizes["ping"]):
                fan = _fan(block, ping, tvg, box)
                if fan is not None:
                    add_frame(frame.pixels(fan, block, ping, first + ping))
                if progress is not None:
                    progress(first + ping + 1, pings)


def _fan(line: xr.Dataset, ping: int, tvg: Tvg, box: Box | None = None) -> ColumnFan | None:
    """Return the fan of a ping, or None if it has no samples."""
    try:
        return fan_of_ping(line, ping, tvg=tvg, box=box)
    except ValueError:
        return None


def _fps(line: xr.Dataset) -> float:
    apart = np.diff(line["ping_time"].values)
    apart = apart[np.isfinite(apart) & (apart > 0)]
    return float(np.clip(1 / np.median(apart), SLOWEST_FPS, FASTEST_FPS)) if apart.size else SLOWEST_FPS


class _VideoFrame:
    """Sheet that shows one fan after the other."""

    def __init__(self, line: xr.Dataset, sample: list[ColumnFan], window: tuple[float, float],
                 colours: Colormap) -> None:
        ends = np.array([fan.extent for fan in sample])
        port, upper = (float(end) for end in ends[:, [0, 3]].min(0))
        starboard, lower = (float(end) for end in ends[:, [1, 2]].max(0))
        wide = float(min(WIDE, HIGHEST * (starboard - port) / (lower - upper)))
        high = max(wide * (lower - upper) / (starboard - port), 120.0)
        self.figure: Figure = canvas.sheet(round(BEFORE + wide + BEHIND), round(UNDER + high + OVER), canvas.PAPER)
        self.axes: Axes = self.figure.add_axes(canvas.shares_of(self.figure, BEFORE, UNDER, wide, high),
                                               facecolor=canvas.PAPER)
        self.image = self.axes.imshow(sample[0].image, origin="upper", extent=sample[0].extent, cmap=colours,
                                      vmin=window[0], vmax=window[1], interpolation="nearest", aspect="auto")
        self.dots = self.axes.plot([], [], ".", color=canvas.INK, markersize=2.2, markeredgewidth=0)[0]
        self.axes.set(xlim=(port, starboard), ylim=(lower, upper))
        self.axes.set_xlabel("port   ←   across track [m]   →   starboard", color=canvas.INK)
        self.axes.set_ylabel("depth [m]", color=canvas.INK)
        self.axes.tick_params(colors=canvas.INK)
        self.words = canvas.headings(self.figure, BEFORE, line_title(line), "")
        canvas.colour_bar(self.image, self.axes, f"level{sample[0].gain}  [dB]", "both")

    def pixels(self, fan: ColumnFan, block: xr.Dataset, ping: int, number: int) -> np.ndarray:
        """Return the sheet with a fan as colours (rows, columns, 3) uint8."""
        across, depth, there, _ = soundings_of(block, ping)
        self.image.set_data(fan.image)
        self.image.set_extent(fan.extent)
        self.dots.set_data(across[there], depth[there])
        self.words.set_text(f"ping {number}, {float(block['ping_time'][ping]):.2f} s")
        paper = self.figure.canvas
        assert isinstance(paper, FigureCanvasAgg)
        paper.draw()
        return np.array(paper.buffer_rgba())[..., :3]
