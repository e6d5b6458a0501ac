"""Layers of a picture: which variables of a record a page shows, in which colours, and which of them at first.

Levels are shown with the gain of `mitsonar.imaging.gain`; everything else as it is. A page switches layers by the eye
beside their names. Objects are labels of objects alone, so that the bed does not cover the levels.
"""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr

from mitsonar.plots.images.label_key import counted, label_key
from mitsonar.plots.images.truth import SHADOW_COLOUR, class_colours

from .view_log import ViewLog

LEVEL, OBJECTS, SHARE = "level", "objects", "share_of_objects"
# name of a layer -> limits and colours; limits of None are those of its values
SHADES: dict[str, tuple[tuple[float, float] | None, str]] = {
    "mean_level": (None, "inferno"), "recorded": (None, "grayscale"), "seabed_depth": (None, "viridis"),
    "depth": (None, "viridis"), "measured_depth": (None, "viridis"), "error": (None, "spectral"),
    "phase": ((-np.pi, np.pi), "twilight"), "coherence": ((0.0, 1.0), "plasma"), "hidden": ((0.0, 1.0), "magma"),
    "height": (None, "viridis"), "layover": ((0.0, 3.0), "plasma"), SHARE: ((0.0, 1.0), "magma")}
LABELS = ("label", "class", "object_shadow")
MASKS = ("shadow",)


@dataclass(frozen=True, kw_only=True)
class PictureLayer:
    """One picture of a record, beside its levels."""

    name: str
    values: xr.DataArray  # over the bins of ``level``
    numbers: bool  # True for labels and masks, False for shades
    limits: tuple[float, float] = (0.0, 1.0)
    colours: str = ""


def layers_of(record: xr.Dataset) -> list[PictureLayer]:
    """Return the layers of a record, beside its levels, in the order in which they lie on each other."""
    dims = set(record["level"].dims) - {"bank"}
    found = [PictureLayer(name=name, values=record[name], numbers=False, limits=limits or _limits(record[name]),
                   colours=colours)
             for name, (limits, colours) in SHADES.items() if name in record and set(record[name].dims) == dims]
    objects = [int(number) for number in record.attrs.get("objects") or {}]
    if "share" in record and objects:
        share = record["share"].isel(shape=[number - 1 for number in objects]).sum("shape")
        found.append(PictureLayer(name=SHARE, values=share, numbers=False, limits=(0.0, 1.0), colours="magma"))
    for name in (*LABELS, *MASKS):
        if name in record and set(record[name].dims) == dims:
            found.append(PictureLayer(name=name, values=record[name], numbers=True))
    if "label" in record and objects:
        label = record["label"]
        found.append(PictureLayer(name=OBJECTS, values=label.where(label.isin(objects), 0), numbers=True))
    return found


def hidden(layers: Iterable[PictureLayer]) -> list[str]:
    """Return the names of the layers that a page does not show at first."""
    return [layer.name for layer in layers if layer.name != OBJECTS]


def log_names(log: ViewLog, origin: str, layers: Iterable[PictureLayer], record: xr.Dataset) -> None:
    """Log names and colours of the numbers of layers."""
    attrs = record.attrs
    for layer in layers:
        if not layer.numbers:
            continue
        if layer.name in MASKS:
            log.names(f"{origin}/{layer.name}", {1: (layer.name, _rgb(SHADOW_COLOUR))})
            continue
        names = {int(key): str(name) for key, name in
                 (attrs.get("classes" if layer.name == "class" else "labels") or {}).items()}
        if layer.name == OBJECTS:
            kinds = {int(number): str(entry["class"]) for number, entry in attrs["objects"].items()}
            own = class_colours(kinds.values())
            log.names(f"{origin}/{layer.name}", {number: (names.get(number, kind), own[kind])
                                                 for number, kind in kinds.items()})
        elif layer.name == "class":
            own = class_colours(names.values())
            log.names(f"{origin}/{layer.name}", {key: (name, own[name]) for key, name in names.items()})
        elif names:
            key = label_key(counted(np.array([0, *names], np.int64)), attrs.get("labels") or {})
            log.names(f"{origin}/{layer.name}", {
                number: (name, key.colours(int(key.rank(np.array(number))))) for number, name in names.items()})


def log_layer(log: ViewLog, origin: str, layer: PictureLayer, picture: np.ndarray, *, still: bool = False) -> None:
    """Log a layer as drawn (rows, columns)."""
    if layer.numbers:
        log.label(f"{origin}/{layer.name}", picture, still=still)
    else:
        log.shade(f"{origin}/{layer.name}", picture, layer.limits, layer.colours, still=still)


def _limits(values: xr.DataArray) -> tuple[float, float]:
    """Return limits that leave out a percent of the values on either side, of some pings alone."""
    pings = values.sizes.get("ping", 0)
    some = values.isel(ping=slice(None, None, max(pings // 8, 1))) if pings else values
    known = some.values[np.isfinite(some.values)]
    low, high = np.percentile(known, [1, 99]) if known.size else (0.0, 1.0)
    return float(low), float(max(high, low + 1e-3))


def _rgb(colour: str) -> tuple[float, float, float]:
    from matplotlib.colors import to_rgb

    return to_rgb(colour)
