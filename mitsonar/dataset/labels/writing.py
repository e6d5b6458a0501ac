"""From images to a folder of what training reads: pictures, masks, COCO, YOLO, and the split they share.

The folder appears under its name when everything in it is there, or not at all.
"""
import contextlib
import json
import os
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mitsonar.device.files import FilePath, check_writable, full_disk_said
from mitsonar.imaging.focused import bin_dims, is_focused
from mitsonar.imaging.objects import check_labelled

from ..sources import Source, class_order, find_sources
from ..split import deal
from . import coco, yolo
from .annotations import HIGHLIGHT, WHOLE, annotations, clipped, is_invisible
from .frames import frames, tiles
from .pictures import greys, write_png
from .rules import Labels

MOST_INSTANCES = 65535             # that masks of 16 bits tell apart
MOSTLY = 0.5                       # of a focused image's pings, that do not see what is in shadow
PLACE = ("crs", "local_origin")    # where x = y = 0 is on a map
MASKS = ("instance", "class", "shadow", "bed_shadow")


@dataclass(kw_only=True)
class _Subset:
    images: list = field(default_factory=list)
    entries: list = field(default_factory=list)


def write(places: FilePath | Iterable[FilePath], folder: FilePath, labels: Labels,
          progress: Callable[[int, int], None] | None = None) -> dict[str, int]:
    """Write what training reads from images.

    Parameters
    ----------
    places : str or path, or list of them
        EXR and netCDF files, and folders of sweeps.
    folder : str or path
        To be made; an empty one may be there.
    labels : Labels
    progress : callable(done, total) or None
        Told the number of images done.

    Returns
    -------
    dict of str, int
        How many ``pictures``, ``highlights``, ``shadows`` and ``wholes`` were written, annotations left out as
        ``invisible``, and pictures without annotations that were left out as ``empty``.

    Raises
    ------
    FileNotFoundError, ValueError, PermissionError
        If the images cannot be read, labelled or split, the folder cannot be made, or empty pictures are to be left
        out and a subset has no others.
    OSError
        If the disk fills up; nothing is left behind.

    Warns
    -----
    UserWarning
        If YOLO's training and validation are the same pictures, for want of a split into both.
    """
    if os.path.isdir(folder):
        if os.listdir(folder):
            raise ValueError(f"the folder {folder} exists and is not empty; give another, or remove it first.")
    elif os.path.exists(folder):
        raise ValueError(f"cannot make the folder {folder}: there is a file of that name; give another.")
    else:
        check_writable(str(folder).rstrip(os.sep))
    sources = find_sources(places)
    groups = groups_of(sources, labels.split_by) if labels.split else []
    homes = ["train"] * len(sources)
    if labels.split:
        homes = deal(groups, labels.split, labels.split_seed, labels.split_by or "seabed")
    numbers = coco.categories(_classes(sources, labels.classes), whole=labels.whole)
    with _whole(Path(os.path.realpath(folder))) as made:
        writer = _Writer(made, labels, numbers)
        for done, (source, home) in enumerate(zip(sources, homes, strict=True), 1):
            writer.image(source, home)
            if progress is not None:
                progress(done, len(sources))
        writer.summary({name: sorted({group for group, home in zip(groups, homes, strict=True) if home == name})
                        for name in labels.split or ()})
    if writer.note:
        warnings.warn(writer.note, stacklevel=2)
    return {"pictures": len(writer.names), **writer.counts}


def groups_of(sources: Sequence[Source], by: str | None = None) -> list[str]:
    """Return for every image the text of what it must not be parted from.

    Parameters
    ----------
    sources : list of Source
    by : str or None
        A scene parameter; None for the seabed.

    Returns
    -------
    list of str

    Raises
    ------
    ValueError
        If an image does not know its seabed, or has no such parameter.
    """
    for source in sources:
        if by is None and source.seabed is None:
            raise ValueError(f"{source.path} does not say which seabed it shows; render it again with this version, or "
                             "split by a parameter of the scene.")
        if by is not None and by not in source.parameters:
            raise ValueError(f"{source.path} has no scene parameter {by}; it was given "
                             f"{', '.join(sorted(source.parameters)) or 'none'}.")
    return [str(source.seabed if by is None else source.parameters[by]) for source in sources]


