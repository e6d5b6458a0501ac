"""Rendered images as an iterable dataset of PyTorch, imported only on demand."""
import dataclasses
import os
import warnings
from collections.abc import Callable, Iterator
from types import SimpleNamespace
from typing import Any

import numpy as np
import torch  # pyright: ignore[reportMissingImports]  optional dependency
import torch.distributed  # pyright: ignore[reportMissingImports]  optional dependency
import torch.utils.data  # pyright: ignore[reportMissingImports]  optional dependency

from mitsonar.device.machine import cores
from mitsonar.device.sentences import sentence
from mitsonar.labels.frames import Form
from mitsonar.labels.rules import Labels
from mitsonar.sweep.plan import Plan, load_plan
from mitsonar.sweep.products import sample_rules

from .rendered_images import RenderedImage, frames_in, rendered
from .torch_images import TorchImages

MOST_WORKERS = 1024
MOST_FAILED = 20                   # renders in a row


class RenderedImages(torch.utils.data.IterableDataset):
    """PyTorch dataset that renders its images; see `mitsonar.dataset.rendering`."""

    def __init__(self, plan: Plan, *, image: Any, target: Any, transform: Callable[..., Any] | None,
                 classes: tuple[str, ...] | None, subset: str | None, form: Form | None, cell: float | None,
                 endless: bool, shuffle: bool, rank: int | None, world_size: int | None, threads: int | None):
        self.plan, self.image, self.target, self.transform = plan, image, target, transform
        self.complete = classes is None                # the plan promises that objects have no other classes
        self.rules: Labels | None = None               # of labels, if the plan has any
        if plan.labels is not None and plan.classes is not None:
            rules = sample_rules(plan.labels, plan.classes).labels
            self.rules = rules if self.complete else dataclasses.replace(rules, negatives=(), negative_class=None)
        numbered = (plan.classes or ()) if self.rules is None else self.rules.numbered(plan.classes or ())
        self.classes = classes or tuple(numbered)
        self.subset, self.cell = subset, cell
        self.form: Form | None = form
        self.endless, self.shuffle, self.threads = endless, shuffle, threads
        self.rank, self.world_size = _place(rank, world_size)
        if threads is not None and threads < 1:
            raise ValueError(f"{threads} threads were asked for; give 1 or more.")
        self._of_subset: tuple[int, np.ndarray] | None = None                  # of one epoch
        if self.world_size > (count := len(self._renders(0))):
            raise ValueError(f"{plan.path} makes {count} renders{f' of {subset}' if subset else ''}, fewer than the "
                             f"{self.world_size} processes of the training; raise its samples.")
        # of each worker: two numbers of its iteration, the epoch at which that began, and its next epoch; shared, as
        # every epoch may have new workers, and more or fewer
        self._table = torch.zeros((MOST_WORKERS, 4), dtype=torch.int64).share_memory_()
        self._begun = 0                                # iterations in this process
        self._fault: Exception | None = None           # of the plan, when a worker read it again
        self._state: dict[str, int] | None = None      # to begin at
        self._at = {"epoch": 0, "done": 0, "frames": 0}
        if endless:
            self._check_epoch(1)

    def __len__(self):
        if self.endless or self.form is not None:
            raise TypeError("the number of images is not known: " +
                            ("they are endless." if self.endless else "each render may have several frames."))
        return len(self._renders(0)) // self.world_size

    def set_epoch(self, epoch: int) -> None:
        """Begin the next iteration of every worker at an epoch, counted from 0."""
        self._table[:] = torch.as_tensor([-1, -1, int(epoch), int(epoch)])

    def state_dict(self) -> dict[str, int]:
        """Return where this worker is: its epoch, renders that are done, and frames of the next."""
        return dict(self._at)

    def load_state_dict(self, state: dict[str, int]) -> None:
        """Begin the next iteration of this worker where another one was."""
        self._state = {name: int(state[name]) for name in self._at}

    def __iter__(self) -> Iterator[Any]:
        if self._fault is not None:
            raise self._fault
        info = torch.utils.data.get_worker_info()
        worker, workers = (0, 1) if info is None else (info.id, info.num_workers)
        if workers > MOST_WORKERS:
            raise ValueError(f"{workers} workers were asked for; give at most {MOST_WORKERS}.")
        self._set_threads(None if info is None else workers)
        state, self._state = self._state, None
        # workers of one iteration have these numbers in common
        iteration = torch.as_tensor([-1 if info is None else info.seed - worker, self._begun])
        self._begun += 1
        if state is None:
            following = int(self._table[:, 3].max())   # read first and written last: of earlier iterations, or unused
            begun = (self._table[:, :2] == iteration).all(1)
            state = {"epoch": int(self._table[begun, 2].max()) if begun.any() else following, "done": 0, "frames": 0}
        self._check_epoch(state["epoch"])
        self._table[worker, 2] = state["epoch"]        # in this order, as other workers may begin now
        self._table[worker, :2] = iteration
        self._table[worker, 3] = state["epoch"] + 1
        return self._images(worker, workers, state)

    def _images(self, worker, workers, state):
        epoch, done, skipped = state["epoch"], state["done"], state["frames"]
        while True:
            plan = dataclasses.replace(self.plan, count=len(self.plan) * (epoch + 1))
            share, failed = self.share(epoch, worker, workers), 0
            for number, index in enumerate(share[done:].tolist(), done):
                self._at = {"epoch": epoch, "done": number, "frames": skipped}
                try:
                    record = rendered(plan, index)
                except (ValueError, OSError, MemoryError) as error:
                    if (failed := failed + 1) >= MOST_FAILED:
                        raise ValueError(f"{failed} renders of {plan.path} failed one after the other, the last one "
                                         f"because {sentence(error)}") from error
                    warnings.warn(f"render {index} of {plan.path} is left out: {sentence(error)}", stacklevel=2)
                    continue
                failed = 0
                for frame, part in enumerate(frames_in(record, self.form)):
                    if frame >= skipped:
                        self._at["frames"] = frame + 1
                        yield self._pair(part, index)
                skipped = 0
            self._at = {"epoch": epoch, "done": len(share), "frames": 0}
            if not self.endless:
                return
            epoch, done = epoch + 1, 0
            self._table[worker, 3] = epoch + 1

    def share(self, epoch: int, worker: int, workers: int) -> np.ndarray:
        """Return the numbers of the renders that a worker makes in an epoch."""
        renders = self._renders(epoch)
        if self.shuffle:
            renders = np.random.default_rng([self.plan.seed, epoch]).permutation(renders)
        # the same number on every rank, so that none waits for images of another
        return renders[self.rank::self.world_size][:len(renders) // self.world_size][worker::workers]

    def _renders(self, epoch):
        """Return the numbers of the renders of an epoch, of the subset only."""
        if self._of_subset is None or self._of_subset[0] != epoch:
            total = len(self.plan)
            numbers = np.arange(epoch * total, (epoch + 1) * total)
            if self.subset is not None:
                plan = dataclasses.replace(self.plan, count=total * (epoch + 1))
                numbers = numbers[[plan.render(number).split == self.subset for number in numbers.tolist()]]
            self._of_subset = epoch, numbers
        return self._of_subset[1]

    def _pair(self, record, index):
        objects = {entry["class"] for entry in (record.attrs.get("objects") or {}).values()}
        if (self.target in ("class", "boxes") and self.complete
                and (lacking := objects - {*self.classes, *(self.rules.negatives if self.rules else ())})):
            raise ValueError(f"render {index} of {self.plan.path} has objects of the class "
                             f"{', '.join(sorted(lacking))}, which the plan's classes lack; give all of them there, or "
                             "those to learn here.")
        one = RenderedImage(record=record, form=self.form, cell=self.cell,
                            sources={index: SimpleNamespace(path=f"render {index} of {self.plan.path}")},
                            classes=self.classes, object_classes=self.classes)
        return TorchImages(one, image=self.image, target=self.target, transform=self.transform,
                           rules=self.rules)[index]

    def _check_epoch(self, epoch):
        if epoch and any(not isinstance(recipe.seeds, int) and not recipe.is_drawn for recipe in self.plan.recipes):
            raise ValueError(f"{self.plan.path} draws nothing and lists its seeds, so that every epoch after the first "
                             "would repeat its images; add [draw], or give the number of seeds.")

    def _set_threads(self, workers):
        """Share the cores with the other workers; leave the main process alone unless `threads` is given."""
        if workers is None and self.threads is None:
            return
        from mitsonar.scene.loading import prepare

        prepare()
        import drjit as dr
        import mitsuba as mi

        if workers is not None:
            mi.set_log_level(mi.LogLevel.Error)
        beside = (workers or 1) * int(os.environ.get("LOCAL_WORLD_SIZE", 1))
        threads = self.threads or max(1, cores() // beside)
        if dr.thread_count() != threads:
            dr.set_thread_count(threads)

    def __getstate__(self):
        # draws hold functions, so that a worker reads the plan itself
        return {**self.__dict__, "plan": (self.plan.path, self.plan.stamp)}

    def __setstate__(self, state):
        path, stamp = state["plan"]
        self.__dict__.update({name: item for name, item in state.items() if name != "plan"})
        try:
            self.plan = load_plan(path)
            if self.plan.stamp != stamp:
                raise ValueError(f"{path} was changed since the data set was made; make the data set again.")
        except (ValueError, OSError) as error:         # raised later, where DataLoader passes it on to its process
            self._fault = error


def _place(rank: int | None, world_size: int | None) -> tuple[int, int]:
    """Return rank and number of processes, from PyTorch or torchrun where they are not given."""
    if rank is None or world_size is None:
        if rank is not None or world_size is not None:
            raise ValueError(f"the rank is {rank} and the number of processes {world_size}; give both or none.")
        if torch.distributed.is_available() and torch.distributed.is_initialized():
            rank, world_size = int(torch.distributed.get_rank()), int(torch.distributed.get_world_size())
        else:
            rank, world_size = int(os.environ.get("RANK", 0)), int(os.environ.get("WORLD_SIZE", 1))
    if not 0 <= rank < world_size:
        raise ValueError(f"the rank is {rank} of {world_size} processes; give one from 0 to {world_size - 1}.")
    return rank, world_size
