"""Labels of one ping of an array, the same way up as its fan."""
import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ..io.files import FilePath
from . import canvas
from .fan_sheet import FanSheet
from .fans import check_ping, fan_view, name_of, words_of
from .label_key import label_key

__all__ = ["fan_labels"]


def fan_labels(dataset: xr.Dataset, path: FilePath | None, *, ping: int = 0) -> Figure:
    """Draw which shape brings most of the echo of every bin of a ping.

    Parameters
    ----------
    dataset : xarray.Dataset
        ``label`` (ping, beam, range), and its names in the attribute ``labels``.
    path, ping
        As of `fan`.

    Raises
    ------
    ValueError
        If there are no labels, only one beam, no such ping, or the file is of another kind.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written.
    """
    if "label" not in dataset:
        raise ValueError(f"the plot 'labels' needs the variable 'label'; this dataset has "
                         f"{', '.join(map(str, dataset.data_vars))}.")
    if dataset.sizes["beam"] == 1:
        raise ValueError("labels are drawn on a fan; this array has a single beam.")
    check_ping(ping, dataset.sizes["ping"])
    canvas.check_path(path)
    label, view = dataset["label"].transpose("ping", "beam", "range").values[ping], fan_view(dataset)
    key = label_key(dict(zip(*(found.tolist() for found in np.unique(label, return_counts=True)), strict=True)),
                    dataset.attrs.get("labels", {}))
    sheet = FanSheet(view, title=f"{name_of(dataset)}: labels", subtitle=words_of(dataset, ping), colours=key.colours,
                     limits=key.limits, keys=key.keys)
    inside = view.map.labels(np.ones(label.shape, bool))
    sheet.show(np.where(inside, view.map.labels(key.rank(label)), np.nan))
    return canvas.saved(sheet.figure, path)
