"""Plan and section of a scene before it is rendered: bed, objects, track, rays, and what no ping sees."""
from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import LightSource, ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from matplotlib.patheffects import withStroke
from matplotlib.ticker import MaxNLocator

from mitsonar.device.files import FilePath
from mitsonar.units import khz_from_hertz

from .. import canvas
from ..canvas import FAINT, INK, PAPER

if TYPE_CHECKING:
    from mitsonar.verbs.overview import Overview, PlacedObject, SceneOrPath

WIDTH, KEY = 900, 340              # [pixels]: of plan and section, and of the column on their right
LOWEST, TALLEST = 360, 820         # [pixels]: heights of the plan
SECTION, PROFILE = (190, 420), 200     # [pixels]: heights of the section, width of the profile beside it
LEFT, BOTTOM, BETWEEN, TOP = 84, 62, 84, 86
SIGHT, SHADE, TRACK, THING = "#ffd24d", "#c2185b", "#ffffff", "#ff8a3d"
VEIL = 0.62                        # opacity of what no ping sees
SECTION_DASHES, RECORD_DASHES = (0, (6, 4)), (0, (2, 3))
UNSEEN, SEEN, SHADOW = 0, 1, 2     # states of a point of the bed
MOST_NAMES, TIMES = 8, 6            # most objects of a class that are named; times at the track
SMALL, LETTER = 7, 6.8             # [pixels]: objects below are marked; width of a letter of a name
NEAR = 0.04                        # share of the range within which an object belongs to the section
OUTLINED = [withStroke(linewidth=2.5, foreground=PAPER)]


def show(scene: SceneOrPath, path: FilePath | None = None, *, sensor: int | str = 0, ping: int | None = None,
         **parameters: object) -> Figure:
    """Draw a scene before it is rendered: a plan and a section with scales.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        As in `mitsonar.render`.
    path : str or path, optional
        PNG, PDF or SVG file to write.
    sensor : int or str
        Number or id of one of the scene's sensors.
    ping : int, optional
        Ping of the section, from 0. Default: the middle one.
    **parameters
        Values for the ``$parameters`` of a scene that is given by name or path.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    FileNotFoundError, ValueError, TypeError
        As in `mitsonar.render`, or if there is no such ping or the file cannot be written.

    Notes
    -----
    The bed is seen where the earliest bent ray arrives within the record and leaves within the main lobe, down to -20
    dB two-way, and where no object or slope stands in the way of a straight ray. The water is that of the middle ping.
    """
    from mitsonar.verbs.overview import overview

    canvas.check_path(path)
    return canvas.saved(scene_figure(overview(scene, sensor, ping, parameters)), path)


def scene_figure(overview: Overview) -> Figure:
    """Draw the plan and the section of an overview."""
    (west, east), (south, north) = limits = _extent(overview)
    height = float(np.clip(WIDTH * (north - south) / (east - west), LOWEST, TALLEST))
    shape = WIDTH / height
    limits = [_widened(limits[0], shape * (north - south)), _widened(limits[1], (east - west) / shape)]
    section, across = overview.section, float(np.ptp(overview.section.along))
    rise = float(np.clip(WIDTH * (_deepest(overview) - _top(overview)) / across, *SECTION))
    figure = canvas.sheet(LEFT + WIDTH + KEY, BOTTOM + rise + BETWEEN + height + TOP, PAPER)
    plan = _axes(figure, LEFT, BOTTOM + rise + BETWEEN, WIDTH, height)
    plan.set_xlim(*limits[0])
    plan.set_ylim(*limits[1])
    _bed(overview, plan)
    _objects(overview, plan)
    _track(overview, plan)
    ends = overview.track.position[section.ping, :2] + section.along[[0, -1], None] * section.direction
    plan.plot(*ends.T, color=INK, linestyle=SECTION_DASHES, linewidth=0.9, zorder=4, scalex=False, scaley=False)
    for outline in _fans(overview):
        plan.plot(*outline.T, color=INK, linestyle=RECORD_DASHES, linewidth=0.8, zorder=4, scalex=False, scaley=False)
    plan.set_xlabel("x, east [m]", color=INK)
    plan.set_ylabel("y, north [m]", color=INK)
    below = _axes(figure, LEFT, BOTTOM, WIDTH, rise)
    _section(overview, below)
    _profile(overview, _axes(figure, LEFT + WIDTH + KEY - PROFILE - 32, BOTTOM, PROFILE, rise), below)
    _key(overview, plan)
    canvas.headings(figure, LEFT, _title(overview), "   ·   ".join(_facts(overview)))
    return figure


