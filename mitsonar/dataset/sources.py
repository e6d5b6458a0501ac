"""Sources of images: EXR and netCDF files by name, and the finished renders of sweeps by their manifests.

What failed in a sweep is left out; what `mitsonar.sweep.manifest` says of lines that are damaged holds here too.
"""
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.imaging.maps.raster import bearings
from mitsonar.io.reading import is_netcdf
from mitsonar.io.records import exr, netcdf
from mitsonar.io.records.records import SonarImage
from mitsonar.sweep import manifest
from mitsonar.sweep.manifest import MANIFEST


@dataclass(frozen=True, kw_only=True)
class Source:
    """An image that is there: a record, or a frame of one."""

    path: Path  # of its EXR or netCDF file
    name: str  # unlike that of every other
    parameters: dict[str, Any]  # of the scene, that it was rendered with
    seed: int | None
    seabed: str | None  # hash of its seabed
    classes: tuple[str, ...]  # of all its shapes, sorted
    object_classes: tuple[str, ...]  # of its objects, sorted
    frame: int | None = None  # which of the record's frames, from 0
    planned_classes: tuple[str, ...] | None = None  # of objects, in the order in which the sweep's plan numbers them

    def read(self) -> SonarImage:
        """Read the record."""
        if not is_netcdf(self.path):
            return exr.read(self.path)
        return _image(netcdf.read(self.path), self.path)

    def outline(self) -> SonarImage:
        """Read coordinates and attributes; errors as of `read`."""
        if not is_netcdf(self.path):
            return exr.outline(self.path)
        with netcdf.opened(self.path) as record:
            level = _image(record, self.path)["level"]
            nothing = np.broadcast_to(np.zeros((), level.dtype), level.shape)
            return SonarImage({"level": (level.dims, nothing)}, record.coords.to_dataset().load().coords, record.attrs)


def find_sources(places: FilePath | Iterable[FilePath]) -> list[Source]:
    """Find all images in files and sweeps.

    Parameters
    ----------
    places : str or path, or list of them
        EXR and netCDF files, and folders of sweeps.

    Returns
    -------
    list of Source
        In the order given; of a sweep in the order of the names.

    Raises
    ------
    FileNotFoundError
        If a place, or a file that a sweep has finished, is not there.
    ValueError
        If there are none, one is given twice, or a file or a manifest cannot be read.
    """
    places = [places] if isinstance(places, (str, os.PathLike)) else list(places)
    found = []
    for place in map(Path, places):
        if place.is_dir():
            found += [(path, _flat(path.relative_to(place)), place.resolve().name, classes)
                      for path, classes in _finished(place)]
        else:
            found.append((place, place.stem, place.resolve().parent.name, None))
    if not found:
        raise ValueError("there are no images; give EXR or netCDF files, or folders of sweeps.")
    twice = [path for path, count in Counter(path.resolve() for path, *_ in found).items() if count > 1]
    if twice:
        raise ValueError(f"the image {twice[0]} is given twice; leave one out.")
    names = _apart([name for _, name, *_ in found], [folder for _, _, folder, _ in found])
    return [_source(path, name, classes) for (path, *_, classes), name in zip(found, names, strict=True)]


def class_order(sources: Sequence[Source]) -> list[str]:
    """Return the classes of objects in the order of their numbers: that of the plans, else alphabetical."""
    found = sorted({name for source in sources for name in source.object_classes})
    orders = {source.planned_classes for source in sources}
    if orders <= {None}:
        return found
    if len(orders) > 1:
        raise ValueError("the images come of sweeps whose plans number classes in different ways; give the classes of "
                         "all in one order.")
    order = next(iter(orders)) or ()
    lacking = [name for name in found if name not in order]
    if lacking:
        raise ValueError(f"the images have objects of the class {', '.join(lacking)}, which the classes of their plan "
                         f"({', '.join(order)}) lack; give the classes of all.")
    return list(order)


def frames_of(sources: Iterable[Source]) -> list[Source]:
    """Return every frame of records as an image of its own: a ping of an array, a turn of a rotating head."""
    found = []
    for source in sources:
        try:
            count = len(bearings(source.outline())[1])
        except ValueError as error:
            raise ValueError(f"{source.path} has no frames: {error}") from None
        found += [replace(source, frame=frame, name=source.name if count == 1 else f"{source.name}_frame{frame:04d}")
                  for frame in range(count)]
    return found


def _source(path, name, classes):
    attributes = _attributes(path)
    objects = (attributes.get("objects") or {}).values()
    return Source(path=path, name=name, parameters=attributes.get("parameters") or {}, seed=attributes.get("seed"),
                  seabed=attributes.get("seabed"), classes=tuple(sorted((attributes.get("classes") or {}).values())),
                  object_classes=tuple(sorted({entry["class"] for entry in objects})), planned_classes=classes)


def _attributes(path):
    if not is_netcdf(path):
        return exr.attributes(path)
    with netcdf.opened(path) as record:
        return dict(_image(record, path).attrs)


def _image(record, path):
    """The image in a netCDF file."""
    if not isinstance(record, SonarImage) or "level" not in record:
        raise ValueError(f"{path} holds no image: it has no variable level; give what `mitsonar render` writes.")
    return record


def _finished(folder):
    """Return the files that a sweep's manifest calls done, each with the order of classes of its plan."""
    path = folder / MANIFEST
    if not path.is_file():
        raise ValueError(f"the folder {folder} holds no {MANIFEST}, so it is no sweep of mitsonar; give its files "
                         "by name.")
    entries = manifest.read(path)[0]
    done = [(folder / output, entry.classes) for output, entry in sorted(entries.items()) if entry.status == "ok"]
    paths = [path for path, _ in done]
    outside = [path for path in paths if not path.resolve().is_relative_to(folder.resolve())]
    if outside:
        raise ValueError(f"{path} names the file {outside[0]}, which is outside its folder; give the files by "
                         "name.")
    missing = [path for path in paths if not path.is_file()]
    if missing:
        raise FileNotFoundError(f"{path} names {missing[0]}, which is not there; run the sweep again to make it.")
    if not paths:
        raise ValueError(f"the sweep {folder} has no finished image yet; run it first.")
    return done


def _flat(path):
    return "_".join(path.with_suffix("").parts)


def _apart(names, folders):
    """Put the folder's name before names that several files have."""
    counts = Counter(names)
    names = [f"{folder}_{name}" if counts[name] > 1 else name for name, folder in zip(names, folders, strict=True)]
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"two images would both be called {twice[0]}; rename a file, or do them one after the other.")
    return names
