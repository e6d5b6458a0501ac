"""Sheet of a fan of beams: axes in metres, rings of equal range and titles, drawn frame by frame.

A pixel shows the mean power of the bins that it covers, or, where bins are larger, a value interpolated between them
(`mitsonar.imaging.maps.raster_map`). Therefore far beams show no steps, near beams no moiré, and speckle no isolated
dark pixels. Values that must not be mixed, such as labels, are those of the nearest bin.
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

SIZE = 900                         # pixels of the longer side of the fan
BEFORE, BEHIND, UNDER, OVER = 84, 150, 62, 86          # pixels left of the fan, right (with colour bar), below, above
BESIDE_RINGS = 60                  # width [pixels] of the ranges written at the rings
BESIDE_BAR = 40                    # pixels between the fan and its colour bar, where the rings' ranges are written
WAYS = (("aft", "forward"), ("port", "starboard"), ("up", "down"))     # directions against and along the body's axes
TOWARDS = {"forward": "ahead", "aft": "astern", "starboard": "to starboard", "port": "to port", "down": "below",
           "up": "above"}


@dataclass(frozen=True, kw_only=True)
class FanView:
    """Places of a fan's bins on the sheet, the same for all frames."""

    angle: np.ndarray              # (B,) beams from the middle of the fan, positive to the right [rad]
    slant_range: np.ndarray        # (N,) [m]
    facing: str                    # name of the body's direction along the middle of the fan
    right: str                     # name of the direction to its right
    grid: FanGrid
    map: FanMap

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Left, right, lower and upper edge of the picture [m]; in a fan that looks down, values grow downwards."""
        half = 0.5 * self.grid.cell
        x, y = self.grid.x, self.grid.y
        ends = (y.min() - half, y.max() + half)
        return (x[0] - half, x[-1] + half, *(ends[::-1] if self.facing == "down" else ends))


def view_of(angle: np.ndarray, slant_range: np.ndarray, facing: str, right: str) -> FanView:
    """Return the layout of a fan on the sheet; the arguments are the fields of `FanView`."""
    left, farthest, near, far = reach(angle, slant_range)
    grid = fan_grid(angle, slant_range, max(farthest - left, far - near) / SIZE, downwards=facing == "down")
    return FanView(angle=angle, slant_range=slant_range, facing=facing, right=right, grid=grid,
                   map=fan_map(angle, slant_range, grid))


class FanSheet:
    """Sheet with the axes of a fan, in which images are shown one after the other."""

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
        if keys:                                                             # beside the rings' ranges
            canvas.legend(axes, keys, height).set_bbox_to_anchor((1 + 0.5 * BESIDE_RINGS / width, 1.0))
        if bar:
            canvas.colour_bar(self._image, axes, bar, "both", gap=BESIDE_BAR)
        self._still: Any = None

    def show(self, image: np.ndarray) -> None:
        """Show an image of values (rows, columns) or of colours (rows, columns, 3)."""
        self._image.set_data(image)

    def pixels(self, image: np.ndarray, subtitle: str) -> np.ndarray:
        """Return the sheet with an image and a subtitle as colours (rows, columns, 3) uint8."""
        paper = cast(FigureCanvasAgg, self.figure.canvas)
        moving: list[Artist] = [self._image, *self._rings, self._words]
        if self._still is None:                                              # the rest of the sheet is drawn once
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
    """Draw a few rings of equal range, with the range at their right ends."""
    step = canvas.round_length(float(np.ptp(view.slant_range)) / 3)
    angle, rings = np.linspace(view.angle.min(), view.angle.max(), 200), []
    for ring in np.arange(np.ceil(view.slant_range[0] / step) * step, view.slant_range[-1], step):
        rings += axes.plot(ring * np.sin(angle), ring * np.cos(angle), color=canvas.INK, linewidth=0.5, alpha=0.35,
                           scalex=False, scaley=False)
        rings.append(axes.text(ring * np.sin(angle[-1]), ring * np.cos(angle[-1]), f" {ring:g} m", color=canvas.INK,
                               fontsize=9, va="top", path_effects=[withStroke(linewidth=2, foreground=canvas.PAPER)]))
    return rings