def _widened(limits: tuple[float, float], span: float) -> tuple[float, float]:
    """Return limits about the same middle that are at least ``span`` apart."""
    middle, half = 0.5 * (limits[0] + limits[1]), 0.5 * max(span, limits[1] - limits[0])
    return middle - half, middle + half


def _title(overview: Overview) -> str:
    return f"{overview.kind.replace('_', ' ')} {khz_from_hertz(overview.frequency):g} kHz: plan and section"


def _facts(overview: Overview) -> list[str]:
    """Return what the second line of the title says of the track and of what is seen."""
    track, section = overview.track, overview.section
    duration, depth = float(track.time[-1] - track.time[0]), -track.position[:, 2]
    pings = f"{track.pings} ping{'s' * (track.pings != 1)}"
    if track.pings > 1:
        length = float(np.hypot(*np.diff(track.position[:, :2], axis=0).T).sum())
        pings += f" over {canvas.in_metres(length)} in {duration:.3g} s" if length > 0.01 else f" in {duration:.3g} s"
    low, high = section.ranges
    deep, above = (canvas.in_metres(float(np.nanmean(values))) for values in (depth, overview.below))
    return [pings, f"{deep} deep, {above} above the bed", f"record {low:.3g} to {canvas.in_metres(high)}",
            *_reach(overview)]


def _reach(overview: Overview) -> list[str]:
    """Return how far the section's bed is seen."""
    section = overview.section
    if not (section.state == SEEN).any():
        return [f"no bed in sight at ping {section.ping}"]
    texts = []
    for side, name in ((-1, "port"), (1, "starboard")) if section.sides else ((1, "ahead"),):
        seen = side * section.along[(section.state == SEEN) & (side * section.along >= 0)]
        texts.append(f"{name} {abs(seen.min()):.1f} to {seen.max():.1f} m" if seen.size else f"nothing to {name}")
    return [f"sees {', '.join(texts)}"]


def _axes(figure: Figure, left: float, bottom: float, width: float, height: float) -> Axes:
    axes = figure.add_axes(canvas.shares_of(figure, left, bottom, width, height), facecolor="#2a2622")
    axes.tick_params(colors=INK, labelsize=10)
    for spine in axes.spines.values():
        spine.set_edgecolor(FAINT)
    return axes


