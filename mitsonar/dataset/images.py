"""Images by number: read when they are asked for, so that a set may be larger than the memory."""
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from mitsonar.device.files import FilePath
from mitsonar.imaging.focused import bin_dims
from mitsonar.imaging.maps.raster import bearings, cartesian
from mitsonar.io.records.records import SonarImage

from .labels.frames import FORMS, Form, LabelFrame, frames
from .labels.writing import groups_of
from .sources import Source, class_order, find_sources, frames_of
from .split import deal, read_shares

if TYPE_CHECKING:
    import xarray as xr

    from .torch_images import TorchImages

COMPLEX = "complex_image"          # a focused image's variable ``image``, whose name the dimension has
# a coordinate that differs from image to image cannot be its dimension's
RENAMED = {"range": "slant_range", "along_track": "along_track_distance", "across_track": "across_track_distance"}


def open(places: FilePath | Iterable[FilePath], *, form: Form | None = None, cell: float | None = None) -> "Images":
    """Open the images of sweeps and files.

    Parameters
    ----------
    places : str or path, or list of them
        Folders of sweeps, whose finished images are taken, EXR and netCDF files.
    form : {'polar', 'cartesian', None}
        None: an image is a record as it was rendered. Else it is a frame of a fan or a rotating head: one ping, or one
        turn, as recorded or in metres (`mitsonar.imaging.cartesian`).
    cell : float or None [m]
        Side of a Cartesian picture's element; None: what fits.

    Returns
    -------
    Images

    Raises
    ------
    FileNotFoundError, ValueError
        If something is not there, no image of mitsonar, or has no frames.

    Examples
    --------
    ``images = open("sweep")`` and then ``images[0]["level"]``; ``open("fans", form="cartesian", cell=0.05)``.
    """
    return Images(find_sources(places), form=form, cell=cell)


