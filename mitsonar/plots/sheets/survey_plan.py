"""Map of a survey plan: depths, lines with their numbers and directions, edges of swaths, gaps in red."""
from __future__ import annotations

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import LightSource, ListedColormap, Normalize
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator
from matplotlib.transforms import IdentityTransform

from mitsonar.device.earth import Frame
from mitsonar.device.files import FilePath
from mitsonar.planning.area import corners
from mitsonar.planning.plan import SurveyLine, SurveyPlan

from .. import canvas

LONGEST_SIDE = 1100                # pixels of the map
LINE, SWATH, TURN, GAP, BORDER = "#101010", "#ffffff", "#c490f0", "#e01414", "#f2c200"
MOST_NODES = 1500                  # along a side of the drawn relief


def survey_plan(plan: SurveyPlan, path: FilePath, frame: Frame, *, title: str = "", subtitle: str = "") -> None:
    """Draw the map of a plan."""
    canvas.check_path(path)
    west, south, east, north = _extent(plan)
    scale = LONGEST_SIDE / max(east - west, north - south)
    width, height = max((east - west) * scale, 320), max((north - south) * scale, 320)
    left, bottom, right, top = 110, 84, 400, 86
    figure = canvas.sheet(left + width + right, bottom + height + top, canvas.PAPER)
    axes = figure.add_axes(canvas.shares_of(figure, left, bottom, width, height), facecolor="#3a3632")
    _relief(plan, axes)
    _gaps(plan, axes)
    _borders(plan, axes)
    _ways(plan, axes)
    _numbered(plan, axes, 0.012 * max(east - west, north - south))
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    _coordinates(axes, frame)
    _key(plan, axes)
    canvas.headings(figure, left, title, subtitle)
    canvas.save(figure, path)


def _extent(plan: SurveyPlan) -> tuple[float, float, float, float]:
    """Return the bounds of the area, the swaths, the lines and the turns, with a margin."""
    row, column = np.nonzero(plan.coverage.wanted)
    places = [np.array([[plan.bed.x[column.min()], plan.bed.y[row.min()]],
                         [plan.bed.x[column.max()], plan.bed.y[row.max()]]])]
    places += [edge for line in plan.lines for edge in _swath_edges(plan, line)]
    for line in plan.sailed:
        places += [np.stack([line.run_in, line.start, line.end]), *([line.turn.path] if line.turn is not None else [])]
    points = np.concatenate(places)
    low, high = points.min(0), points.max(0)
    margin = 0.03 * float(np.max(high - low))
    return float(low[0] - margin), float(low[1] - margin), float(high[0] + margin), float(high[1] + margin)


def _swath_edges(plan: SurveyPlan, line: SurveyLine) -> list[np.ndarray]:
    """Return the port and the starboard edge of a line's swath, each (N, 2) [m]."""
    track = line.track
    return [np.stack(plan.frame.place(track.s, track.segment.offset + side * reach), -1)
            for side, reach in ((-1, track.edges.port), (1, track.edges.starboard))]


