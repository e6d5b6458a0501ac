"""Output of plots: a file, axes that the caller gives, or a figure that pyplot shows."""
from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.figure import Figure

from mitsonar.device.files import FilePath

from . import canvas


@contextlib.contextmanager
def sheets_for(path: FilePath | None, axes: Axes | None) -> Iterator[None]:
    """Make sheets with pyplot if there is neither a path nor axes, so that notebooks show them."""
    if path is not None or axes is not None:
        yield
        return
    from matplotlib import pyplot

    token = canvas.MANAGED.set([])
    try:
        yield
    except BaseException:
        for figure in canvas.MANAGED.get() or []:
            pyplot.close(figure)
        raise
    else:
        for figure in (canvas.MANAGED.get() or [])[:-1]:           # these only measured a legend
            pyplot.close(figure)
    finally:
        canvas.MANAGED.reset(token)


def moved(figure: Figure, axes: Axes | None) -> Axes:
    """Return the first axes of a sheet, or move its content into the given axes and return these."""
    if axes is None:
        return figure.axes[0]
    bars = {id(bar.ax) for panel in figure.axes for artist in _artists(panel)
            if (bar := getattr(artist, "colorbar", None)) is not None}
    panels = [panel for panel in figure.axes if id(panel) not in bars]
    if len(panels) > 1:
        raise ValueError(f"this plot has {len(panels)} panels, which do not fit into the given axes; leave axes out, "
                         "and take the panels from the figure of the returned axes.")
    _move(figure, panels[0], axes)
    return axes


def _move(figure: Figure, panel: Axes, axes: Axes) -> None:
    """Move the artists, labels, legend and colour bar of a panel into other axes."""
    limits, box = (panel.get_xlim(), panel.get_ylim()), panel.get_position().transformed(figure.transFigure)
    legend = panel.get_legend()
    for artist in _artists(panel):
        _rehang(artist, panel, axes)
    axes.set(xlim=limits[0], ylim=limits[1], xlabel=panel.get_xlabel(), ylabel=panel.get_ylabel(),
             facecolor=panel.get_facecolor())
    for mine, theirs in ((axes.xaxis, panel.xaxis), (axes.yaxis, panel.yaxis)):
        mine.set_major_formatter(theirs.get_major_formatter())
    across, up = (abs(float(np.ptp(pair))) / size for pair, size in zip(limits, (box.width, box.height), strict=True))
    axes.set_aspect("equal" if abs(across / up - 1) < 0.01 else "auto")
    axes.set_title(next((text.get_text() for text in (*figure.texts[:1], panel.title) if text.get_text()), ""))
    if legend is not None:
        axes.legend(handles=legend.legend_handles, labels=[text.get_text() for text in legend.get_texts()])


def _artists(panel: Axes) -> list[Artist]:
    """Return the artists that were drawn in a panel."""
    return [*panel.images, *panel.collections, *panel.patches, *panel.lines, *panel.texts]


def _rehang(artist: Artist, panel: Axes, axes: Axes) -> None:
    """Move an artist and its colour bar from a panel into other axes."""
    transforms = [(panel.transData, axes.transData), (panel.transAxes, axes.transAxes),
                  (panel.get_xaxis_transform("grid"), axes.get_xaxis_transform("grid")),
                  (panel.get_yaxis_transform("grid"), axes.get_yaxis_transform("grid"))]
    transform = next((new for old, new in transforms if artist.get_transform() == old), axes.transData)
    bar = getattr(artist, "colorbar", None)
    artist.remove()
    artist.set_transform(transform)
    axes.add_artist(artist)
    artist.set_clip_path(axes.patch)
    if bar is not None:
        setattr(artist, "colorbar", None)
        new = cast(Figure, axes.figure).colorbar(cast(ScalarMappable, artist), ax=axes, label=bar.ax.get_ylabel(),
                                                 extend=bar.extend)
        new.ax.yaxis.set_inverted(bar.ax.yaxis_inverted())
