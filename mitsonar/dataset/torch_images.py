"""Images as a dataset of PyTorch. Imported only where it is asked for, so that mitsonar works without PyTorch."""
import functools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch  # pyright: ignore[reportMissingImports]  mitsonar does not ask for it
import torch.utils.data  # pyright: ignore[reportMissingImports]  nor for its parts

from mitsonar.imaging.focused import bin_dims
from mitsonar.imaging.maps.raster import LEVELS
from mitsonar.units import NOTHING_DB

from .labels.annotations import HIGHLIGHT, annotations
from .labels.frames import LabelFrame

if TYPE_CHECKING:
    import xarray as xr

    from .sources import Source


class LabelledImages(Protocol):
    """Interface that `TorchImages` needs; `mitsonar.dataset.Images` has it."""

    sources: "tuple[Source, ...]"
    classes: tuple[str, ...]
    object_classes: tuple[str, ...]

    def __len__(self) -> int: ...

    def __getitem__(self, number: int, /) -> "xr.Dataset": ...

    def pictures(self, number: int, /) -> "tuple[xr.Dataset, list[LabelFrame]]": ...


class TorchImages(torch.utils.data.Dataset):
    """Pairs of image and target; see `mitsonar.dataset.Images.torch`."""

    def __init__(self, images: LabelledImages, *, image: "str | Callable[[xr.Dataset], Any]",
                 target: "str | Callable[[xr.Dataset], Any] | None", transform: Callable[..., Any] | None):
        self.images, self.image, self.target, self.transform = images, image, target, transform

    def __len__(self):
        return len(self.images)

    def __getitem__(self, number):
        # what is drawn by name, and what functions are given, are each made once and only where they are asked for
        drawn = functools.cache(lambda: self.images.pictures(number))
        given = functools.cache(lambda: self.images[number])
        if callable(self.image):
            image = self.image(given())
        else:
            image = torch.as_tensor(self._laid(drawn(), self.image, number).astype(np.float32))
        if self.target is None:
            return image if self.transform is None else self.transform(image)
        target = self.target(given()) if callable(self.target) else self._target(drawn(), number)
        return (image, target) if self.transform is None else self.transform(image, target)

    def _laid(self, drawn, name, number):
        """A variable as (channels, rows, columns)."""
        dataset, frames = drawn
        path = self.images.sources[number].path
        dims = dataset["level"].dims
        if name not in dataset.data_vars or set(dataset[name].dims) not in ({*dims}, {*bin_dims(dataset)}):
            raise ValueError(f"{path} has no variable {name} over {', '.join(map(str, dims))}.")
        variable = dataset[name].transpose(*(dim for dim in dims if dim in dataset[name].dims))
        laid = []
        for values in _channels(variable):
            zero = np.zeros((), values.dtype)
            for frame in frames:
                laid.append(np.clip(np.nan_to_num(frame.levels(values), nan=NOTHING_DB), NOTHING_DB, None)
                            if name in LEVELS else np.where(frame.seen(), frame.lay(values), zero))
        return np.stack(laid)

    def _target(self, drawn, number):
        if self.target == "boxes":
            return self._boxes(drawn, number)
        values, dataset = self._laid(drawn, self.target, number), drawn[0]
        if self.target == "class":
            numbers = np.zeros(1 + max(map(int, dataset.attrs["classes"]), default=0), np.int64)
            for own, name in dataset.attrs["classes"].items():
                numbers[int(own)] = 1 + self.images.classes.index(name)
            return torch.as_tensor(numbers[values])
        return torch.as_tensor(values.astype(np.int64 if values.dtype.kind in "iub" else np.float32))

    def _boxes(self, drawn, number):
        dataset, frames = drawn
        path = self.images.sources[number].path
        if len(frames) != 1:
            raise ValueError(f"{path} holds {len(frames)} pictures, one for each ping, and boxes are of one; open it "
                             "with form=\"polar\" or \"cartesian\".")
        frame, = frames
        found = [each for each in annotations(dataset, frames)[0] if each.kind == HIGHLIGHT]
        masks = np.zeros((len(found), frame.height, frame.width), np.uint8)
        boxes = np.zeros((len(found), 4), np.float32)
        for mask, box, each in zip(masks, boxes, found, strict=True):
            left, upper, width, height = each.box
            mask[upper:upper + height, left:left + width] = each.mask
            box[:] = left, upper, left + width, upper + height
        labels = np.array([1 + self.images.object_classes.index(each.class_name) for each in found], np.int64)
        return {"boxes": torch.as_tensor(boxes), "labels": torch.as_tensor(labels), "masks": torch.as_tensor(masks),
                "image_id": number}


def _channels(variable):
    """Values of every bank, and of complex ones the real and the imaginary part."""
    banks = variable.values if "bank" in variable.dims else variable.values[None]
    return [part for bank in banks for part in ((bank.real, bank.imag) if np.iscomplexobj(bank) else (bank,))]
