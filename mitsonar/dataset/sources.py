"""Sources of images: EXR and netCDF files by name, and the finished renders of sweeps by their manifests.

Failed renders of a sweep are left out; `mitsonar.sweep.manifest` describes damaged lines.
"""
import os
from collections import Counter
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.imaging.maps.raster import bearings
from mitsonar.io.reading import is_netcdf
from mitsonar.io.records import exr, netcdf
from mitsonar.io.records.records import SonarImage
from mitsonar.sweep.manifest import read_all
from mitsonar.sweep.parts import MANIFEST, manifests


@dataclass(frozen=True, kw_only=True)
class Source:
    """File of an image: a record, or a frame of a record."""

    path: Path  # of the EXR or netCDF file
    name: str  # unique among all images
    parameters: dict[str, Any]  # of the scene as rendered
    seed: int | None
    seabed: str | None  # hash of the seabed
    classes: tuple[str, ...]  # of all shapes, sorted
    object_classes: tuple[str, ...]  # of objects, sorted
    frame: int | None = None  # number of the record's frame, from 0
    planned_classes: tuple[str, ...] | None = None  # of objects, in the order of the sweep's plan
    planned_split: str | None = None  # subset by the sweep's plan

    def read(self) -> SonarImage:
        """Read the record."""
        if not is_netcdf(self.path):
            return exr.read(self.path)
        return _image(netcdf.read(self.path), self.path)

    def outline(self) -> SonarImage:
        """Read only coordinates and attributes; for errors see `read`."""
        if not is_netcdf(self.path):
            return exr.outline(self.path)
        with netcdf.opened(self.path) as record:
            level = _image(record, self.path)["level"]
            zeros = np.broadcast_to(np.zeros((), level.dtype), level.shape)
            return SonarImage({"level": (level.dims, zeros)}, record.coords.to_dataset().load().coords, record.attrs)


def find_sources(places: FilePath | Iterable[FilePath]) -> list[Source]:
    """Return the sources of all images in files and sweeps.

    Parameters
    ----------
    places : str or path, or list of them
        EXR and netCDF files, and folders of sweeps.

    Returns
    -------
    list of Source
        Sources in the order given, those of a sweep in the order of their names.

    Raises
    ------
    FileNotFoundError
        If a file or folder, or a finished file of a sweep, is missing.
    ValueError
        If there are no images, an image is given twice, or a file or a manifest cannot be read.
    """
    places = [places] if isinstance(places, (str, os.PathLike)) else list(places)
    images = []
    for place in map(Path, places):
        if place.is_dir():
            images += [(path, "_".join(path.relative_to(place).with_suffix("").parts), place.resolve().name, entry)
                       for path, entry in _finished(place)]
        else:
            images.append((place, place.stem, place.resolve().parent.name, None))
    if not images:
        raise ValueError("there are no images; give EXR or netCDF files, or folders of sweeps.")
    samples = [path for path, *_ in images if path.suffix.lower() == ".tar"]
    if samples:
        raise ValueError(f"{samples[0]} is a sample, whose pictures are labelled already; gather samples by `mitsonar "
                         "shards`, or give images (.exr).")
    twice = [path for path, count in Counter(path.resolve() for path, *_ in images).items() if count > 1]
    if twice:
        raise ValueError(f"the image {twice[0]} is given twice; leave one out.")
    names = _apart([name for _, name, *_ in images], [folder for _, _, folder, _ in images])
    return [_source(path, name, entry) for (path, *_, entry), name in zip(images, names, strict=True)]


def class_order(sources: Sequence[Source], negatives: Collection[str] = ()) -> list[str]:
    """Return the classes of objects in the order of their numbers: that of the plans, else alphabetical."""
    present = sorted({name for source in sources for name in source.object_classes} - {*negatives})
    orders = {source.planned_classes for source in sources}
    if orders <= {None}:
        return present
    if len(orders) > 1:
        raise ValueError("the images come from sweeps whose plans number classes in different ways; give all classes "
                         "in one order.")
    order = next(iter(orders)) or ()
    lacking = [name for name in present if name not in order]
    if lacking:
        raise ValueError(f"the images have objects of the class {', '.join(lacking)}, which the classes of their plan "
                         f"({', '.join(order)}) lack; give all classes.")
    return list(order)


def frames_of(sources: Iterable[Source]) -> list[Source]:
    """Return every frame of records as a source: a ping of an array, or a turn of a rotating head."""
    frames = []
    for source in sources:
        try:
            count = len(bearings(source.outline())[1])
        except ValueError as error:
            raise ValueError(f"{source.path} has no frames: {error}") from None
        frames += [replace(source, frame=frame, name=source.name if count == 1 else f"{source.name}_frame{frame:04d}")
                   for frame in range(count)]
    return frames


def _source(path, name, entry):
    if is_netcdf(path):
        with netcdf.opened(path) as record:
            attributes = dict(_image(record, path).attrs)
    else:
        attributes = exr.attributes(path)
    objects = (attributes.get("objects") or {}).values()
    return Source(path=path, name=name, parameters=attributes.get("parameters") or {}, seed=attributes.get("seed"),
                  seabed=attributes.get("seabed"), classes=tuple(sorted((attributes.get("classes") or {}).values())),
                  object_classes=tuple(sorted({entry["class"] for entry in objects})),
                  planned_classes=entry and entry.classes, planned_split=entry and entry.split)


def _image(record, path):
    """Return the content of a netCDF file; `ValueError` if it is no image."""
    if not isinstance(record, SonarImage) or "level" not in record:
        raise ValueError(f"{path} holds no image: it has no variable level; give a file from `mitsonar render`.")
    return record


def _finished(folder):
    """Return the finished files of a sweep, each with its entry of the manifest."""
    listed = manifests(os.fspath(folder))
    if not listed:
        raise ValueError(f"the folder {folder} holds no {MANIFEST}, so it is no sweep of mitsonar; give files by name.")
    entries, path = read_all(folder)[0], folder / listed[-1]
    done = [(folder / output, entry) for output, entry in sorted(entries.items()) if entry.status == "ok"]
    paths = [path for path, _ in done]
    outside = [path for path in paths if not path.resolve().is_relative_to(folder.resolve())]
    if outside:
        raise ValueError(f"{path} names the file {outside[0]}, which is outside its folder; give the files by name.")
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FileNotFoundError(f"{path} names {missing[0]}, which is not there; run the sweep again to make it.")
    if not paths:
        raise ValueError(f"the sweep {folder} has no finished image yet; run it first.")
    return done


def _apart(names, folders):
    """Return names with the folder prepended where several files share one."""
    counts = Counter(names)
    names = [f"{folder}_{name}" if counts[name] > 1 else name for name, folder in zip(names, folders, strict=True)]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"two images would both be named {twice[0]}; rename a file, or process them separately.")
    return names