class Images:
    """A sequence of images; ``images[3]`` reads one, ``images[10:20]`` is a shorter sequence.

    Attributes
    ----------
    sources : tuple of mitsonar.dataset.sources.Source
        Path, name, parameters, seed and seabed of each.
    classes, object_classes : tuple of str
        Of all shapes, and of objects, in any image, sorted; objects' as the sweep's plan orders them, if it does.
        Class numbers of PyTorch targets count along them from 1.
    form, cell
        As given to `open`.
    """

    def __init__(self, sources: Iterable[Source], *, form: Form | None = None, cell: float | None = None):
        if form not in (None, *FORMS):
            raise ValueError(f"the images are to be {form!r}; choose {', '.join(FORMS)} or None.")
        if cell is not None and form != "cartesian":
            raise ValueError("the side of an element is given, but images are not Cartesian; ask for these, or leave "
                             "it out.")
        self.form: Form | None = form
        self.cell = cell
        self.sources = tuple(sources if form is None else frames_of(sources))
        self.classes = tuple(sorted({name for source in self.sources for name in source.classes}))
        self.object_classes = tuple(class_order(self.sources))

    def __len__(self):
        return len(self.sources)

    @overload
    def __getitem__(self, number: int) -> SonarImage: ...
    @overload
    def __getitem__(self, number: slice) -> "Images": ...

    def __getitem__(self, number):
        if isinstance(number, slice):
            return self._some(self.sources[number])
        return _read(self.sources[number], self.form, self.cell)

    def pictures(self, number: int) -> tuple[SonarImage, list[LabelFrame]]:
        """Return the record of an image, as recorded, and the pictures that are made of it.

        Parameters
        ----------
        number : int

        Returns
        -------
        SonarImage, list of mitsonar.dataset.labels.frames.Frame
            One of the latter where images are frames; else one for each ping of an array.
        """
        source = self.sources[number]
        record = _read(source, None if self.form is None else "polar", None)
        return record, frames(record, source.path, "polar" if self.form is None else self.form, self.cell)

    def __repr__(self):
        return f"<mitsonar.dataset.Images: {len(self)} images, parameters {', '.join(self.parameters) or 'none'}>"

    @property
    def names(self) -> np.ndarray:
        """Names of the images, (image,) text."""
        return np.array([source.name for source in self.sources])

    @property
    def seeds(self) -> np.ndarray:
        """Their seeds, (image,)."""
        return np.array([source.seed for source in self.sources])

    @property
    def seabeds(self) -> np.ndarray:
        """Hashes of their seabeds, (image,); images with the same show the same seabed."""
        return np.array([source.seabed for source in self.sources])

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """Scene parameters: name → (image,) array, of numbers where all are numbers; None where an image has none."""
        names = dict.fromkeys(name for source in self.sources for name in source.parameters)
        return {name: _column([source.parameters.get(name) for source in self.sources]) for name in names}

    def split(self, shares: Mapping[str, float] | str, seed: int = 0, by: str | None = None) -> "dict[str, Images]":
        """Split into subsets that share no seabed.

        Parameters
        ----------
        shares : dict of str, float, or str
            Such as {"train": 0.8, "val": 0.2} or "train=0.8,val=0.2".
        seed : int
            Another seed splits otherwise.
        by : str or None
            A scene parameter in place of the seabed.

        Returns
        -------
        dict of str, Images

        Raises
        ------
        ValueError
            If there are fewer seabeds than subsets, or an image does not know its own.
        """
        if not isinstance(shares, str):
            shares = ",".join(f"{name}={share!r}" for name, share in shares.items())
        shares = read_shares(shares)
        homes = deal(groups_of(self.sources, by), shares, seed, by or "seabed")
        return {name: self._some([source for source, home in zip(self.sources, homes, strict=True) if home == name])
                for name in shares}

    def stack(self, names: str | Sequence[str] = ("level",)) -> dict[str, np.ndarray]:
        """Read variables of all images into arrays.

        Parameters
        ----------
        names : str or sequence of str
            Of variables or coordinates whose shape is the same in every image.

        Returns
        -------
        dict of str, array (image, ...)
            All in memory.

        Raises
        ------
        ValueError
            If an image has no such variable, or it has another shape there.
        """
        names = [names] if isinstance(names, str) else list(names)
        stacked = {}
        for number in range(len(self)):
            image = self[number]
            for name in names:
                if not number:
                    values = self._values(image, name, number)
                    stacked[name] = np.empty((len(self), *values.shape), values.dtype)
                stacked[name][number] = self._values(image, name, number, stacked[name].shape[1:])
        return stacked

    def xarray(self, names: Sequence[str] | None = None) -> "xr.Dataset":
        """Return all images as one dataset with the dimension ``image``, read when it is computed (by Dask).

        Parameters
        ----------
        names : sequence of str or None
            Variables; None: all over the dimensions of ``level``, of a focused image also those without ``bank``.

        Returns
        -------
        xarray.Dataset
            With coordinates of the images over (image, ...), ``range`` as ``slant_range``, ``along_track`` and
            ``across_track`` with ``_distance`` at the end; the variable ``image`` of focused images as
            ``complex_image``; ``name``, ``seed``, ``seabed``, and scene parameters as ``parameter_NAME``.

        Raises
        ------
        ValueError
            If Dask is not installed or there is no such variable; when it is computed, if the images differ in shape.
        """
        try:
            import dask.array
            from dask.delayed import delayed
        except ImportError:
            raise ValueError('Dask, which reads images when they are used, is not installed: run pip install '
                             '"mitsonar[cluster]", or take them into memory by stack()') from None
        import xarray

        first = self[0]
        if names is None:
            names = [str(name) for name, variable in first.data_vars.items()
                     if variable.dims in (first["level"].dims, bin_dims(first))]
        inner = [str(name) for name, coordinate in first.coords.items() if coordinate.dtype.kind in "fiub"
                 and set(coordinate.dims) <= set(first["level"].dims) and (name in RENAMED or name not in first.dims)]
        reads = [delayed(_read)(source, self.form, self.cell) for source in self.sources]

        def lazily(name):
            like = self._values(first, name, 0)
            parts = [dask.array.from_delayed(delayed(self._values)(read, name, number, like.shape), like.shape,
                                             like.dtype) for number, read in enumerate(reads)]
            return ("image", *first[name].dims), dask.array.stack(parts), first[name].attrs

        coords = {name: first[name] for name in first.dims if name in first.coords and name not in RENAMED
                  and name in first["level"].dims}
        coords |= {RENAMED.get(name, name): lazily(name) for name in inner}
        coords |= {"name": ("image", self.names), "seed": ("image", self.seeds), "seabed": ("image", self.seabeds)}
        coords |= {f"parameter_{name}": ("image", values) for name, values in self.parameters.items()}
        return xarray.Dataset({COMPLEX if name == "image" else name: lazily(name) for name in names}, coords)

    def torch(self, *, image: "str | Callable[[xr.Dataset], Any]" = "level",
              target: "str | Callable[[xr.Dataset], Any] | None" = "class",
              transform: Callable[..., Any] | None = None) -> "TorchImages":
        """Return a dataset for PyTorch's DataLoader; it can be pickled if what it is given can.

        Parameters
        ----------
        image : str or callable(xarray.Dataset)
            A variable: float32 (channels, rows, columns), rows and columns as in the pictures of `mitsonar labels`, of
            a sidescan and of a frame one channel, of a whole record of an array its pings, of a focused image its
            banks, of its complex ``image`` real and imaginary part of each; outside a Cartesian fan -200 of levels,
            else 0; or what gives an array.
        target : str, callable(xarray.Dataset) or None
            A variable: the same as int64 (of counts; ``class`` by the set's ``classes``) or float32; ``boxes``: boxes,
            labels and masks as torchvision's detectors want them, labels by the set's ``object_classes``; or what gives
            the target; None: images alone.
        transform : callable(image, target) or callable(image), optional
            Applied to each pair, or to each image where there are no targets.

        Returns
        -------
        torch.utils.data.Dataset

        Raises
        ------
        ImportError
            If PyTorch is not installed.
        """
        try:
            from .torch_images import TorchImages
        except ImportError as error:
            if error.name is None or error.name.partition(".")[0] != "torch":
                raise
            raise ImportError("PyTorch is not installed here; install torch, or use stack() or xarray().") from None
        return TorchImages(self, image=image, target=target, transform=transform)

    def _some(self, sources):
        """Some of the images, with class numbers as here."""
        some = Images([])
        some.form, some.cell, some.sources = self.form, self.cell, tuple(sources)
        some.classes, some.object_classes = self.classes, self.object_classes
        return some

    def _values(self, image, name, number, shape=None):
        """The values of a variable, which must have that shape."""
        if name not in image.variables:
            raise ValueError(f"{self.sources[number].path} has no variable {name}; it has "
                             f"{', '.join(map(str, image.variables))}.")
        values = image[name].values
        if shape is not None and values.shape != tuple(shape):
            raise ValueError(f"{name} of {self.sources[number].path} has the shape {values.shape}, not {tuple(shape)} "
                             f"as in {self.sources[0].path}; stack images of one shape, such as a part of them.")
        return values


def _read(source: Source, form: Form | None, cell: float | None) -> SonarImage:
    """Read an image: a record or one of its frames."""
    record = source.read()
    if form is None or source.frame is None:
        return record
    frame = record.isel(ping=bearings(record)[1][source.frame])
    return SonarImage.of(frame if form == "polar" else cartesian(frame, cell))


def _column(values):
    """An array of values, of numbers where each is one or reads as one."""
    if any(value is None or isinstance(value, (list, dict)) for value in values):
        return np.array(values, dtype=object)
    if all(isinstance(value, bool) for value in values):
        return np.array(values)
    for kind in (int, float):
        try:
            return np.array([kind(value) for value in map(_as_text, values)])
        except ValueError:
            continue
    return np.array([str(value) for value in values])


def _as_text(value):
    return repr(value) if isinstance(value, (int, float)) else value
