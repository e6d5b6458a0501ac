"""Writer of folders for training: pictures, masks, COCO and YOLO, with a common split.

The folder gets its name only when it is complete.
"""
import contextlib
import json
import os
import secrets
import shutil
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from mitsonar.device.files import FilePath, check_writable, full_disk_said
from mitsonar.labels import coco, yolo
from mitsonar.labels.annotations import HIGHLIGHT
from mitsonar.labels.labelling import MASKS, labelled
from mitsonar.labels.pictures import write_png
from mitsonar.labels.rules import Labels

from ..sources import Source, class_order, find_sources
from ..split import deal, planned, shares_of


@dataclass(kw_only=True)
class _Subset:
    videos: list = field(default_factory=list)
    images: list = field(default_factory=list)
    entries: list = field(default_factory=list)


def write(places: FilePath | Iterable[FilePath], folder: FilePath, labels: Labels,
          progress: Callable[[int, int], None] | None = None) -> dict[str, int]:
    """Write pictures and labels of images for training.

    Parameters
    ----------
    places : str or path, or list of them
        EXR and netCDF files, and folders of sweeps.
    folder : str or path
        New or empty folder.
    labels : Labels
        Outputs and their rules.
    progress : callable(done, total) or None
        Called after every image.

    Returns
    -------
    dict of str, int
        Numbers of ``pictures``, ``highlights``, ``shadows`` and ``wholes`` written, of ``negatives`` seen, of
        annotations left out as ``invisible``, and of pictures left out as ``empty``.

    Raises
    ------
    FileNotFoundError, ValueError, PermissionError
        If the images cannot be read, labelled or split, the folder cannot be made, or all pictures of a subset are
        left out as empty.
    OSError
        If the disk fills up; the folder is then removed.

    Warns
    -----
    UserWarning
        If YOLO's training and validation are the same pictures, because the split lacks one of them.
    """
    if os.path.isdir(folder):
        if os.listdir(folder):
            raise ValueError(f"the folder {folder} exists and is not empty; give another folder, or remove this one.")
    elif os.path.exists(folder):
        raise ValueError(f"cannot make the folder {folder}: there is a file of that name; give another name.")
    else:
        check_writable(str(folder).rstrip(os.sep))
    sources = find_sources(places)
    groups = groups_of(sources, labels.split_by) if labels.split else [source.seabed or "" for source in sources]
    homes, by = ["train"] * len(sources), labels.split_by or "seabed"
    if not labels.split and (given := planned([source.planned_split for source in sources], groups)):
        homes, by, labels = given, "plan", replace(labels, split=shares_of(given))
    elif labels.split:
        homes = deal(groups, labels.split, labels.split_seed, by)
    numbers = coco.categories(labels.numbered(_classes(sources, labels)), labels)
    with _complete(Path(os.path.realpath(folder))) as partial:
        writer = _Writer(partial, labels, numbers)
        for done, (source, home) in enumerate(zip(sources, homes, strict=True), 1):
            writer.image(source, home)
            if progress is not None:
                progress(done, len(sources))
        writer.summary({name: sorted({group for group, home in zip(groups, homes, strict=True) if home == name})
                        for name in labels.split or ()}, by)
    if writer.note:
        warnings.warn(writer.note, stacklevel=2)
    return {"pictures": len(writer.names), **writer.counts}


def groups_of(sources: Sequence[Source], by: str | None = None) -> list[str]:
    """Return the group of every image; images of one group stay in one subset.

    Parameters
    ----------
    sources : list of Source
        Images to group.
    by : str or None
        Scene parameter; None: the seabed.

    Returns
    -------
    list of str
        Group of every image.

    Raises
    ------
    ValueError
        If an image has no hash of its seabed, or no such parameter.
    """
    for source in sources:
        if by is None and source.seabed is None:
            raise ValueError(f"{source.path} has no hash of its seabed; render it again with this version, or "
                             "split by a parameter of the scene.")
        if by is not None and by not in source.parameters:
            raise ValueError(f"{source.path} has no scene parameter {by}; it was given "
                             f"{', '.join(sorted(source.parameters)) or 'none'}.")
    return [str(source.seabed if by is None else source.parameters[by]) for source in sources]


def _classes(sources, labels):
    """Return the classes of objects in the order of their numbers."""
    if (wanted := labels.classes) is None:
        return class_order(sources, labels.negatives)
    present = sorted({name for source in sources for name in source.object_classes} - {*labels.negatives})
    lacking = [name for name in present if name not in wanted]
    if lacking:
        raise ValueError(f"the images have objects of the class {', '.join(lacking)}, which the classes given lack; "
                         "give all classes, or name those as negatives.")
    return list(wanted)