def _classes(sources, wanted):
    """Return the classes of objects in the order of their numbers."""
    if wanted is None:
        return class_order(sources)
    found = sorted({name for source in sources for name in source.object_classes})
    lacking = [name for name in found if name not in wanted]
    if lacking:
        raise ValueError(f"the images have objects of the class {', '.join(lacking)}, which the classes given lack; "
                         "give all.")
    return list(wanted)


def _dark(dataset):
    """The bins in shadow that is no object's, over the dimensions of the truth."""
    dims = bin_dims(dataset)
    dark = dataset["shadow"].transpose(*dims).values > (MOSTLY if is_focused(dataset) else 0)
    if "object_shadow" in dataset:
        dark &= dataset["object_shadow"].transpose(*dims).values == 0
    return dark


class _Writer:
    def __init__(self, folder, labels, numbers):
        self.folder, self.labels, self.numbers = folder, labels, numbers
        self.subsets = {name: _Subset() for name in labels.split or ["train"]}
        self.names, self.annotated, self.note = {}, 0, ""
        self.counts = {"highlights": 0, "shadows": 0, **({"wholes": 0} if labels.whole else {}), "invisible": 0,
                       "empty": 0}
        for kind in ("images", *["labels"] * bool(self.labels.yolo),
                     *[f"masks/{kind}" for kind in MASKS] * self.labels.masks):
            (self.folder / kind).mkdir(parents=True)

    def image(self, source, home):
        """Write the pictures of an image for the subset of that name."""
        subset = self.subsets[home]
        dataset = source.read()
        check_labelled(dataset, source.path)
        pictures = frames(dataset, source.path, self.labels.form, self.labels.cell)
        shown = greys(dataset, pictures, tvg=self.labels.tvg, window=self.labels.window)
        found = annotations(dataset, pictures, threshold=self.labels.threshold, smallest=self.labels.smallest,
                            above_noise_db=self.labels.above_noise_db, whole=self.labels.whole)
        dark = None
        if self.labels.masks and "shadow" in dataset:
            dark = _dark(dataset)
        about = {"source": source.path.name, "seabed": source.seabed, "seed": source.seed,
                 "parameters": source.parameters, "window_db": [round(value, 3) for value in shown.window],
                 "grey": f"{shown.words} [{shown.unit}]"}
        if is_focused(dataset):
            about |= {name: dataset.attrs[name] for name in PLACE if dataset.attrs.get(name) is not None}
        for frame, own in zip(pictures, found, strict=True):
            picture = shown.draw(frame)
            unheard = np.zeros(picture.shape, bool) if dark is None else frame.lay(dark)
            seen = [piece for piece in own if not is_invisible(piece, picture)]
            self.counts["invisible"] += len(own) - len(seen)
            for tile in tiles(frame, self.labels.tile, self.labels.overlap):
                name = f"{source.name}_{frame.name}" if frame.name else source.name
                name += f"_{tile.row}_{tile.column}" * (self.labels.tile is not None)
                inside = [piece for piece in (clipped(each, tile, self.labels.smallest) for each in seen)
                          if piece and piece.shown >= self.labels.min_visible]
                where = {"ping": frame.ping, "row": tile.row, "column": tile.column, **about,
                         **frame.metres(tile.row, tile.column)}
                own = np.s_[tile.row:tile.row + tile.height, tile.column:tile.column + tile.width]
                self._tile(name, picture[own], unheard[own], inside, where, subset)

    def _tile(self, name, picture, unheard, found, about, subset):
        if name in self.names:
            raise ValueError(f"two pictures would both be called {name}; rename an EXR, or do them one after "
                             "the other.")
        if self.labels.drop_empty and not found:
            self.counts["empty"] += 1
            return
        self.names[name] = number = len(self.names) + 1
        write_png(picture, self.folder / "images" / f"{name}.png")
        for each in found:
            self.counts[f"{each.kind}s"] += 1
        height, width = picture.shape
        subset.images.append({"id": number, "file_name": f"{name}.png", "height": height, "width": width, **about})
        if self.labels.masks:
            self._masks(name, unheard, found)
        if self.labels.yolo:
            lines = [yolo.line(each, self.labels.yolo, self.numbers, height, width) + "\n" for each in found]
            (self.folder / "labels" / f"{name}.txt").write_text("".join(lines), encoding="utf-8")
        if self.labels.coco:
            for each in found:
                self.annotated += 1
                subset.entries.append(coco.entry(each, self.annotated, number, self.numbers))

    def _masks(self, name, unheard, found):
        masks = {kind: np.zeros(unheard.shape, np.uint16) for kind in MASKS}
        masks["bed_shadow"][unheard] = 1
        for each in (each for each in found if each.kind != WHOLE):
            if max(each.label, self.numbers[each.category]) > MOST_INSTANCES:
                raise ValueError(f"{name} has objects numbered up to {each.label}, and masks tell {MOST_INSTANCES} "
                                 "apart; leave the masks out.")
            height, width = each.mask.shape
            where = (slice(each.row, each.row + height), slice(each.column, each.column + width))
            masks["instance" if each.kind == HIGHLIGHT else "shadow"][where][each.mask] = each.label
            masks["bed_shadow"][where][each.mask] = 0
            if each.kind == HIGHLIGHT:
                masks["class"][where][each.mask] = self.numbers[each.category]
        for kind, mask in masks.items():
            write_png(mask, self.folder / "masks" / kind / f"{name}.png")

    def summary(self, groups):
        """Write what is said of all images; `groups` are those of each subset."""
        split, files = self.labels.split, {}
        bare = [name for name, subset in self.subsets.items() if not subset.images]
        if bare:
            of = f" of the subset {bare[0]}" * bool(split)
            raise ValueError(f"no picture{of} has an annotation, and empty ones are to be left out; keep them, or give "
                             "images with objects.")
        for name, subset in self.subsets.items():
            if self.labels.coco:
                about = {"description": "sonar images", "subset": name if split else "all", **self.labels.rules}
                text = coco.document(subset.images, subset.entries, self.numbers, about)
                files[f"annotations_{name}.json" if split else "annotations.json"] = text
        if split:
            files["split.json"] = {
                "shares": split, "seed": self.labels.split_seed, "by": self.labels.split_by or "seabed",
                "images": {name: [image["file_name"] for image in subset.images]
                           for name, subset in self.subsets.items()},
                "groups": groups}
        if self.labels.masks:
            files["masks/classes.json"] = {str(number): name for name, number in self.numbers.items()
                                           if coco.kind_of(name) == HIGHLIGHT}
        for name, content in files.items():
            (self.folder / name).write_text(json.dumps(content, ensure_ascii=False) + "\n", encoding="utf-8")
        if self.labels.yolo:
            self._lists()

    def _lists(self):
        """The lists of YOLO's subsets; one that it asks for and the split lacks is the first, which is said."""
        for name, subset in self.subsets.items():
            text = "".join(f"./images/{image['file_name']}\n" for image in subset.images)
            (self.folder / f"{name}.txt").write_text(text, encoding="utf-8")
        lists = {name: f"{name}.txt" for name in self.subsets}
        lacking, first = [name for name in ("train", "val") if name not in lists], next(iter(lists))
        if lacking:
            self.note = (f"{' and '.join(lacking)} of data.yaml {'is' if len(lacking) == 1 else 'are'} {first}.txt: "
                         "what is trained on cannot validate; split the images (--split train=0.8,val=0.2).")
        # programs that read it insist on both
        lists = {"train": lists[first], "val": lists[first], **lists}
        (self.folder / "data.yaml").write_text(yolo.data_yaml(lists, self.numbers, self.note), encoding="utf-8")


@contextlib.contextmanager
def _whole(folder):
    """A folder under another name that gets its own when the block succeeds, and vanishes if not."""
    made = folder.with_name(f".{folder.name[:100]}.{secrets.token_hex(4)}")
    try:
        with full_disk_said(folder):
            made.mkdir()
            yield made
            if folder.is_dir():
                folder.rmdir()
            made.rename(folder)
    finally:
        shutil.rmtree(made, ignore_errors=True)
