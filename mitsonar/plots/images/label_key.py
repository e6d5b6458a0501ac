"""Colours, names and ranks of labels; a label of higher rank covers others in the same pixel."""
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from .. import canvas

MOST_NAMED = 24                    # entries of the legend
NONE, COMMONEST = "#000000", "#a9825a"
OTHERS = (0, 3, 2, 4, 9, 6, 8, 1, 7, 5)                # matplotlib's ten colours; those least like COMMONEST first


@dataclass(frozen=True, kw_only=True)
class LabelKey:
    """Colours of labels."""

    labels: np.ndarray           # (L,) in rising order
    ranks: np.ndarray            # (L,) ranks of the labels
    colours: ListedColormap      # colours of the ranks
    keys: list[Artist]           # entries of the legend

    @property
    def limits(self) -> tuple[float, float]:
        """Ranks of the first and the last colour."""
        return -0.5, len(self.labels) - 0.5

    def rank(self, values: np.ndarray) -> np.ndarray:
        """Return the ranks of labels (...). Rarer labels rank higher, so that small targets stay visible."""
        return self.ranks[np.searchsorted(self.labels, values)]


def counted(labels: np.ndarray) -> Counter[int]:
    """Return the number of bins of every label."""
    values, counts = np.unique(labels, return_counts=True)
    return Counter(dict(zip(values.tolist(), counts.tolist(), strict=True)))


def label_key(counts: Mapping[int, int], names: Mapping[str, str]) -> LabelKey:
    """Return the colours of labels from the number of bins of each label and the names of labels."""
    order, total = sorted(counts, key=lambda label: (label != 0, -counts[label], label)), sum(counts.values())
    labels = np.array(sorted(counts))
    named = {0: "none", **{int(key): name for key, name in names.items()}}
    palette = [NONE, COMMONEST, *(colormaps["tab10"](index) for index in OTHERS)][order[0] != 0:]
    colours = [palette[rank] if rank < len(palette) else colormaps["hsv"](0.618034 * rank % 1)
               for rank in range(len(order))]
    keys: list[Artist] = [Patch(facecolor=colours[order.index(label)], edgecolor=canvas.FAINT,
                                label=f"{label}  {named.get(label, 'unnamed')}  ({counts[label] / total:.2%})")
                          for label in labels.tolist()[:MOST_NAMED]]
    ranks = np.array([order.index(label) for label in labels], np.min_scalar_type(labels.size))
    return LabelKey(labels=labels, ranks=ranks, colours=ListedColormap(colours), keys=keys)
