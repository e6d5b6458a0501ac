"""Colours and names of labels: which label has which colour, and which shows where several meet."""
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.colors import ListedColormap
from matplotlib.patches import Patch

from .. import canvas

MOST_NAMED = 24                    # labels named at most
NONE, COMMONEST = "#000000", "#a9825a"
OTHERS = (0, 3, 2, 4, 9, 6, 8, 1, 7, 5)                # of matplotlib's ten, those far from the commonest first


@dataclass(frozen=True, kw_only=True)
class LabelKey:
    """The colours of labels."""

    labels: np.ndarray  # (L,): in rising order,
    ranks: np.ndarray  # (L,): and their ranks
    colours: ListedColormap  # of the ranks
    keys: list[Artist]  # of the legend

    @property
    def limits(self) -> tuple[float, float]:
        """Ranks of the first and the last colour."""
        return -0.5, len(self.labels) - 0.5

    def rank(self, values: np.ndarray) -> np.ndarray:
        """Return the ranks of labels (...): where several meet, the largest shows, else small targets vanish."""
        return self.ranks[np.searchsorted(self.labels, values)]


def label_key(counts: Mapping[int, int], names: Mapping[str, str]) -> LabelKey:
    """Choose the colours of labels."""
    order, total = sorted(counts, key=lambda label: (label != 0, -counts[label], label)), sum(counts.values())
    labels = np.array(sorted(counts))
    named = {0: "none", **{int(key): name for key, name in names.items()}}
    palette = [NONE, COMMONEST, *(colormaps["tab10"](k) for k in OTHERS)][order[0] != 0:]
    colours = [palette[k] if k < len(palette) else colormaps["hsv"](0.618034 * k % 1) for k in range(len(order))]
    keys: list[Artist] = [Patch(facecolor=colours[order.index(label)], edgecolor=canvas.FAINT,
                                label=f"{label}  {named.get(label, 'unnamed')}  ({counts[label] / total:.2%})")
                          for label in labels.tolist()[:MOST_NAMED]]
    ranks = np.array([order.index(label) for label in labels], np.min_scalar_type(labels.size))
    return LabelKey(labels=labels, ranks=ranks, colours=ListedColormap(colours), keys=keys)
