"""Sequence of images that are read when used, so that a set may be larger than the memory."""
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from mitsonar.device.extras import MissingExtra
from mitsonar.device.files import FilePath
from mitsonar.imaging.focused import bin_dims
from mitsonar.imaging.maps.raster import bearings, cartesian
from mitsonar.io.records.records import SonarImage
from mitsonar.labels.frames import FORMS, Form, LabelFrame, frames

from .labels.writing import groups_of
from .sources import Source, class_order, find_sources, frames_of
from .split import deal, planned, read_shares, shares_of

if TYPE_CHECKING:
    import xarray as xr

    from .torch_images import TorchImages

COMPLEX = "complex_image"          # name of a focused image's variable ``image`` beside that dimension
# a coordinate that differs between images cannot index a dimension
RENAMED = {"range": "slant_range", "along_track": "along_track_distance", "across_track": "across_track_distance"}


def open(places: FilePath | Iterable[FilePath], *, form: Form | None = None, cell: float | None = None) -> "Images":
    """Open the images of sweeps and files.

    Parameters
    ----------
    places : str or path, or list of them
        EXR and netCDF files, and folders of sweeps, of which the finished images are taken.
    form : {'polar', 'cartesian', None}
        None: every image is a record as rendered. Otherwise every image is a frame of a fan or a rotating head: one
        ping or one turn, as recorded or in metres (`mitsonar.imaging.cartesian`).
    cell : float or None [m]
        Side of an element of Cartesian pictures; None: a default that fits.

    Returns
    -------
    Images

    Raises
    ------
    FileNotFoundError, ValueError
        If a file is missing, is no image of mitsonar, or has no frames.

    Examples
    --------
    ``images = open("sweep")`` and then ``images[0]["level"]``; ``open("fans", form="cartesian", cell=0.05)``.
    """
    return Images(find_sources(places), form=form, cell=cell)


