"""Kinds of labels to write and their rules, checked before any work."""
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from mitsonar.imaging.gain import Tvg
from mitsonar.version import __version__

from .frames import FORMS as PICTURES, Form
from .yolo import FORMS


@dataclass(frozen=True, kw_only=True)
class Labels:
    """Kinds of labels to write, and their rules.

    Attributes
    ----------
    coco, masks : bool
        Outputs to write.
    yolo : {'boxes', 'polygons', None}
        Form of YOLO labels to write.
    threshold, above_noise_db : float
        See `mitsonar.imaging.objects.object_bins`.
    classes : sequence of str or None
        Classes of objects in the order of their numbers; None: those of the images in alphabetical order.
    negatives : sequence of str
        Classes of objects that a detector must not find: counted, and annotated only as `negative_class`.
    negative_class : str or None
        Class that negatives are annotated as; None: they are not.
    smallest : int
        Least number of bins of every piece of an annotation.
    min_visible : float
        Least share of an annotation after cutting by tiles and, for objects, after hiding and burial.
    min_contrast : float or None
        Least contrast of an annotation, in standard deviations of the grey values around; see
        `mitsonar.labels.annotations.standing_out`. None: any.
    shadows : bool
        Annotate shadows; otherwise only the masks have them.
    whole : bool
        Add annotations of objects with their shadows as further categories.
    tile : (int, int) or None
        Pings and columns of a tile; None: whole pictures.
    overlap : float
        Share of a tile that its neighbour repeats.
    drop_empty : bool
        Leave out pictures and tiles without annotations.
    tvg : {'seabed', 'target', 'recorder', 'counts', None}
        Gain; see `mitsonar.imaging.gain`.
    form : {'polar', 'cartesian'}
        Form of pictures of fans and rotating heads.
    cell : float or None [m]
        Side of an element of Cartesian pictures; None: as in `mitsonar.imaging.cartesian`.
    window : (float, float) or None [dB]
        Levels of black and white; None: chosen for each image.
    split : dict of str, float or None
        Shares of the subsets, from `read_shares`.
    split_seed : int
        Seed of the split.
    split_by : str or None
        Scene parameter that groups images; None: their seabed.

    Raises
    ------
    ValueError
        If a value is out of range, or no output is chosen.
    """

    coco: bool = False
    yolo: Literal["boxes", "polygons"] | None = None
    masks: bool = False
    threshold: float = 0.5
    above_noise_db: float = 0.0
    classes: Sequence[str] | None = None
    negatives: Sequence[str] = ()
    negative_class: str | None = None
    smallest: int = 8
    min_visible: float = 0.0
    min_contrast: float | None = None
    shadows: bool = True
    whole: bool = False
    tile: tuple[int, int] | None = None
    overlap: float = 0.0
    drop_empty: bool = False
    tvg: Tvg = "seabed"
    form: Form = "polar"
    cell: float | None = None
    window: tuple[float, float] | None = None
    split: Mapping[str, float] | None = None
    split_seed: int = 0
    split_by: str | None = None

    def __post_init__(self):
        if not (self.coco or self.yolo or self.masks):
            raise ValueError("Choose at least one output: --coco, --yolo or --masks.")
        if self.yolo not in (None, *FORMS):
            raise ValueError(f"the form of YOLO is {self.yolo!r}; choose {' or '.join(FORMS)}.")
        if not 0 <= self.threshold < 1:
            raise ValueError(f"the threshold is {self.threshold:g}; give a share of at least 0 and below 1, such as "
                             "0.5.")
        if not self.above_noise_db < math.inf:
            raise ValueError(f"highlights are required {self.above_noise_db:g} dB above the noise; give a finite "
                             "number, such as 0.")
        if self.classes is not None and (not all(self.classes) or len(set(self.classes)) < len(self.classes)):
            raise ValueError(f"the classes are {', '.join(map(repr, self.classes))}; give each name once.")
        if not all(self.negatives) or len(set(self.negatives)) < len(self.negatives):
            raise ValueError(f"the negatives are {', '.join(map(repr, self.negatives))}; give each name once.")
        if both := set(self.classes or ()) & set(self.negatives):
            raise ValueError(f"{', '.join(sorted(both))} is among the classes and the negatives; leave it out of one.")
        if self.negative_class is not None and not (self.negative_class and self.negatives
                                                    and self.negative_class not in self.negatives):
            raise ValueError(f"negatives are to be of the class {self.negative_class!r}; give a name of its own, and "
                             "the classes of the negatives.")
        self.numbered(self.classes or ())
        if self.smallest < 1:
            raise ValueError(f"the smallest annotation has {self.smallest} bins; give 1 or more.")
        if not 0 <= self.min_visible <= 1:
            raise ValueError(f"the least visible share is {self.min_visible:g}; give a share from 0 to 1.")
        if self.min_contrast is not None and not 0 <= self.min_contrast < math.inf:
            raise ValueError(f"the least contrast is {self.min_contrast:g}; give a number of standard deviations, such "
                             "as 0.5.")
        if self.tile is not None and min(self.tile) < 8:
            raise ValueError(f"a tile is {self.tile[0]} pings by {self.tile[1]} bins; give 8 or more of each.")
        if not 0 <= self.overlap <= 0.9:
            raise ValueError(f"the overlap of tiles is {self.overlap:g}; give a share from 0 to 0.9.")
        if self.overlap and self.tile is None:
            raise ValueError("an overlap is given, but no tiles; give their size or leave it out.")
        if self.form not in PICTURES:
            raise ValueError(f"the form of the pictures is {self.form!r}; choose {' or '.join(PICTURES)}.")
        if self.cell is not None and self.form != "cartesian":
            raise ValueError("the side of an element is given, but pictures are not Cartesian; ask for these, or leave "
                             "it out.")
        if self.window is not None and not -math.inf < self.window[0] < self.window[1] < math.inf:
            raise ValueError(f"black is {self.window[0]:g} dB and white {self.window[1]:g} dB; give two numbers, white "
                             "above black.")
        if self.split is None and self.split_by is not None:
            raise ValueError("a parameter to split by is given, but no split; give its shares or leave it out.")

    def numbered(self, classes: Sequence[str]) -> list[str]:
        """Return the classes that have numbers, in their order: negatives are left out, or are the last of them."""
        kept = [name for name in classes if name not in self.negatives]
        if self.negative_class in kept:
            raise ValueError(f"negatives are to be of the class {self.negative_class!r}, which other objects have; "
                             "give a name of its own.")
        return [*kept, *([] if self.negative_class is None else [self.negative_class])]

    @property
    def rules(self) -> dict[str, Any]:
        """Return the rules as JSON for the files."""
        return {"program": f"mitsonar {__version__}", "highlight_threshold": self.threshold,
                "highlight_above_noise_db": self.above_noise_db, "smallest_bins": self.smallest,
                "min_visible": self.min_visible,
                **({} if self.min_contrast is None else {"min_contrast": self.min_contrast}),
                **({} if self.shadows else {"shadows": False}), "whole": self.whole,
                "tile": self.tile and list(self.tile), "overlap": self.overlap,
                **({"negatives": [*self.negatives], "negative_class": self.negative_class} if self.negatives else {}),
                "drop_empty": self.drop_empty, "tvg": self.tvg, "form": self.form, "cell": self.cell}
