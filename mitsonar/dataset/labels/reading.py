"""Reader of labelled pictures of any origin: public sets of real sonar pictures, or folders that `write` made.

    FOLDER/*.json               COCO, if it has ``images`` and ``annotations``: polygons, or boxes where there are none
    labels/NAME.txt             YOLO: boxes or polygons in shares of the picture; also beside the pictures
    masks/NAME.png              above 0 where an object is; each connected patch is an object

The first of these that a folder has is read. ``labels`` and ``masks`` stand beside, or in place of, ``images`` in the
path of a picture. A picture without labels has no objects.
"""
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mitsonar.device.files import FilePath

SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")
OTHERS = ("labels", "masks")       # folders of labels, which are no pictures
MASKS = (".instance", ".class", ".shadow", ".bed_shadow")      # masks beside the pictures of a sample


@dataclass(frozen=True, kw_only=True)
class LabelledPicture:
    """A picture and the places of its objects."""

    path: Path
    grey: np.ndarray  # (rows, columns) float32, grey values as they are
    number: np.ndarray  # (rows, columns) int32: object from 1; 0: none
    classes: tuple[str, ...]  # of the objects; YOLO has numbers, masks have no classes


def read(folder: FilePath) -> list[LabelledPicture]:
    """Read all pictures of a folder and its subfolders with their labels.

    Parameters
    ----------
    folder : str or path
        Folder with pictures and COCO, YOLO or masks.

    Returns
    -------
    list of LabelledPicture
        Pictures sorted by path. Where labels overlap, the smaller one lies on top.

    Raises
    ------
    FileNotFoundError, ValueError
        If there is no such folder, it has no pictures or no labels, or labels cannot be understood.
    """
    folder = Path(folder)
    if not folder.is_dir():
        raise FileNotFoundError(f"there is no folder {folder}; give one with pictures and their labels.")
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES
                   and not {*path.relative_to(folder).parts[:-1]} & {*OTHERS}
                   and not _is_mask(path))
    if not paths:
        raise ValueError(f"the folder {folder} has no pictures; give one with PNG, JPEG or TIFF files, "
                         "or unpack the tars of a sweep of samples or of shards.")
    coco = [document for path in sorted(folder.glob("*.json")) if (document := _coco(path))]
    texts = {path: _beside(path, "labels", (".txt",)) for path in paths}
    masks = {path: _beside(path, "masks", SUFFIXES) for path in paths}
    if coco:
        known = {name: found for document in coco for name, found in _entries(document).items()}
        return [_drawn(path, known.get(path.name, [])) for path in paths]
    if any(texts.values()):
        return [_drawn(path, _lines(text) if text else [], shares=True) for path, text in texts.items()]
    if any(masks.values()):
        return [_masked(path, mask) for path, mask in masks.items()]
    raise ValueError(f"the folder {folder} has no labels; give COCO's JSON, YOLO's texts in labels, or masks.")


def _is_mask(path: Path) -> bool:
    """Return True for the mask of a sample, which has the name of its picture before ``.class.png`` and the like."""
    name = Path(path.stem)
    return name.suffix in MASKS and path.with_name(name.stem + path.suffix).is_file()


def _grey(path: Path) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as picture:
        return np.asarray(picture if picture.mode in ("L", "I;16", "I", "F") else picture.convert("L"), np.float32)


def _beside(path: Path, kind: str, suffixes: Iterable[str]) -> Path | None:
    """Return the label file of a picture: in a folder of that kind, or a text beside it."""
    parts = list(path.parent.parts)
    if "images" in parts:
        parts[-1 - parts[::-1].index("images")] = kind
    folders = [Path(*parts), path.parent / kind] + [path.parent] * (kind == "labels")
    candidates = (place / f"{path.stem}{suffix}" for place in folders for suffix in suffixes)
    return next((place for place in candidates if place.is_file() and place != path), None)


def _coco(path: Path) -> dict | None:
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except ValueError:
        raise ValueError(f"{path} is no JSON; remove it, or give COCO's.") from None
    return document if isinstance(document, dict) and {"images", "annotations"} <= {*document} else None


def _entries(document: dict) -> dict[str, list]:
    """Return class and rings of the annotations by the name of the picture."""
    classes = {one["id"]: str(one["name"]) for one in document.get("categories", [])}
    names = {one["id"]: Path(one["file_name"]).name for one in document["images"]}
    entries = {name: [] for name in names.values()}
    for one in document["annotations"]:
        rings = one.get("segmentation")
        if not isinstance(rings, list) or not rings:
            left, upper, wide, high = one["bbox"]
            rings = [_box(left, upper, wide, high)]
        entries[names[one["image_id"]]].append((classes.get(one["category_id"], str(one["category_id"])), rings))
    return entries


def _lines(path: Path) -> list:
    """Return class and rings of the lines of a text of YOLO."""
    entries = []
    for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1):
        if not (words := line.split()):
            continue
        try:
            values = [float(word) for word in words[1:]]
        except ValueError:
            values = []
        if len(values) < 4 or len(values) % 2:
            raise ValueError(f"line {number} of {path} is {line!r}; a class and four numbers of a box, or the points "
                             "of a polygon, are needed.")
        x, y, wide, high = values[:4]
        entries.append((words[0], [_box(x - wide / 2, y - high / 2, wide, high) if len(values) == 4 else values]))
    return entries


def _box(left: float, upper: float, wide: float, high: float) -> list[float]:
    return [left, upper, left + wide, upper, left + wide, upper + high, left, upper + high]


def _drawn(path: Path, entries: list, *, shares: bool = False) -> LabelledPicture:
    """Return a picture with the elements whose middles lie in rings; these are in elements, or shares of the sides."""
    from rasterio.features import rasterize

    grey = _grey(path)
    sides = np.array(grey.shape[::-1]) if shares else 1
    number = np.zeros(grey.shape, np.int32)
    masks = []
    for _, rings in entries:
        shapes = [{"type": "Polygon", "coordinates": [[*points.tolist(), points[0].tolist()]]}
                  for points in (np.reshape(ring, (-1, 2)) * sides for ring in rings)]
        masks.append(rasterize(shapes, out_shape=grey.shape).astype(bool))
    for which in sorted(range(len(masks)), key=lambda which: -np.count_nonzero(masks[which])):
        number[masks[which]] = which + 1
    return LabelledPicture(path=path, grey=grey, number=number, classes=tuple(name for name, _ in entries))


def _masked(path: Path, mask: Path | None) -> LabelledPicture:
    from scipy import ndimage

    grey = _grey(path)
    drawn = _grey(mask) if mask else np.zeros_like(grey)
    if drawn.shape != grey.shape:
        raise ValueError(f"{mask} has {drawn.shape} elements, and its picture {grey.shape}; give masks of that size.")
    number, count = ndimage.label(drawn > 0, np.ones((3, 3)))
    return LabelledPicture(path=path, grey=grey, number=number.astype(np.int32), classes=("",) * count)
