"""Objects and their shadows outlined on the fan of one ping of an array."""
from collections import Counter

import numpy as np
import xarray as xr
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ..imaging.objects import object_bins
from ..io.files import FilePath
from .fans import check_ping, fan_picture
from .gain import Tvg
from .truth import LEGEND, SHADOW_COLOUR, SPECK, class_colours

__all__ = ["fan_objects"]


def fan_objects(dataset: xr.Dataset, path: FilePath | None, *, ping: int = 0, tvg: Tvg = "seabed") -> Figure:
    """Draw one ping of what `mitsonar.render` gives of an array, with outlines of objects and of their shadows.

    Parameters
    ----------
    dataset : xarray.Dataset
        ``level`` (ping, beam, range) and its labels.
    path, ping, tvg
        As of `fan_picture`.

    Raises
    ------
    ValueError
        If there are no labels, only one beam, no such ping, or the file is of another kind.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    check_ping(ping, dataset.sizes["ping"])
    one = dataset.isel(ping=[ping]).transpose("ping", "beam", "range", ...)
    colours = class_colours(entry["class"] for entry in dataset.attrs.get("objects", {}).values())
    marks, counts = [], Counter()
    for seen in object_bins(one, smallest=SPECK):
        both = [(seen.shadow[0], to_rgb(SHADOW_COLOUR)), (seen.highlight[0], colours[seen.class_name])]
        shown = [(bins, colour) for bins, colour in both if np.any(bins)]
        counts[seen.class_name] += bool(shown)
        marks += shown
    keys = [Patch(facecolor=colours[name], label=f"{name}  ({count})")
            for name, count in sorted(counts.items()) if count]
    return fan_picture(one, path, tvg=tvg, what="objects", marks=marks,
                       keys=[*keys[:LEGEND], Patch(facecolor=SHADOW_COLOUR, label="shadow of one")])