def _extent(overview: Overview) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the bounds in x and in y of track, objects and record, and of the bed as far as it is near them."""
    reach, sonar = overview.section.ranges[1], overview.track.position[:, :2]
    points = [overview.place[overview.state != UNSEEN], sonar, *_fans(overview),
              *(thing.points[:, :2] for thing in overview.objects),
              *(thing.path[:, :2] for thing in overview.objects if thing.path is not None)]
    near = np.concatenate([part.reshape(-1, 2) for part in points])
    bed = np.array([[overview.x[0], overview.y[0]], [overview.x[-1], overview.y[-1]]])
    low = np.maximum(np.minimum(near.min(0), bed[0]), near.min(0) - 0.2 * reach)
    high = np.minimum(np.maximum(near.max(0), bed[1]), near.max(0) + 0.2 * reach)
    margin = 0.02 * float(np.max(high - low)) + 0.3
    return (float(low[0] - margin), float(high[0] + margin)), (float(low[1] - margin), float(high[1] + margin))


def _fans(overview: Overview) -> list[np.ndarray]:
    """Return the outlines (N, 2) of fans, which may see no bed."""
    if not overview.views.fan or overview.views.round:
        return []
    sonar = overview.track.position[overview.pings, None, :2]
    return list(np.concatenate([sonar, overview.place[:, :, -1], sonar], axis=1))


def _bed(overview: Overview, axes: Axes) -> None:
    """Draw depths as colours, shaded from the north-west: dark where no ping sees the bed, red in shadows."""
    depth, x, y = overview.depth, overview.x, overview.y
    if not np.isfinite(depth).any():
        return
    shoalest, deepest = np.nanpercentile(depth, [1, 99])
    if deepest - shoalest < 0.02 * abs(deepest):
        shoalest, deepest = deepest - 0.02 * abs(deepest), deepest + 0.02 * abs(deepest)
    step = float(x[1] - x[0]) if len(x) > 1 else float(y[1] - y[0]) if len(y) > 1 else 1.0
    scale, colours = Normalize(shoalest, deepest), colormaps["viridis_r"]
    picture = colours(scale(depth))
    if min(depth.shape) > 1:
        filled = np.where(np.isnan(depth), np.nanmean(depth), depth)
        rise = 0.05 * step * max(depth.shape) / float(deepest - shoalest)
        shade = LightSource(315, 45).hillshade(-filled, vert_exag=rise, dx=step, dy=-step)
        picture[..., :3] *= (0.6 + 0.4 * shade)[..., None]
    picture[np.isnan(depth), 3] = 0.0
    extent = x[0] - step / 2, x[-1] + step / 2, y[0] - step / 2, y[-1] + step / 2
    axes.imshow(picture, zorder=1, extent=extent, origin="lower", interpolation="nearest", aspect="auto")
    state = _seen(overview, axes)
    veil = np.zeros((*state.shape, 4))
    veil[state == UNSEEN] = canvas.to_rgba(PAPER, VEIL)
    veil[state == SHADOW] = canvas.to_rgba(SHADE, 0.75)
    axes.imshow(veil, zorder=2, extent=(*axes.get_xlim(), *axes.get_ylim()), interpolation="nearest", aspect="auto")
    drawn = axes.imshow(np.full((1, 1), np.nan), cmap=colours, norm=scale, extent=(0, 1, 0, 1), zorder=0, aspect="auto")
    canvas.colour_bar(drawn, axes, "depth of the bed [m]", "both").ax.invert_yaxis()


def _seen(overview: Overview, axes: Axes) -> np.ndarray:
    """Return the state of the bed at the pixels of the plan: what any ping sees is seen."""
    place, state = overview.place, overview.state
    box = axes.get_window_extent()
    figure = Figure(figsize=(box.width / canvas.DPI, box.height / canvas.DPI), dpi=canvas.DPI, facecolor="black")
    sheet = FigureCanvasAgg(figure)
    plan = figure.add_axes((0, 0, 1, 1), xlim=axes.get_xlim(), ylim=axes.get_ylim(), frameon=False)
    # a mesh for each ping of a fan, or for each side of other sonars; a single ping of these sees a line
    meshes = list(zip(place, state)) if overview.views.fan else [(place[:, side], state[:, side])
                                                                 for side in range(place.shape[1])]
    for kind, colour in ((SHADOW, "#ff0000"), (SEEN, "#00ff00")):
        for points, values in meshes:
            if len(points) > 1:
                cells = values[:-1, :-1]               # between a point and the next ones
                plan.pcolormesh(points[..., 0], points[..., 1], np.ma.masked_where(cells != kind, cells),
                                cmap=ListedColormap([colour]))
            else:
                plan.plot(*np.where((values == kind)[..., None], points, np.nan)[0].T, color=colour, linewidth=2)
    sheet.draw()
    red, green = np.moveaxis(np.asarray(sheet.buffer_rgba())[..., :2], -1, 0)
    return np.where(green > 127, SEEN, np.where(red > 127, SHADOW, UNSEEN))


def _outline(points: np.ndarray) -> np.ndarray:
    """Return the convex outline (K, 2) of points (N, 2); the points themselves if they have no area."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return points[:2]


def _objects(overview: Overview, axes: Axes) -> None:
    names = _names(overview.objects)
    _draw_things(axes, [thing.points[:, :2] for thing in overview.objects], [names[t.name] for t in overview.objects])
    for thing in overview.objects:
        if thing.path is not None:
            axes.plot(*thing.path[:, :2].T, color=THING, linestyle=":", linewidth=1.4, zorder=5)


def _names(things: Sequence[PlacedObject]) -> dict[str, str]:
    """Return the written names of objects by name: none of those of a class of many."""
    count = Counter(thing.name.partition(".")[0] for thing in things)
    return {thing.name: thing.name if count[thing.name.partition(".")[0]] <= MOST_NAMES else "" for thing in things}