def _relief(plan: SurveyPlan, axes: Axes) -> None:
    """Draw depths as colours, shaded from the north-west."""
    bed = plan.bed
    every = max(1, max(bed.depth.shape) // MOST_NODES)
    depth = np.where(bed.known, bed.depth, np.nan)[::every, ::every]
    shoalest, deepest = np.nanmin(depth), np.nanmax(depth)
    if deepest - shoalest < 1e-3 * deepest:
        shoalest, deepest = 0.9 * shoalest, 1.1 * deepest
    colours = colormaps["viridis_r"]
    scale = Normalize(shoalest, deepest)
    steepness = 0.1 * max(bed.step) * every * max(depth.shape) / max(float(deepest - shoalest), 1e-9)
    filled = np.where(np.isnan(depth), np.nanmean(depth), depth)
    light = LightSource(315, 45)
    shade = light.hillshade(-filled, vert_exag=steepness, dx=bed.step[0] * every, dy=-bed.step[1] * every)
    picture = colours(scale(filled))
    picture[..., :3] = np.clip(picture[..., :3] * (0.65 + 0.5 * shade[..., None]), 0, 1)
    picture[np.isnan(depth), 3] = 0.0
    axes.imshow(picture, origin="lower", interpolation="nearest", aspect="equal", extent=_bed_box(plan), zorder=1)
    drawn = axes.imshow(np.full((1, 1), np.nan), cmap=colours, norm=scale, extent=(0, 1, 0, 1), zorder=0)
    canvas.colour_bar(drawn, axes, "depth [m]", "neither").ax.invert_yaxis()


def _gaps(plan: SurveyPlan, axes: Axes) -> None:
    gap = plan.coverage.gap
    if gap.any():
        axes.imshow(np.where(gap, 0.0, np.nan), origin="lower", interpolation="nearest", aspect="equal",
                    cmap=ListedColormap([GAP]), vmin=-1, vmax=1, zorder=2, extent=_bed_box(plan))


def _bed_box(plan: SurveyPlan) -> tuple[float, float, float, float]:
    """Return the west, east, south and north edge of the cells of the bed [m]."""
    bed, half = plan.bed, [0.5 * step for step in plan.bed.step]
    return bed.x[0] - half[0], bed.x[-1] + half[0], bed.y[0] - half[1], bed.y[-1] + half[1]


def _borders(plan: SurveyPlan, axes: Axes) -> None:
    """Draw the area's border and the edges of all swaths."""
    if plan.area is not None:
        axes.add_collection(LineCollection(corners(plan.area), colors=BORDER, linewidths=1.6, zorder=4))
    edges = [edge for line in plan.lines for edge in _swath_edges(plan, line)]
    axes.add_collection(LineCollection(edges, colors=SWATH, linewidths=0.5, alpha=0.75, zorder=3))


def _ways(plan: SurveyPlan, axes: Axes) -> None:
    """Draw run-ins and turns."""
    ways = [np.stack([line.run_in, line.start]) for line in plan.sailed]
    ways += [line.turn.path for line in plan.sailed if line.turn is not None]
    axes.add_collection(LineCollection(ways, colors=TURN, linewidths=0.9, linestyles="dashed", zorder=4))


def _numbered(plan: SurveyPlan, axes: Axes, size: float) -> None:
    """Draw lines with arrows in the middle and numbers at the start, but fewer of both where lines lie close."""
    ends = [np.stack([line.start, line.end]) for line in plan.sailed]
    axes.add_collection(LineCollection(ends, colors=LINE, linewidths=1.2, zorder=5, capstyle="butt"))
    arrows, numbers = np.empty((0, 2)), np.empty((0, 2))
    for line, (start, end) in zip(plan.sailed, ends):
        middle = 0.5 * (start + end)
        if not np.any(np.hypot(*(arrows - middle).T) < 0.8 * size):
            arrows = np.vstack([arrows, middle])
            _arrow(line, axes, size)
        if not np.any(np.hypot(*(numbers - start).T) < 2.2 * size):
            numbers = np.vstack([numbers, start])
            _number(line, axes, size)


def _arrow(line: SurveyLine, axes: Axes, size: float) -> None:
    forward = np.array([np.sin(line.heading), np.cos(line.heading)])
    aside = np.array([forward[1], -forward[0]])
    tip = line.start + 0.5 * (line.end - line.start) + 0.7 * size * forward
    head = np.stack([tip, tip - 1.4 * size * forward + 0.5 * size * aside,
                     tip - 1.4 * size * forward - 0.5 * size * aside])
    axes.fill(*head.T, color=LINE, zorder=6, linewidth=0)


def _number(line: SurveyLine, axes: Axes, size: float) -> None:
    forward = np.array([np.sin(line.heading), np.cos(line.heading)])
    place = line.start + min(2 * size, 0.2 * line.length) * forward
    axes.text(float(place[0]), float(place[1]), str(line.number), color=LINE, fontsize=8, fontweight="bold",
              ha="center", va="center", zorder=7,
              bbox={"boxstyle": "round,pad=0.18", "facecolor": "#ffffff", "edgecolor": "none", "alpha": 0.85})


def _coordinates(axes: Axes, frame: Frame) -> None:
    """Label both axes in metres of the coordinate system."""
    for axis, first in zip((axes.xaxis, axes.yaxis), frame.origin):
        low, high = axis.get_view_interval()
        ticks = np.asarray(MaxNLocator(8, steps=[1, 2, 5, 10]).tick_values(low + first, high + first)) - first
        axis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
        axis.set_major_formatter(FuncFormatter(lambda value, _, first=first: f"{value + first:.0f}"))
    axes.set_xlabel(f"easting [m]{f', {frame.crs[:40]}' if frame.crs else ''}", color=canvas.INK, fontsize=11)
    axes.set_ylabel("northing [m]", color=canvas.INK, fontsize=11)
    axes.tick_params(colors=canvas.INK, labelsize=9)
    axes.tick_params(axis="y", rotation=90)
    for spine in axes.spines.values():
        spine.set_edgecolor(canvas.FAINT)


def _key(plan: SurveyPlan, axes: Axes) -> None:
    keys = [Line2D([], [], color="#bdb7ae", linewidth=1.6, marker=">", label="line, numbered at its start"),
            Line2D([], [], color=SWATH, linewidth=0.8, label="edge of a swath"),
            Line2D([], [], color=TURN, linewidth=1.0, linestyle="dashed", label="run-in, turn"),
            *([Line2D([], [], color=BORDER, linewidth=1.6, label="area")] if plan.area is not None else []),
            *([Patch(color=GAP, label="gap")] if plan.gaps else [])]
    axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(axes.bbox.x1 + 120, axes.bbox.y1), borderaxespad=0,
                bbox_transform=IdentityTransform(), fontsize=9.5, facecolor=canvas.PAPER, edgecolor=canvas.FAINT,
                labelcolor=canvas.INK)
