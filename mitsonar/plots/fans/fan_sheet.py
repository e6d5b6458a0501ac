"""The sheet that a fan of beams is drawn on: axes in metres, rings of equal range, headings, frame after frame.

An element of the picture is an element of the sheet. It shows the mean power of the bins that it covers, or lies
between those around it (`mitsonar.imaging.maps.raster_map`): so far beams have no steps, near ones no moiré, and faint
bins of a speckle no pepper. What must not be mixed, as labels, is that of the nearest bin.
"""
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import Colormap
from matplotlib.figure import Figure
from matplotlib.image import AxesImage
from matplotlib.patheffects import withStroke

from mitsonar.imaging.maps.raster_map import FanGrid, FanMap, fan_grid, fan_map, reach

from .. import canvas

SIZE = 900                         # picture elements of the larger side of the fan
BEFORE, BEHIND, UNDER, OVER = 84, 150, 62, 86                  # picture elements around it; behind: a colour bar
BESIDE_RINGS = 60                  # picture elements that the rings' lengths take
BESIDE_BAR = 40                    # picture elements from the fan to its colour bar, for the rings' lengths
WAYS = (("aft", "forward"), ("port", "starboard"), ("up", "down"))               # against and along the body's axes
TOWARDS = {"forward": "ahead", "aft": "astern", "starboard": "to starboard", "port": "to port", "down": "below",
           "up": "above"}


@dataclass(frozen=True, kw_only=True)
class FanView:
    """Places of a fan's bins on the sheet, the same for all frames."""

    angle: np.ndarray  # (B,) [rad]: of the beams, from the middle of the fan, positive to the right
    slant_range: np.ndarray  # (N,) [m]
    facing: str  # name of the body's direction along the middle of the fan
    right: str  # name of the direction to its right
    grid: FanGrid
    map: FanMap

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper edge of the picture [m]; what lies below grows downwards."""
        half = 0.5 * self.grid.cell
        x, y = self.grid.x, self.grid.y
        ends = (y.min() - half, y.max() + half)
        return (x[0] - half, x[-1] + half, *(ends[::-1] if self.facing == "down" else ends))


def view_of(angle: np.ndarray, slant_range: np.ndarray, facing: str, right: str) -> FanView:
    """Lay a fan out over the sheet."""
    # angle (B,) [rad]; slant_range (N,) [m]
    left, farthest, near, far = reach(angle, slant_range)
    grid = fan_grid(angle, slant_range, max(farthest - left, far - near) / SIZE, downwards=facing == "down")
    return FanView(angle=angle, slant_range=slant_range, facing=facing, right=right, grid=grid,
                   map=fan_map(angle, slant_range, grid))


class FanSheet:
    """A sheet with the frame of a fan, on which pictures are shown one after the other."""

    def __init__(self, view: FanView, *, title: str, subtitle: str = "", colours: Colormap = canvas.COPPER,
                 limits: tuple[float, float] = (0.0, 1.0), bar: str = "", keys: Sequence[Artist] = ()) -> None:
        height, width = view.grid.shape
        behind: float = BEHIND
        if keys:
            legend = canvas.legend(canvas.sheet(1, 1).add_subplot(), keys, height)
            behind = BESIDE_RINGS + legend.get_window_extent().width
        self.figure: Figure = canvas.sheet(BEFORE + width + behind, UNDER + height + OVER, canvas.PAPER)
        axes = self.figure.add_axes(canvas.shares_of(self.figure, BEFORE, UNDER, width, height),
                                    facecolor=canvas.PAPER)
        self._image: AxesImage = axes.imshow(
            np.full(view.grid.shape, np.nan), origin="upper", aspect="auto", extent=view.extent,
            interpolation="nearest", cmap=colours, vmin=limits[0], vmax=limits[1])
        self._rings = _rings(axes, view)
        _name_axes(axes, view)
        self._words = canvas.headings(self.figure, BEFORE, title, subtitle)
        if keys:                                                             # beside the rings' lengths
            canvas.legend(axes, keys, height).set_bbox_to_anchor((1 + 0.5 * BESIDE_RINGS / width, 1.0))
        if bar:
            canvas.colour_bar(self._image, axes, bar, "both", gap=BESIDE_BAR)
        self._still: Any = None

    def show(self, image: np.ndarray) -> None:
        """Put a picture into the frame: values (rows, columns), or colours (rows, columns, 3)."""
        self._image.set_data(image)

    def pixels(self, image: np.ndarray, subtitle: str) -> np.ndarray:
        """Return the sheet with a picture and a subtitle as colours (rows, columns, 3) uint8; the rest is drawn once.
        """
        paper = cast(FigureCanvasAgg, self.figure.canvas)
        moving: list[Artist] = [self._image, *self._rings, self._words]
        if self._still is None:
            for artist in moving:
                artist.set_animated(True)
            paper.draw()
            self._still = paper.copy_from_bbox(self.figure.bbox)
        paper.restore_region(self._still)
        self.show(image)
        self._words.set_text(subtitle)
        for artist in moving:
            artist.draw(paper.get_renderer())
        return np.array(paper.buffer_rgba())[..., :3]


def _name_axes(axes: Axes, view: FanView) -> None:
    left = next(way for pair in WAYS if view.right in pair for way in pair if way != view.right)
    axes.set_xlabel(f"{left}        ←        [m]        →        {view.right}", color=canvas.INK, fontsize=11)
    axes.set_ylabel(f"{TOWARDS[view.facing]} [m]", color=canvas.INK, fontsize=11)
    axes.tick_params(colors=canvas.INK, labelsize=10)
    for spine in axes.spines.values():
        spine.set_visible(False)


def _rings(axes: Axes, view: FanView) -> list[Artist]:
    """Mark a few ranges along the fan's rim."""
    step = canvas.round_length(float(np.ptp(view.slant_range)) / 3)
    angle, rings = np.linspace(view.angle.min(), view.angle.max(), 200), []
    for ring in np.arange(np.ceil(view.slant_range[0] / step) * step, view.slant_range[-1], step):
        rings += axes.plot(ring * np.sin(angle), ring * np.cos(angle), color=canvas.INK, linewidth=0.5, alpha=0.35,
                           scalex=False, scaley=False)
        rings.append(axes.text(ring * np.sin(angle[-1]), ring * np.cos(angle[-1]), f" {ring:g} m", color=canvas.INK,
                               fontsize=9, va="top", path_effects=[withStroke(linewidth=2, foreground=canvas.PAPER)]))
    return rings