def _draw_things(axes: Axes, things: Sequence[np.ndarray], names: Sequence[str]) -> None:
    """Draw the outlines of points (N, 2), with a mark where they are too small to see, and names side by side."""
    box, taken = axes.get_window_extent(), []
    for points, name in zip(things, names):
        axes.add_patch(Polygon(_outline(points), facecolor=canvas.to_rgba(THING, 0.35), edgecolor=THING, linewidth=1.2,
                               zorder=5))
        low, high = points.min(0), points.max(0)
        middle = 0.5 * (low + high)
        corners = axes.transData.transform([low, high])
        if np.abs(np.diff(corners, axis=0)).max() < SMALL:
            axes.plot(*middle, marker="x", color=THING, markersize=6, markeredgewidth=1.6, zorder=6, scalex=False,
                      scaley=False)
        x, y = axes.transData.transform(middle)
        if not name or not (box.x0 < x < box.x1 and box.y0 < y < box.y1):
            continue
        half, rise = 0.5 * LETTER * len(name), min(0.5 * abs(corners[1, 1] - corners[0, 1]), 40) + 12
        # above the object, else below it, else farther above
        free = (up for up in (rise, -rise, rise + 15, -rise - 15, rise + 30)
                if not any(abs(x - x0) < half + half0 and abs(y + up - y0) < 13 for x0, y0, half0 in taken))
        offset = next(free, rise)
        taken.append((x, y + offset, half))
        x = float(np.clip(x, box.x0 + half + 4, box.x1 - half - 4))
        place = axes.transData.inverted().transform((x, y + offset))
        axes.text(place[0], place[1], name, ha="center", va="center", fontsize=9,
                  color=INK, zorder=8, path_effects=OUTLINED, clip_on=True)


def _track(overview: Overview, axes: Axes) -> None:
    """Draw the track with times, the sonar and its heading at the section's ping."""
    track, ping = overview.track, overview.section.ping
    x, y = track.position[:, :2].T
    axes.plot(x, y, color=TRACK, linewidth=1.6, zorder=6)
    span = axes.get_xlim()[1] - axes.get_xlim()[0]
    moved = float(np.hypot(np.ptp(x), np.ptp(y)))
    if moved > 0.02 * span:
        room = int(moved / span * WIDTH / 30)          # labels of 30 pixels
        locator = MaxNLocator(min(max(room, 1), TIMES), steps=[1, 2, 5, 10])
        ticks = locator.tick_values(0, float(track.time[-1] - track.time[0]))
        for second in ticks:
            time = track.time[0] + second
            if not track.time[0] <= time <= track.time[-1]:
                continue
            at = np.interp(time, track.time, x), np.interp(time, track.time, y)
            axes.plot(*at, "o", color=TRACK, markersize=4, zorder=7)
            axes.annotate(f"{second:g} s", at, xytext=(7, 0), textcoords="offset points", va="center", fontsize=9,
                          color=TRACK, zorder=8, path_effects=OUTLINED)
    length, heading = 0.05 * span, track.heading[ping]
    tip = x[ping] + length * np.sin(heading), y[ping] + length * np.cos(heading)
    axes.annotate("", tip, (x[ping], y[ping]), zorder=9,
                  arrowprops={"arrowstyle": "-|>", "color": TRACK, "linewidth": 1.6, "mutation_scale": 14})
    axes.plot(x[ping], y[ping], "o", color=PAPER, markeredgecolor=TRACK, markersize=7, zorder=10)


def _deepest(overview: Overview) -> float:
    """Return the greatest depth that the section shows [m]."""
    section, source = overview.section, -float(overview.track.position[overview.section.ping, 2])
    deepest = max([source, float(np.nanmax(section.depth, initial=source)),
                   *(float(-thing.points[:, 2].min()) for thing, _ in _near(overview))])
    return 1.06 * deepest + 0.3


def _top(overview: Overview) -> float:
    """Return the least depth that the section shows [m], above the surface."""
    return -0.05 * _deepest(overview)


def _section(overview: Overview, axes: Axes) -> None:
    section, sonar = overview.section, overview.track.position[overview.section.ping]
    source = -float(sonar[2])
    near = _near(overview)
    axes.set_xlim(section.along[0], section.along[-1])
    axes.set_ylim(_deepest(overview), _top(overview))
    axes.axhline(0, color="#6fb7e9", linewidth=1.4, zorder=3)
    axes.add_collection(LineCollection(list(section.rays), colors=SIGHT, linewidths=0.7, alpha=0.75, zorder=2))
    axes.fill_between(section.along, section.depth, _deepest(overview), color="#4a4138", zorder=3)
    for state, colour in ((UNSEEN, FAINT), (SEEN, SIGHT), (SHADOW, SHADE)):
        axes.plot(section.along, np.where(section.state == state, section.depth, np.nan), color=colour, linewidth=2.6,
                  solid_capstyle="butt", zorder=5)
    for slant in section.ranges:
        if slant > 0.01:
            angle = np.linspace(-np.pi / 2, np.pi / 2, 721) if not section.sides else np.linspace(-np.pi, np.pi, 1441)
            axes.plot(slant * np.cos(angle), source + slant * np.sin(angle), color=INK, linewidth=0.8,
                      linestyle=RECORD_DASHES, zorder=1)
    names = _names([thing for thing, _ in near])
    _draw_things(axes, [np.stack([along, -thing.points[:, 2]], -1) for thing, along in near],
                 [names[thing.name] for thing, _ in near])
    axes.plot(0, source, "o", color=PAPER, markeredgecolor=TRACK, markersize=8, zorder=10)
    axes.set_ylabel("depth [m]", color=INK)
    axes.set_xlabel(_section_words(overview, axes), color=INK)