class Images:
    """Sequence of images; ``images[3]`` reads an image, ``images[10:20]`` is a shorter sequence.

    Attributes
    ----------
    sources : tuple of mitsonar.dataset.sources.Source
        Path, name, parameters, seed and seabed of each image.
    classes, object_classes : tuple of str
        Classes of all shapes, and of objects, in any image. They are sorted; object classes keep the order of the
        sweep's plan if it has one. Class numbers of PyTorch targets count along them from 1.
    form, cell
        Arguments of `open`.
    """

    def __init__(self, sources: Iterable[Source], *, form: Form | None = None, cell: float | None = None):
        if form not in (None, *FORMS):
            raise ValueError(f"the form of the images is {form!r}; choose {', '.join(FORMS)} or None.")
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
            return self._subset(self.sources[number])
        return _read(self.sources[number], self.form, self.cell)

    def pictures(self, number: int) -> tuple[SonarImage, list[LabelFrame]]:
        """Return the record of an image, as recorded, and its pictures.

        Parameters
        ----------
        number : int
            Index of the image.

        Returns
        -------
        SonarImage, list of mitsonar.labels.frames.LabelFrame
            The record, and a single frame if images are frames; otherwise a frame for each ping of an array.
        """
        source = self.sources[number]
        record = _read(source, None if self.form is None else "polar", None)
        return record, frames(record, source.path, "polar" if self.form is None else self.form, self.cell)

    def __repr__(self):
        return f"<mitsonar.dataset.Images: {len(self)} images, parameters {', '.join(self.parameters) or 'none'}>"

    @property
    def names(self) -> np.ndarray:
        """Return the names of the images, (image,) text."""
        return np.array([source.name for source in self.sources])

    @property
    def seeds(self) -> np.ndarray:
        """Return the seeds of the images, (image,)."""
        return np.array([source.seed for source in self.sources])

    @property
    def seabeds(self) -> np.ndarray:
        """Return hashes of the seabeds, (image,); equal hashes mean the same seabed."""
        return np.array([source.seabed for source in self.sources])

    @property
    def parameters(self) -> dict[str, np.ndarray]:
        """Return the scene parameters as name → (image,) array, numeric if possible; None for images without one."""
        names = dict.fromkeys(name for source in self.sources for name in source.parameters)
        return {name: _column([source.parameters.get(name) for source in self.sources]) for name in names}

    def split(self, shares: Mapping[str, float] | str | None = None, seed: int = 0,
              by: str | None = None) -> "dict[str, Images]":
        """Split into subsets that share no seabed.

        Parameters
        ----------
        shares : dict of str, float, str or None
            Shares of the subsets, such as {"train": 0.8, "val": 0.2} or "train=0.8,val=0.2". None: the subsets of the
            sweeps' plans.
        seed : int
            Seed of the order in which groups are assigned.
        by : str or None
            Scene parameter that replaces the seabed.

        Returns
        -------
        dict of str, Images

        Raises
        ------
        ValueError
            If there are fewer seabeds than subsets, an image has no hash of its seabed, or a plan has no split.
        """
        if shares is None:
            homes = planned([source.planned_split for source in self.sources],
                            [source.seabed for source in self.sources])
            if not homes:
                raise ValueError("the plan of these images has no [split]; give shares, such as train=0.8,val=0.2.")
            return self._subsets(homes, shares_of(homes))
        if not isinstance(shares, str):
            shares = ",".join(f"{name}={share!r}" for name, share in shares.items())
        shares = read_shares(shares)
        homes = deal(groups_of(self.sources, by), shares, seed, by or "seabed")
        return self._subsets(homes, shares)

    def _subsets(self, homes, names):
        return {name: self._subset([source for source, home in zip(self.sources, homes, strict=True) if home == name])
                for name in names}

    def stack(self, names: str | Sequence[str] = ("level",)) -> dict[str, np.ndarray]:
        """Read variables of all images into arrays.

        Parameters
        ----------
        names : str or sequence of str
            Names of variables or coordinates with the same shape in every image.

        Returns
        -------
        dict of str, array (image, ...)
            Arrays in memory.

        Raises
        ------
        ValueError
            If an image lacks a variable, or the variable has another shape there.
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
        """Return all images as one dataset with the dimension ``image``, read by Dask when computed.

        Parameters
        ----------
        names : sequence of str or None
            Names of variables. None: all over the dimensions of ``level``, for focused images also without ``bank``.

        Returns
        -------
        xarray.Dataset
            Variables and coordinates over (image, ...). ``range`` becomes ``slant_range``, ``along_track`` and
            ``across_track`` get ``_distance`` appended, and ``image`` of focused images becomes ``complex_image``.
            Further coordinates are ``name``, ``seed``, ``seabed``, and scene parameters as ``parameter_NAME``.

        Raises
        ------
        ValueError
            If Dask is not installed or a variable is missing; during the computation, if shapes of images differ.
        """
        try:
            import dask.array
            from dask.delayed import delayed
        except ImportError:
            raise MissingExtra("Dask, which reads images when they are used, is not installed", "cluster",
                               "read them into memory by stack()") from None
        import xarray

        first = self[0]
        if names is None:
            names = [str(name) for name, variable in first.data_vars.items()
                     if variable.dims in (first["level"].dims, bin_dims(first))]
        inner = [str(name) for name, coordinate in first.coords.items() if coordinate.dtype.kind in "fiub"
                 and set(coordinate.dims) <= set(first["level"].dims) and (name in RENAMED or name not in first.dims)]
        reads = [delayed(_read)(source, self.form, self.cell) for source in self.sources]

        def lazily(name: str) -> tuple[tuple[str, ...], Any, dict]:
            like = self._values(first, name, 0)
            parts = [dask.array.from_delayed(delayed(self._values)(read, name, number, like.shape), like.shape,
                                             like.dtype) for number, read in enumerate(reads)]
            return ("image", *map(str, first[name].dims)), dask.array.stack(parts), first[name].attrs

        coords = {name: first[name] for name in first.dims if name in first.coords and name not in RENAMED
                  and name in first["level"].dims}
        coords |= {RENAMED.get(name, name): lazily(name) for name in inner}
        coords |= {"name": ("image", self.names), "seed": ("image", self.seeds), "seabed": ("image", self.seabeds)}
        coords |= {f"parameter_{name}": ("image", values) for name, values in self.parameters.items()}
        return xarray.Dataset({COMPLEX if name == "image" else name: lazily(name) for name in names}, coords)

    def torch(self, *, image: "str | Callable[[xr.Dataset], Any]" = "level",
              target: "str | Callable[[xr.Dataset], Any] | None" = "class",
              transform: Callable[..., Any] | None = None) -> "TorchImages":
        """Return a dataset for PyTorch's DataLoader; it can be pickled if its arguments can.

        Parameters
        ----------
        image : str or callable(xarray.Dataset)
            Name of a variable, or function that returns an array. A variable becomes float32 (channels, rows, columns)
            with rows and columns as in the pictures of `mitsonar labels`. A sidescan or a frame has one channel, the
            record of an array a channel per ping, a focused image a channel per bank, and its complex ``image`` two
            (real and imaginary part). Outside a Cartesian fan, levels are -200 and other variables 0.
        target : str, callable(xarray.Dataset) or None
            Name of a variable, or function that returns the target; None: images without targets. A variable has the
            layout of ``image``, as int64 (integers; ``class`` numbered by ``classes``) or float32. ``boxes`` gives
            boxes, labels (by ``object_classes``) and masks as torchvision's detectors expect.
        transform : callable(image, target) or callable(image), optional
            Function applied to each pair, or to each image without target.

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
            raise ImportError("PyTorch is not installed here; run pip install 'mitsonar[torch]', or use "
                              "stack() or xarray().") from None
        return TorchImages(self, image=image, target=target, transform=transform, length=len(self))

    def _subset(self, sources):
        """Return a part of the images with unchanged class numbers."""
        subset = Images([])
        subset.form, subset.cell, subset.sources = self.form, self.cell, tuple(sources)
        subset.classes, subset.object_classes = self.classes, self.object_classes
        return subset

    def _values(self, image, name, number, shape=None):
        """Return the values of a variable; `ValueError` if it is missing or has another shape."""
        if name not in image.variables:
            raise ValueError(f"{self.sources[number].path} has no variable {name}; it has "
                             f"{', '.join(map(str, image.variables))}.")
        values = image[name].values
        if shape is not None and values.shape != tuple(shape):
            raise ValueError(f"{name} of {self.sources[number].path} has the shape {values.shape}, not {tuple(shape)} "
                             f"as in {self.sources[0].path}; stack images of one shape, such as a slice of them.")
        return values


def _read(source: Source, form: Form | None, cell: float | None) -> SonarImage:
    """Read a record, or one of its frames."""
    record = source.read()
    if form is None or source.frame is None:
        return record
    return frame_of(record, source.frame, form, cell)


def frame_of(record: SonarImage, number: int, form: Form | None, cell: float | None) -> SonarImage:
    """Return a frame of a record in a form; the record itself without one."""
    if form is None:
        return record
    frame = record.isel(ping=bearings(record)[1][number])
    return SonarImage.of(frame if form == "polar" else cartesian(frame, cell))


def _column(values):
    """Return values as an array, numeric if every value is a number or reads as one."""
    if any(value is None or isinstance(value, (list, dict)) for value in values):
        return np.array(values, dtype=object)
    if all(isinstance(value, bool) for value in values):
        return np.array(values)
    for kind in (int, float):
        try:
            # via text, so that 2.5 is no integer
            return np.array([kind(repr(value) if isinstance(value, (int, float)) else value) for value in values])
        except ValueError:
            continue
    return np.array([str(value) for value in values])
