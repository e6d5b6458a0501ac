"""Images as a dataset of PyTorch. Imported only where it is asked for, so that mitsonar works without PyTorch."""
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import torch  # pyright: ignore[reportMissingImports]  mitsonar does not ask for it
import torch.utils.data  # pyright: ignore[reportMissingImports]  nor for its parts

from .labels.annotations import HIGHLIGHT, annotations
from .labels.frames import frames

if TYPE_CHECKING:
    import xarray as xr

    from .sources import Source


__all__ = ["LabelledImages", "TorchImages"]


class LabelledImages(Protocol):
    """What `TorchImages` asks of images: `mitsonar.dataset.Images` has it."""

    sources: "tuple[Source, ...]"
    classes: tuple[str, ...]
    object_classes: tuple[str, ...]

    def __len__(self) -> int: ...

    def __getitem__(self, number: int, /) -> "xr.Dataset": ...


class TorchImages(torch.utils.data.Dataset):
    """Pairs of image and target; see `mitsonar.dataset.Images.torch`."""

    def __init__(self, images: LabelledImages, *, image: "str | Callable[[xr.Dataset], Any]",
                 target: "str | Callable[[xr.Dataset], Any] | None", transform: Callable[..., Any] | None):
        self.images, self.image, self.target, self.transform = images, image, target, transform

    def __len__(self):
        return len(self.images)

    def __getitem__(self, number):
        dataset = self.images[number]
        if callable(self.image):
            image = self.image(dataset)
        else:
            image = torch.as_tensor(self._laid(dataset, self.image, number).astype(np.float32))
        if self.target is None:
            return image if self.transform is None else self.transform(image)
        target = self._target(dataset, number)
        return (image, target) if self.transform is None else self.transform(image, target)

    def _laid(self, dataset, name, number):
        """A variable as (channels, rows, columns)."""
        path = self.images.sources[number].path
        if name not in dataset.data_vars or set(dataset[name].dims) != set(dataset["level"].dims):
            raise ValueError(f"{path} has no variable {name} over {', '.join(map(str, dataset['level'].dims))}.")
        values = dataset[name].transpose(*dataset["level"].dims).values
        return np.stack([frame.lay(values) for frame in frames(dataset, path)])

    def _target(self, dataset, number):
        if callable(self.target):
            return self.target(dataset)
        if self.target == "boxes":
            return self._boxes(dataset, number)
        values = self._laid(dataset, self.target, number)
        if self.target == "class":
            numbers = np.zeros(1 + max(map(int, dataset.attrs["classes"]), default=0), np.int64)
            for own, name in dataset.attrs["classes"].items():
                numbers[int(own)] = 1 + self.images.classes.index(name)
            return torch.as_tensor(numbers[values])
        return torch.as_tensor(values.astype(np.int64 if values.dtype.kind in "iub" else np.float32))

    def _boxes(self, dataset, number):
        path = self.images.sources[number].path
        pictures = frames(dataset, path)
        if len(pictures) != 1:
            raise ValueError(f"{path} holds {len(pictures)} pictures, one for each ping, and boxes are of one; give a "
                             "function as target.")
        found = [each for each in annotations(dataset, pictures)[0] if each.kind == HIGHLIGHT]
        masks = np.zeros((len(found), pictures[0].height, pictures[0].width), np.uint8)
        boxes = np.zeros((len(found), 4), np.float32)
        for mask, box, each in zip(masks, boxes, found, strict=True):
            left, upper, width, height = each.box
            mask[upper:upper + height, left:left + width] = each.mask
            box[:] = left, upper, left + width, upper + height
        labels = np.array([1 + self.images.object_classes.index(each.class_name) for each in found], np.int64)
        return {"boxes": torch.as_tensor(boxes), "labels": torch.as_tensor(labels), "masks": torch.as_tensor(masks),
                "image_id": number}