def _section_words(overview: Overview, axes: Axes) -> str:
    """Return the label of the section's horizontal axis, with the direction and the exaggeration of depths."""
    section, box = overview.section, axes.get_window_extent()
    bearing = np.degrees(np.arctan2(*section.direction)) % 360
    words = "port   ←   across [m]   →   starboard" if section.sides else "along the view [m]"
    metres = [abs(end - start) for start, end in (axes.get_xlim(), axes.get_ylim())]
    taller = box.height / metres[1] / (box.width / metres[0])
    time = overview.track.time[section.ping] - overview.track.time[0]
    return (f"{words}      section at ping {section.ping}, {time:.3g} s, towards {bearing:.0f}°"
            + (f"      depths × {taller:.2g}" if abs(taller - 1) > 0.05 else "      same scale both ways"))


def _near(overview: Overview) -> list[tuple[PlacedObject, np.ndarray]]:
    """Return the objects that the section meets or nearly meets, and the places of their points along it [m]."""
    section = overview.section
    sonar, along = overview.track.position[section.ping, :2], section.direction
    found = []
    for thing in overview.objects:
        offset = thing.points[:, :2] - sonar
        aside, place = offset @ [-along[1], along[0]], offset @ along
        margin = NEAR * section.ranges[1]
        if aside.min() < margin and aside.max() > -margin and section.along[0] < place.mean() < section.along[-1]:
            found.append((thing, place))
    return found


def _profile(overview: Overview, axes: Axes, section: Axes) -> None:
    """Draw the sound-speed profile over the depths of the section."""
    low, high = sorted(section.get_ylim())
    depth = np.linspace(max(low, 0.0), high, 200)
    axes.plot(overview.profile.at(depth), depth, color="#6fb7e9", linewidth=1.6)
    axes.plot(overview.profile.at(-overview.track.position[overview.section.ping, 2]),
              -overview.track.position[overview.section.ping, 2], "o", color=PAPER, markeredgecolor=TRACK, markersize=7)
    axes.set_ylim(section.get_ylim())
    speed = overview.profile.at(depth)
    axes.set_xlim(_widened((float(speed.min()) - 1, float(speed.max()) + 1), 10.0))
    axes.tick_params(labelleft=False)
    axes.xaxis.set_major_locator(MaxNLocator(3))
    axes.ticklabel_format(axis="x", useOffset=False, style="plain")
    axes.set_xlabel("sound speed [m/s]", color=INK)


def _key(overview: Overview, axes: Axes) -> None:
    keys = [Patch(facecolor=colormaps["viridis_r"](0.4), label="bed that a ping sees"),
            Patch(facecolor=canvas.to_rgba(SHADE, 0.75), label="bed in shadow"),
            Patch(facecolor=colormaps["viridis_r"](0.4, alpha=1 - VEIL), edgecolor=FAINT,
                  label="bed that no ping sees"),
            Line2D([], [], color=TRACK, marker="o", markersize=4, linewidth=1.6, label="track"),
            Line2D([], [], color=TRACK, marker="o", markerfacecolor=PAPER, markersize=7, linewidth=0,
                   label=f"sonar at ping {overview.section.ping}"),
            Line2D([], [], color=INK, linestyle=SECTION_DASHES, linewidth=0.9, label="place of the section"),
            Line2D([], [], color=SIGHT, linewidth=0.9, label="rays of the main lobe"),
            Line2D([], [], color=INK, linestyle=RECORD_DASHES, linewidth=0.8, label="ends of the record")]
    if overview.objects:
        keys.insert(3, Patch(facecolor=canvas.to_rgba(THING, 0.35), edgecolor=THING, label="object"))
    axes.legend(handles=keys, loc="upper left", bbox_to_anchor=(1 + 104 / WIDTH, 1.0), borderaxespad=0.0, fontsize=9.5,
                facecolor=PAPER, edgecolor=FAINT, labelcolor=INK)
