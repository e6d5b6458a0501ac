"""Samples of training sets: the labelled pictures of one record in a tar, as WebDataset and Hugging Face read it.

    KEY.png                 picture, 8 bits
    KEY.json                size, parameters, seed, seabed, gain; annotations as those of COCO, with category names
    KEY.instance.png, KEY.class.png, KEY.shadow.png, KEY.bed_shadow.png      masks, 16 bits
    KEY.txt                 YOLO
    KEY.npz                 variables of the record, laid out as the picture

A key has no dot, by which readers part it from the ending. Tars have no times and no owners, so that equal content has
equal bytes.
"""
import io
import json
import math
import tarfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
import xarray as xr

from . import coco, yolo
from .labelling import LabelledTile, labelled
from .pictures import write_png
from .rules import Labels
from .tally import Tally

# attributes of a record that its pictures' JSON has
TOLD = ("sonar", "file", "parameters", "seed", "seabed", "frequency", "versions", "instruction_set")


@dataclass(frozen=True, kw_only=True)
class SampleRules:
    """Content of samples.

    Attributes
    ----------
    labels : Labels
        Labels and their rules, with the classes of all samples.
    arrays : tuple of str
        Variables of the record over the dimensions of ``level``.
    """

    labels: Labels
    arrays: tuple[str, ...] = ()

    def __post_init__(self):
        if self.labels.classes is None:
            raise ValueError("samples need the classes of all images before the first is made; give classes.")
        if self.labels.split is not None:
            raise ValueError("a split is of a whole set; give it when shards are made.")


def key_of(name: str) -> str:
    """Return the key of the pictures of a sample of that name."""
    return name.replace(".", "_").replace("/", "_")


def write_sample(record: xr.Dataset, stream: IO[bytes], key: str, rules: SampleRules,
                 meshes: Sequence[Mapping[str, str]] = ()) -> Tally:     # of the scene, with their licences
    """Write the labelled pictures of a record as a tar, and return their numbers."""
    about = {**{name: record.attrs.get(name) for name in TOLD}, **({"meshes": [*meshes]} if meshes else {})}
    about["parameters"] = {name: _plain(value) for name, value in (about["parameters"] or {}).items()}
    classes = rules.labels.numbered(rules.labels.classes or ())
    numbers = coco.categories(classes, rules.labels)
    key, tally = key_of(key), Tally()
    with tarfile.open(fileobj=stream, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for tile in labelled(record, key, rules.labels)[1]:
            if rules.labels.drop_empty and tile.is_empty(numbers):
                continue
            if lacking := {piece.class_name for piece in tile.pieces} - set(classes):
                raise ValueError(f"{key} has objects of the class {', '.join(sorted(lacking))}, which the classes "
                                 "of the plan lack; add them to `classes`, or to `negatives` under [labels].")
            name = f"{key}_{tile.ending}" if tile.ending else key
            tally.picture(_counts(tile, numbers), tile.negatives, rules.labels.negative_class)
            for ending, content in _members(record, tile, name, rules, numbers, about):
                info = tarfile.TarInfo(f"{name}.{ending}")
                info.size = len(content)
                tar.addfile(info, io.BytesIO(content))
    return tally


def _members(record, tile: LabelledTile, name: str, rules: SampleRules, numbers: dict[str, int],
             about: Mapping[str, Any]) -> Iterator[tuple[str, bytes]]:
    """Yield the files of a picture: ending and content."""
    (height, width), pieces = tile.picture.shape, tile.annotated(numbers)
    yield "png", _png(tile.picture)
    if rules.labels.masks:
        for kind, mask in tile.masks(numbers, name).items():
            yield f"{kind}.png", _png(mask)
    if rules.labels.yolo:
        lines = [yolo.line(piece, rules.labels.yolo, numbers, height, width) + "\n" for piece in pieces]
        yield "txt", "".join(lines).encode()
    if rules.arrays:
        held = io.BytesIO()
        laid: dict[str, Any] = _arrays(record, tile, rules.arrays)
        np.savez_compressed(held, **laid)
        yield "npz", held.getvalue()
    entries = [{key: value for key, value in coco.entry(piece, number, 0, numbers).items() if key != "image_id"}
               | {"category": piece.category} for number, piece in enumerate(pieces, 1)] * rules.labels.coco
    negatives = {"negatives": tile.negatives, "negative_class": rules.labels.negative_class} if tile.negatives else {}
    yield "json", json.dumps({"height": height, "width": width, "frame": tile.number, **about, **tile.description,
                              "counts": _counts(tile, numbers), **negatives, "annotations": entries},
                             ensure_ascii=False).encode()


def _plain(text: Any) -> Any:
    """Return the text of a scene's parameter as the number or truth value that it reads as, or as it is."""
    try:
        value = json.loads(text.lower())             # XML has TRUE and true
    except (AttributeError, ValueError):
        return text
    return value if isinstance(value, (bool, int, float)) and math.isfinite(value) else text


def _counts(tile, numbers):
    """Return the numbers of annotations by category."""
    return {category: sum(piece.category == category for piece in tile.pieces) for category in numbers}


def _arrays(record, tile, names: Sequence[str]) -> dict[str, np.ndarray]:
    """Return variables of a record as the picture lies."""
    part = np.s_[tile.description["row"]:tile.description["row"] + tile.picture.shape[0],
                 tile.description["column"]:tile.description["column"] + tile.picture.shape[1]]
    laid = {}
    for name in names:
        if name not in record or set(record[name].dims) - set(record["level"].dims):
            raise ValueError(f"the record has no variable {name} over {', '.join(map(str, record['level'].dims))}; "
                             f"it has {', '.join(map(str, record.data_vars))}.")
        values = record[name].transpose(*(dim for dim in record["level"].dims if dim in record[name].dims)).values
        laid[name] = (tile.frame.levels(values) if name == "level" else tile.frame.lay(values))[part]
    return laid


def _png(picture: np.ndarray) -> bytes:
    held = io.BytesIO()
    write_png(picture, held)
    return held.getvalue()
