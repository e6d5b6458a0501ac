"""Plots of the ground truth of objects: outlines on the waterfall, classes, shares of echoes, hidden bed, layover."""
from collections import Counter
from collections.abc import Iterable

import numpy as np
from matplotlib import colormaps
from matplotlib.colors import ListedColormap, to_rgb
from matplotlib.patches import Patch

from mitsonar.imaging.objects import object_bins

from .. import canvas
from ..canvas import subtitle, title
from .label_key import counted
from .levels import shown_levels

SHADOW_COLOUR = "#5aa9e6"
SPECK = 8                # bins; smaller pieces are not outlined
BRIGHT = ("#ff9f1c", "#4cd137", "#ff5252", "#b98cff", "#ffe14d", "#ff7ad9", "#1ee3b0", "#d19a5b", "#c2f04a", "#ffb199",
          "#f0f0f0", "#e056fd")          # easily distinguished on grey and from the colour of shadows
LEGEND = 24              # entries of the legend


def class_colours(classes: Iterable[str]) -> dict[str, tuple[float, float, float]]:
    """Return a colour for every class."""
    names = sorted(set(classes))
    return {name: to_rgb(BRIGHT[index] if index < len(BRIGHT) else colormaps["hsv"](0.618034 * index % 1))
            for index, name in enumerate(names)}


def _objects(dataset, grid, *, tvg):
    image, (low, high), _, more_db = shown_levels(dataset, grid, tvg)
    grey = np.clip(np.nan_to_num((image - low) / (high - low)), 0, 1)
    picture = np.repeat(grey[..., None], 3, -1)
    dims, counts = dataset["level"].dims, Counter()
    colours = class_colours(entry["class"] for entry in dataset.attrs.get("objects", {}).values())
    for seen in object_bins(dataset, smallest=SPECK):
        counts[seen.class_name] += bool(seen.highlight.any() or seen.shadow.any())
        for bins, colour in ((seen.shadow, to_rgb(SHADOW_COLOUR)), (seen.highlight, colours[seen.class_name])):
            if bins.any():
                marked = dataset[["level"]].assign(marked=(dims, bins.astype(np.uint8)))
                mask = grid.largest(marked, lambda part: part["marked"].values) > 0
                picture[canvas.outline(mask)] = colour
    keys = [Patch(facecolor=colours[name], label=f"{name}  ({count})")
            for name, count in sorted(counts.items()) if count]
    return canvas.picture(grid, picture, f"{title(dataset)}: objects", subtitle=subtitle(dataset, grid, more_db),
                          keys=[*keys[:LEGEND], Patch(facecolor=SHADOW_COLOUR, label="shadow of an object")])[0]


def _class(dataset, grid):
    names = {int(key): name for key, name in dataset.attrs.get("classes", {}).items()}
    # a pixel with several classes shows the rarest
    counts = counted(dataset["class"].values)
    order = sorted(counts, key=lambda number: (number != 0, -counts[number], number))
    rank = np.zeros(max(order) + 1, np.uint32)
    rank[order] = np.arange(len(order))
    image = grid.largest(dataset, lambda part: rank[part["class"].values])
    own = class_colours(names.values())
    colours = ["#000000" if number == 0 else own.get(names.get(number, ""), to_rgb("#ffffff")) for number in order]
    keys = [Patch(facecolor=colour, edgecolor=canvas.FAINT, label=names.get(number, "none"))
            for number, colour in zip(order[:LEGEND], colours, strict=False)]
    return canvas.named_picture(dataset, grid, image, "classes", colours=ListedColormap(colours),
                                limits=(-0.5, len(order) - 0.5), keys=keys)


def _share(dataset, grid):
    numbers = [int(number) - 1 for number in dataset.attrs.get("objects", {})]
    image = grid.mean(dataset, lambda part: part["share"].isel(shape=numbers).sum("shape").transpose(
        "ping", "side", "range").values)
    return _shaded(dataset, grid, image, "share of objects", "share of objects in the echo")


def _hidden(dataset, grid):
    image = grid.mean(dataset, lambda part: part["hidden"].values)
    return _shaded(dataset, grid, image, "hidden", "share of the seabed's echo that objects hide")


def _shaded(dataset, grid, image, what, bar):
    return canvas.named_picture(dataset, grid, image, what, limits=(0, 1), bar=bar, bar_extend="neither",
                                colours=colormaps["inferno"].with_extremes(bad=canvas.PAPER))


def _layover(dataset, grid):
    image = grid.largest(dataset, lambda part: np.minimum(part["layover"].values, 3))
    colours = ["#000000", "#3b3f46", "#f28e2b", "#e15759"]
    words = ("nothing", "one place", "two places", "three and more")
    keys = [Patch(facecolor=colour, edgecolor=canvas.FAINT, label=word)
            for colour, word in zip(colours, words, strict=True)]
    return canvas.named_picture(dataset, grid, image, "layover", colours=ListedColormap(colours), limits=(-0.5, 3.5),
                                keys=keys)


TRUTH = {"objects": (_objects, "share"), "class": (_class, "class"), "share": (_share, "share"),
         "hidden": (_hidden, "hidden"), "layover": (_layover, "layover")}
