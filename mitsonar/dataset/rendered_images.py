"""Images of a sweep's plan that are rendered when they are used, for data sets without files."""
import contextlib
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

from mitsonar.device.files import FilePath
from mitsonar.imaging.maps.raster import bearings
from mitsonar.io.records.records import SonarImage
from mitsonar.labels.frames import Form, LabelFrame, frames
from mitsonar.sweep.execute import MOST_REDRAWN, job
from mitsonar.sweep.plan import Plan, load_plan

from .images import frame_of

if TYPE_CHECKING:
    import xarray as xr

    from .torch_rendering import RenderedImages


def rendering(plan: Plan | FilePath, *, image: "str | Callable[[xr.Dataset], Any]" = "level",
              target: "str | Callable[[xr.Dataset], Any] | None" = "class",
              transform: Callable[..., Any] | None = None, classes: Sequence[str] | None = None,
              subset: str | None = None, form: Form | None = None, cell: float | None = None, endless: bool = False,
              shuffle: bool = True, rank: int | None = None, world_size: int | None = None, threads: int | None = None
              ) -> "RenderedImages":
    """Return a dataset for PyTorch's DataLoader whose workers render the images of a plan.

    Parameters
    ----------
    plan : Plan, or str or path
        Plan of a sweep of images or samples. Only its renders are used; nothing is written.
    image, target, transform
        As in `Images.torch`.
    classes : sequence of str or None
        Classes in the order of their numbers, from 1, in the targets ``class`` and ``boxes``; other shapes are 0 or
        have no box. None: the plan's classes of objects, without negatives.
    subset : str or None
        ``train``, ``val`` or ``test`` of the plan's ``[split]``; None: all renders.
    form, cell
        As in `mitsonar.dataset.open`; None: as in the plan's ``[labels]``, if there are any. A render with several
        frames gives several images.
    endless : bool
        Go on with the next epoch, without an end.
    shuffle : bool
        Mix the renders of an epoch, always in the same way; otherwise they come in the plan's order.
    rank, world_size : int or None
        Number of this process in distributed training, from 0, and how many there are; None: as torch.distributed or
        torchrun say.
    threads : int or None
        Threads of each worker, at least 2; None: an equal share of the cores.

    Returns
    -------
    torch.utils.data.IterableDataset
        With ``set_epoch``, and ``state_dict`` and ``load_state_dict`` for torchdata's StatefulDataLoader. ``len`` is
        the number of renders of an epoch on this rank, if it is known.

    Raises
    ------
    FileNotFoundError, ValueError
        If the plan is wrong, makes soundings, or lacks the subset, or numbers of classes are needed and not given.
    ImportError
        If PyTorch is not installed.

    Notes
    -----
    Renders are dealt to ranks and workers, so that none comes twice. Every epoch goes on with further samples of the
    plan: epoch e of a plan of N renders makes those that it would have from eN on. A scene that refuses its draw is
    drawn again by the plan's ``redraw``, and otherwise left out with a warning. Workers are best started by spawn.

    Examples
    --------
    ``DataLoader(rendering("minefield"), num_workers=2, multiprocessing_context="spawn")``
    """
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    if plan.soundings is not None:
        raise ValueError(f"{plan.path} makes lines of soundings, which are no images; give a plan of images.")
    subsets = list(plan.split.shares) if plan.split is not None else []
    if subset is not None and subset not in subsets:
        raise ValueError(f"the subset {subset!r} was asked for, but [split] of {plan.path} has "
                         f"{', '.join(subsets) or 'none'}; give one of these, or add it there.")
    if classes is None and plan.classes is None and target in ("class", "boxes"):
        raise ValueError(f'the target "{target}" numbers classes before the first image is rendered; give classes '
                         f"here, or at the head of {plan.path}.")
    try:
        from .torch_rendering import RenderedImages
    except ImportError as error:
        if error.name is None or error.name.partition(".")[0] != "torch":
            raise
        raise ImportError("PyTorch is not installed here; run pip install 'mitsonar[torch]', or render "
                          "files by mitsonar sweep.") from None
    given = plan.labels or {}
    form, cell = (given.get("form"), given.get("cell")) if form is None and cell is None else (form, cell)
    return RenderedImages(plan, image=image, target=target, transform=transform,
                          classes=None if classes is None else tuple(classes), subset=subset, form=form, cell=cell,
                          endless=endless, shuffle=shuffle, rank=rank, world_size=world_size, threads=threads)


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderedImage:
    """Image that was rendered; the interface of a sequence that holds it alone, under its number in the plan."""

    record: SonarImage  # or a frame of one, as recorded
    sources: Mapping[int, SimpleNamespace]  # with a ``path``, for errors
    form: Form | None
    cell: float | None
    classes: tuple[str, ...]
    object_classes: tuple[str, ...]

    def __getitem__(self, number: int) -> SonarImage:
        return frame_of(self.record, 0, self.form, self.cell)

    def pictures(self, number: int) -> tuple[SonarImage, list[LabelFrame]]:
        """Return the record, and its pictures."""
        return self.record, frames(self.record, self.sources[number].path, self.form or "polar", self.cell)


def rendered(plan: Plan, index: int) -> SonarImage:
    """Render an image of a plan, with further draws as a sweep makes them; `ValueError` if its scene is refused."""
    from mitsonar.scene.loading import load_for_sonar
    from mitsonar.verbs.images import render

    with _within(os.path.dirname(plan.path)):          # where a sweep's files are searched, too
        for again in range(1 + (MOST_REDRAWN if plan.redraw else 0)):
            given: Mapping[str, Any] = job(plan, plan.render(index, again), None, {})
            try:
                scene = load_for_sonar(given["scene"], **given["parameters"])
            except ValueError:
                if again < MOST_REDRAWN and plan.redraw:
                    continue
                raise
            return render(scene, seed=given["seed"])
    raise AssertionError("the last draw was neither rendered nor refused")


def frames_in(record: SonarImage, form: Form | None) -> Iterator[SonarImage]:
    """Yield the frames of a record, as recorded; the record itself without a form."""
    if form is None:
        yield record
        return
    for pings in bearings(record)[1]:
        yield SonarImage.of(record.isel(ping=pings))


@contextlib.contextmanager
def _within(folder: str) -> Iterator[None]:
    """Work in a folder."""
    before = os.getcwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)