class _Writer:
    def __init__(self, folder, labels, numbers):
        self.folder, self.labels, self.numbers = folder, labels, numbers
        self.subsets = {name: _Subset() for name in labels.split or ["train"]}
        self.names, self.annotated, self.note = {}, 0, ""
        self.tracks: dict[tuple[int, str, str], int] = {}              # of videos, by video, category and object
        self.counts = {"highlights": 0, "shadows": 0, **({"wholes": 0} if labels.whole else {}),
                       **({"negatives": 0} if labels.negatives else {}), "invisible": 0, "empty": 0}
        for kind in ("images", *["labels"] * bool(self.labels.yolo),
                     *[f"masks/{kind}" for kind in MASKS] * self.labels.masks):
            (self.folder / kind).mkdir(parents=True)

    def image(self, source: Source, home: str) -> None:
        """Write the pictures of an image into the subset ``home``."""
        subset = self.subsets[home]
        pictures, shown = labelled(source.read(), source.path, self.labels)
        about = {"source": source.path.name, "seabed": source.seabed, "seed": source.seed,
                 "parameters": source.parameters}
        # pictures of pings in a row are a video, unless each is cut into tiles
        in_a_row = len({frame.ping for frame in pictures}) == len(pictures) > 1
        video = self._video(source.name, subset) if in_a_row and self.labels.tile is None else None
        for tile in shown:
            self.counts["invisible"] += tile.invisible
            where = {**tile.description, **about,
                     **({} if video is None else {"video_id": video, "frame_id": tile.number})}
            self._tile(f"{source.name}_{tile.ending}" if tile.ending else source.name, tile, where, subset)

    def _video(self, name, subset):
        """Return the number of a new video."""
        number = 1 + sum(len(each.videos) for each in self.subsets.values())
        subset.videos.append({"id": number, "name": name})
        return number

    def _track(self, description, piece):
        """Return the number of an object's track through a video, one for each category; None without a video."""
        if "video_id" not in description:
            return None
        return self.tracks.setdefault((description["video_id"], piece.category, piece.name), len(self.tracks) + 1)

    def _tile(self, name, tile, description, subset):
        if name in self.names:
            raise ValueError(f"two pictures would both be named {name}; rename a file, or process them separately.")
        pieces, picture = tile.annotated(self.numbers), tile.picture
        if self.labels.drop_empty and tile.is_empty(self.numbers):
            self.counts["empty"] += 1
            return
        self.names[name] = number = len(self.names) + 1
        write_png(picture, self.folder / "images" / f"{name}.png")
        for piece in pieces:
            self.counts[f"{piece.kind}s"] += 1
        if tile.negatives:
            self.counts["negatives"] += sum(tile.negatives.values())
        height, width = picture.shape
        subset.images.append({"id": number, "file_name": f"{name}.png", "height": height, "width": width,
                              **description})
        if self.labels.masks:
            for kind, mask in tile.masks(self.numbers, name).items():
                write_png(mask, self.folder / "masks" / kind / f"{name}.png")
        if self.labels.yolo:
            lines = [yolo.line(piece, self.labels.yolo, self.numbers, height, width) + "\n" for piece in pieces]
            (self.folder / "labels" / f"{name}.txt").write_text("".join(lines), encoding="utf-8")
        if self.labels.coco:
            for piece in pieces:
                self.annotated += 1
                subset.entries.append(coco.entry(piece, self.annotated, number, self.numbers,
                                                 self._track(description, piece)))

    def summary(self, groups: dict[str, list[str]], by: str) -> None:
        """Write the files on all images; `groups` are those of each subset, which were split `by` something."""
        split, files = self.labels.split, {}
        bare = [name for name, subset in self.subsets.items() if not subset.images]
        if bare:
            of = f" of the subset {bare[0]}" * bool(split)
            raise ValueError(f"no picture{of} has an annotation, and empty ones are to be left out; keep them, or give "
                             "images with objects.")
        for name, subset in self.subsets.items():
            if self.labels.coco:
                description = {"description": "sonar images", "subset": name if split else "all", **self.labels.rules}
                text = coco.document(subset.images, subset.entries, self.numbers, description, subset.videos)
                files[f"annotations_{name}.json" if split else "annotations.json"] = text
        if split:
            files["split.json"] = {
                "shares": split, "seed": self.labels.split_seed, "by": by,
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
        """Write the lists of YOLO's subsets; the first replaces a required list that the split lacks, with a note."""
        for name, subset in self.subsets.items():
            text = "".join(f"./images/{image['file_name']}\n" for image in subset.images)
            (self.folder / f"{name}.txt").write_text(text, encoding="utf-8")
        lists = {name: f"{name}.txt" for name in self.subsets}
        lacking, first = [name for name in ("train", "val") if name not in lists], next(iter(lists))
        if lacking:
            self.note = (f"{' and '.join(lacking)} of data.yaml {'is' if len(lacking) == 1 else 'are'} {first}.txt: "
                         "training images cannot validate; split the images (--split train=0.8,val=0.2).")
        # readers of the file require both
        lists = {"train": lists[first], "val": lists[first], **lists}
        (self.folder / "data.yaml").write_text(yolo.data_yaml(lists, self.numbers, self.note), encoding="utf-8")


@contextlib.contextmanager
def _complete(folder):
    """Yield a temporary folder that is renamed when the block succeeds, else removed."""
    partial = folder.with_name(f".{folder.name[:100]}.{secrets.token_hex(4)}")
    try:
        with full_disk_said(folder):
            partial.mkdir()
            yield partial
            if folder.is_dir():
                folder.rmdir()
            partial.rename(folder)
    finally:
        shutil.rmtree(partial, ignore_errors=True)
