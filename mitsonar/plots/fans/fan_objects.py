"""Labels, and outlines of objects and their shadows, on the fan of one ping of an array."""
from collections import Counter

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from mitsonar.device.files import FilePath
from mitsonar.imaging.gain import Tvg
from mitsonar.imaging.objects import object_bins

from .. import canvas
from ..images.label_key import counted, label_key
from ..images.truth import LEGEND, SHADOW_COLOUR, SPECK, class_colours
from .fan_sheet import FanSheet
from .fans import fan_picture, fan_view, name_of, words_of


def fan_labels(dataset: xr.Dataset, path: FilePath | None, *, ping: int = 0) -> Figure:
    """Draw the label of every bin of a ping: the shape with the largest share of its echo."""
    if "label" not in dataset:
        raise ValueError(f"the plot 'labels' needs the variable 'label'; this dataset has "
                         f"{', '.join(map(str, dataset.data_vars))}.")
    if dataset.sizes["beam"] == 1:
        raise ValueError("labels are drawn on a fan; this array has a single beam.")
    canvas.check_ping(ping, dataset.sizes["ping"])
    canvas.check_path(path)
    label, view = dataset["label"].transpose("ping", "beam", "range").values[ping], fan_view(dataset)
    key = label_key(counted(label), dataset.attrs.get("labels", {}))
    sheet = FanSheet(view, title=f"{name_of(dataset)}: labels", subtitle=words_of(dataset, ping), colours=key.colours,
                     limits=key.limits, keys=key.keys)
    inside = view.map.labels(np.ones(label.shape, bool))
    sheet.show(np.where(inside, view.map.labels(key.rank(label)), np.nan))
    return canvas.saved(sheet.figure, path)


def fan_objects(dataset: xr.Dataset, path: FilePath | None, *, ping: int = 0, tvg: Tvg = "seabed") -> Figure:
    """Draw one ping of an array's image, with outlines of objects and of their shadows."""
    canvas.check_ping(ping, dataset.sizes["ping"])
    image = dataset.isel(ping=[ping]).transpose("ping", "beam", "range", ...)
    colours = class_colours(entry["class"] for entry in dataset.attrs.get("objects", {}).values())
    marks, counts = [], Counter()
    for seen in object_bins(image, smallest=SPECK):
        both = [(seen.shadow[0], to_rgb(SHADOW_COLOUR)), (seen.highlight[0], colours[seen.class_name])]
        shown = [(bins, colour) for bins, colour in both if np.any(bins)]
        counts[seen.class_name] += bool(shown)
        marks += shown
    keys = [Patch(facecolor=colours[name], label=f"{name}  ({count})")
            for name, count in sorted(counts.items()) if count]
    return fan_picture(image, path, tvg=tvg, what="objects", marks=marks,
                       keys=[*keys[:LEGEND], Patch(facecolor=SHADOW_COLOUR, label="shadow of an object")])
