"""Recording of what a page shows, by the SDK of rerun, and the views with which the page begins.

Everything in space stands in the scene's frame: x east, y north, z up, the still sea surface at z = 0.
"""
from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mitsonar.device.extras import MissingExtra

APPLICATION = "mitsonar"
COVER = 0.55                       # opacity of labels over levels
LARGEST = 60_000                   # number of 16 bits
WORLD = "world"                    # entity below which everything in space stands


def sdk() -> Any:
    """Return the module rerun; raise `MissingExtra` if it is not installed."""
    try:
        import rerun  # pyright: ignore[reportMissingImports]  # of the extra view
        import rerun.blueprint  # pyright: ignore[reportMissingImports]
    except ImportError:
        raise MissingExtra("the viewer needs the package rerun-sdk, which needs Python 3.11 or later", "view",
                           "draw pictures by mitsonar.plots") from None
    rerun.set_strict_mode(True)                        # errors are raised, not printed
    return rerun


class ViewLog:
    """Recording in a file, and the views that show it."""

    def __init__(self, path: Path) -> None:
        """Begin a recording."""
        self.rr: Any = sdk()
        self.stream: Any = self.rr.RecordingStream(APPLICATION)
        self.stream.save(path)
        self.views: list[Any] = []                     # in the plane, one or more a record
        self.hidden_in_space: list[str] = []
        self.space = False                             # True once anything stands in space
        self.timed = False                             # True once anything has a time

    @contextlib.contextmanager
    def ended(self) -> Iterator[ViewLog]:
        """Write the views and the end of the recording after the block."""
        try:
            yield self
            self._arrange()
        finally:
            self.stream.disconnect()

    def at(self, ping: int, time: float) -> None:
        """Set ping and time [s] of what is logged next."""
        self.timed = True
        self.stream.set_time("time", duration=time)
        self.stream.set_time("ping", sequence=ping)

    def at_time(self, time: float) -> None:
        """Set the time [s] alone of what is logged next."""
        self.stream.disable_timeline("ping")
        self.stream.set_time("time", duration=time)

    def log(self, path: str, *what: Any, still: bool = False) -> None:
        """Log something in the plane of a view."""
        self.stream.log(path, *what, static=still)

    def place(self, path: str, *what: Any, still: bool = False, shown: bool = True) -> None:
        """Log something in space."""
        if not self.space:
            self.space = True
            self.stream.log(WORLD, self.rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self.stream.log(f"{WORLD}/{path}", *what, static=still)
        if not shown and f"/{WORLD}/{path}" not in self.hidden_in_space:
            self.hidden_in_space.append(f"/{WORLD}/{path}")

    def shade(self, path: str, values: np.ndarray, limits: tuple[float, float], colours: str, *,
              still: bool = False) -> None:
        """Log numbers (rows, columns) as a picture in colours from ``limits[0]`` to ``limits[1]``.

        Numbers below the first colour, and missing ones, become ``limits[0]``: rerun 0.41 mirrors the colours of lower
        ones. The page holds 16 bits a number up to `LARGEST`, of which 11 count: levels are right to 0.03 dB at
        100 dB.
        """
        known = np.maximum(np.nan_to_num(values, nan=limits[0]), limits[0])
        known = known.astype(np.float16 if known.max(initial=0) <= LARGEST else np.float32)
        self.log(path, self.rr.DepthImage(known, colormap=colours, depth_range=limits), still=still)

    def names(self, path: str, names: Mapping[int, tuple[str, Sequence[float]]]) -> None:
        """Log names and colours (0 to 1) of the numbers of a picture of labels; 0 is transparent."""
        self.log(path, self.rr.AnnotationContext([(0, "none", (0, 0, 0, 0)), *(
            (number, name, tuple(round(255 * part) for part in colour[:3])) for number, (name, colour) in
            names.items() if number)]), still=True)

    def label(self, path: str, numbers: np.ndarray, *, still: bool = False) -> None:
        """Log a picture (rows, columns) of labels; 0 is transparent."""
        self.log(path, self.rr.SegmentationImage(numbers.astype(np.uint16), opacity=COVER), still=still)

    def marks(self, path: str, strips: Sequence[np.ndarray], *, words: Sequence[str] | None = None,
              colour: Sequence[int] = (255, 255, 255, 90), still: bool = True) -> None:
        """Log lines (points, 2) [pixels] with words beside them."""
        self.log(path, self.rr.LineStrips2D(list(strips), colors=[colour], labels=words,
                                            show_labels=words is not None, radii=self.rr.Radius.ui_points(0.6)),
                 still=still)

    def view(self, origin: str, name: str, hidden: Sequence[str] = ()) -> None:
        """Add a view of the plane of an entity, in which some layers wait to be switched on."""
        blueprint = self.rr.blueprint
        self.views.append(blueprint.Spatial2DView(origin=origin, name=name, background=(8, 10, 14), overrides={
            f"/{origin}/{layer}": blueprint.EntityBehavior(visible=False) for layer in hidden}))

    def _arrange(self) -> None:
        """Write the views: space on the left, planes on the right, time below."""
        blueprint = self.rr.blueprint
        parts = []
        if self.space:
            parts.append(blueprint.Spatial3DView(
                origin=WORLD, name="scene", background=(8, 10, 14), line_grid=False,
                overrides={path: blueprint.EntityBehavior(visible=False) for path in self.hidden_in_space}))
        if self.views:
            parts.append(blueprint.Grid(*self.views) if len(self.views) > 1 else self.views[0])
        self.stream.send_blueprint(blueprint.Blueprint(
            blueprint.Horizontal(*parts), blueprint.TimePanel(
                timeline="time", state="expanded" if self.timed else "hidden"),
            blueprint.BlueprintPanel(state="expanded"), blueprint.SelectionPanel(state="collapsed")))
