"""Images as a dataset of PyTorch, imported only on demand, so that mitsonar works without PyTorch."""
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch  # pyright: ignore[reportMissingImports]  optional dependency
import torch.utils.data  # pyright: ignore[reportMissingImports]  optional dependency

from mitsonar.imaging.focused import bin_dims
from mitsonar.imaging.maps.raster import LEVELS
from mitsonar.labels.annotations import HIGHLIGHT, annotations, standing_out
from mitsonar.labels.frames import LabelFrame
from mitsonar.labels.pictures import greys
from mitsonar.labels.rules import Labels
from mitsonar.units import NOTHING_DB

if TYPE_CHECKING:
    import xarray as xr


class LabelledImages(Protocol):
    """Interface that `TorchImages` needs; `mitsonar.dataset.Images` has it."""

    @property
    def sources(self) -> Any: ...                      # by number; each has a path

    @property
    def classes(self) -> tuple[str, ...]: ...

    @property
    def object_classes(self) -> tuple[str, ...]: ...

    def __getitem__(self, number: int, /) -> "xr.Dataset": ...

    def pictures(self, number: int, /) -> "tuple[xr.Dataset, list[LabelFrame]]": ...


class TorchImages(torch.utils.data.Dataset):
    """PyTorch dataset of pairs of image and target; see `mitsonar.dataset.Images.torch`."""

    def __init__(self, images: LabelledImages, *, image: "str | Callable[[xr.Dataset], Any]",
                 target: "str | Callable[[xr.Dataset], Any] | None", transform: Callable[..., Any] | None,
                 rules: Labels | None = None, length: int | None = None):
        self.images, self.image, self.target, self.transform = images, image, target, transform
        self.rules, self.length = rules, length

    def __len__(self):
        return self.length

    def __getitem__(self, number):
        # each form of the image is read at most once, and only if needed
        pictures = functools.cache(lambda: self.images.pictures(number))
        record = functools.cache(lambda: self.images[number])
        if callable(self.image):
            image = self.image(record())
        else:
            image = torch.as_tensor(self._laid(pictures(), self.image, number).astype(np.float32))
        if self.target is None:
            return image if self.transform is None else self.transform(image)
        target = self.target(record()) if callable(self.target) else self._target(pictures(), number)
        return (image, target) if self.transform is None else self.transform(image, target)

    def _laid(self, pictures, name, number):
        """Return a variable as (channels, rows, columns)."""
        dataset, frames = pictures
        path = self.images.sources[number].path
        dims = dataset["level"].dims
        if name not in dataset.data_vars or set(dataset[name].dims) not in ({*dims}, {*bin_dims(dataset)}):
            raise ValueError(f"{path} has no variable {name} over {', '.join(map(str, dims))}.")
        variable = dataset[name].transpose(*(dim for dim in dims if dim in dataset[name].dims))
        channels = []
        banks = variable.values if "bank" in variable.dims else variable.values[None]
        if np.iscomplexobj(banks):
            banks = [part for bank in banks for part in (bank.real, bank.imag)]
        for values in banks:
            zero = np.zeros((), values.dtype)
            for frame in frames:
                channels.append(np.clip(np.nan_to_num(frame.levels(values), nan=NOTHING_DB), NOTHING_DB, None)
                                if name in LEVELS else np.where(frame.seen(), frame.lay(values), zero))
        return np.stack(channels)

    def _target(self, pictures, number):
        if self.target == "boxes":
            return self._boxes(pictures, number)
        values, dataset = self._laid(pictures, self.target, number), pictures[0]
        if self.target == "class":
            numbers = np.zeros(1 + max(map(int, dataset.attrs["classes"]), default=0), np.int64)
            for class_number, name in dataset.attrs["classes"].items():
                if (name := self._named(name)) in self.images.classes:
                    numbers[int(class_number)] = 1 + self.images.classes.index(name)
            return torch.as_tensor(numbers[values])
        return torch.as_tensor(values.astype(np.int64 if values.dtype.kind in "iub" else np.float32))

    def _boxes(self, pictures, number):
        dataset, frames = pictures
        path = self.images.sources[number].path
        if len(frames) != 1:
            raise ValueError(f"{path} holds {len(frames)} pictures, one for each ping, but boxes need one; open it "
                             "with form=\"polar\" or \"cartesian\".")
        frame, = frames
        rules = self.rules or Labels(masks=True, smallest=1)
        pieces, = annotations(dataset, frames, threshold=rules.threshold, smallest=rules.smallest,
                              above_noise_db=rules.above_noise_db)
        if rules.min_contrast is not None:
            pieces = standing_out(pieces, greys(dataset, frames, tvg=rules.tvg, window=rules.window).draw(frame),
                                  rules.min_contrast)
        highlights = [piece for piece in pieces if piece.kind == HIGHLIGHT and piece.shown >= rules.min_visible
                      and self._named(piece.class_name) in self.images.object_classes]
        masks = np.zeros((len(highlights), frame.height, frame.width), np.uint8)
        boxes = np.zeros((len(highlights), 4), np.float32)
        for mask, box, piece in zip(masks, boxes, highlights, strict=True):
            left, upper, width, height = piece.box
            mask[upper:upper + height, left:left + width] = piece.mask
            box[:] = left, upper, left + width, upper + height
        labels = np.array([1 + self.images.object_classes.index(self._named(piece.class_name))
                           for piece in highlights], np.int64)
        return {"boxes": torch.as_tensor(boxes), "labels": torch.as_tensor(labels), "masks": torch.as_tensor(masks),
                "image_id": number}

    def _named(self, class_name):
        """Return the class that a shape is labelled as; None for negatives that are not."""
        return self.rules.negative_class if self.rules and class_name in self.rules.negatives else class_name
