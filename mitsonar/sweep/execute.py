"""Runner of a sweep: makes missing renders and records every result in the manifest."""
import array
import contextlib
import errno
import itertools
import json
import os
import queue
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mitsonar.device import files
from mitsonar.device.files import FilePath
from mitsonar.labels.tally import Tally

from .manifest import Manifest, ManifestEntry, key, moved, remove_leftovers, sha256, stamp_of, versions
from .parts import WHOLE, Part, check_count, manifests
from .plan import Plan, Render, load_plan, texts
from .pools.cluster import Cluster
from .pools.local import Local, shares

ATTEMPTS = 2                       # per render before it counts as failed
LOOK_SECONDS = 5.0                 # [s] between checks of the workers
MOST_LISTED = 100                  # failures kept for display
UNPLANNED_SHOWN = 3
MOST_REDRAWN = 20                  # draws of a refused scene


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a sweep.

    Attributes
    ----------
    folder : str
        Folder of the images and the manifest.
    manifest : str
        Path of the manifest.
    total, kept, done, failed : int
        Numbers of renders: in the plan or its part, made before, made now, and failed.
    failures : tuple of (str, str)
        Output and error of the first failures.
    seconds : float
        Duration of the run.
    redrawn : int
        Number of renders made now whose parameters were drawn again.
    labelled : Tally or None
        Numbers of the labelled pictures of all finished samples; None for other products.
    """

    folder: str
    manifest: str
    total: int
    kept: int
    done: int
    failed: int
    failures: tuple[tuple[str, str], ...]
    seconds: float
    redrawn: int = 0
    labelled: Tally | None = None


@dataclass(frozen=True, kw_only=True)
class Standing:
    """State of a sweep before a run."""

    missing: "array.array[int]"  # numbers of the renders to make
    changed: int  # number of these with an image from other parameters, files or versions
    damaged: int  # number of these with an altered image
    finished: "array.array[int]"  # numbers of the finished renders
    seconds: list[float]  # of each finished render
    bytes: list[float]  # of each finished render
    tally: Tally  # of the labelled pictures of finished renders
    unplanned: list[str]  # finished outputs of another plan, or of this one before a change
    moved: dict[str, str | None]  # subsets of finished outputs that had another one before the plan changed


def default_folder(plan: Plan) -> str:
    """Return the default folder of a sweep: in the plan's home, named like the plan."""
    bare, suffix = os.path.splitext(os.path.join(plan.home, os.path.basename(plan.path)))
    return bare if suffix else f"{bare}_renders"


def run(plan: Plan | FilePath, folder: FilePath | None = None, *, processes: int | None = None,
        threads: int | None = None, workers: int | None = None, scheduler: str | None = None, verify: bool = False,
        part: Part = WHOLE, progress: Callable[[int, int, int], None] | None = None,
        say: Callable[[str], None] | None = None) -> Outcome:
    """Make all missing renders of a plan.

    Parameters
    ----------
    plan : Plan, or str or path
        Plan of the sweep, or its file.
    folder : str, path or None
        Folder of images and manifest, made if missing. Default: the plan's name without suffix.
    processes : int or None
        Number of processes on this machine; default: as many as its cores can run.
    threads : int or None
        Threads of each process; default: an equal share of the cores.
    workers : int or None
        Number of workers of a Dask cluster to start here instead.
    scheduler : str or None
        Address of the scheduler of a Dask cluster to use instead; its workers must see the same files.
    verify : bool
        Compare the SHA-256 of every image with the manifest, and render altered ones again. Sizes are always compared.
    part : Part
        Part of the plan to make; default: all of it. Parts may run at the same time, in one folder or in several.
    progress : callable(done, total, failed) or None
        Called after every render, with the number of missing renders as total.
    say : callable(str) or None
        Called with messages to the user.

    Returns
    -------
    Outcome
        Numbers of renders and the failures.

    Raises
    ------
    FileNotFoundError, ValueError
        If the plan cannot be run, or another process runs it in this folder; nothing is rendered then.
    OSError
        If the disk is full; finished renders are kept.

    Notes
    -----
    On one instruction set, the same plan gives the same bytes for any number of processes, threads and interruptions;
    the manifest names the instruction set of each render. A failed render is tried once more, then recorded as failed,
    and tried again by the next run.
    """
    start = time.perf_counter()
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    if sum(choice is not None for choice in (processes, workers, scheduler)) > 1:
        raise ValueError("processes, workers and a scheduler were asked for together; give one of them")
    counts = shares(workers if processes is None else processes, threads)
    folder = os.path.abspath(default_folder(plan) if folder is None else folder)
    made_by, say, place = versions(), say or (lambda text: None), os.path.dirname(plan.path)
    ours = part.indices(len(plan))
    if not ours:
        raise ValueError(f"part {part} was asked for, and the plan makes {len(plan)} renders; give at most {len(plan)} "
                         "parts")
    outputs = None if part.whole else [plan.render(index).output for index in ours]
    with created(folder, keep=not part.whole), Manifest(folder, part) as manifest:
        check_count(folder, part)              # after its manifest is made, so that two that begin at once see it
        remove_leftovers(_folders(plan, folder), outputs)
        if manifest.damaged:
            lines, are = ("line", "is") if manifest.damaged == 1 else ("lines", "are")
            say(f"{manifest.damaged} damaged {lines} of {manifest.path} {are} ignored")
        state = standing(plan, folder, manifest.entries, made_by, verify=verify, part=part)
        for count, fault in ((state.changed, "made from other parameters, files or versions"),
                             (state.damaged, "altered after writing")):
            if count:
                renders, were, are = ("render", "was", "is") if count == 1 else ("renders", "were", "are")
                say(f"{count} {renders} in {folder} {were} {fault} and {are} rendered again")
        changes: dict[str, dict[str, Any]] = {name: {"split": subset} for name, subset in state.moved.items()}
        if state.finished:                     # the last line has the wishes that count
            entry = manifest.entries.get(output := plan.render(max(state.finished)).output)
            if entry is not None and entry.balance != (json.dumps(plan.balance) if plan.balance else None):
                changes[output] = {**changes.get(output, {}), "balance": plan.balance}
        for record in moved(folder, part, changes, plan.stamp):
            manifest.append(record)
        if state.moved:
            are = "render is" if len(state.moved) == 1 else "renders are"
            say(f"{len(state.moved)} finished {are} in another subset than before, as [split] of the plan has changed")
        if state.unplanned and part.whole:
            say(unplanned_said(state.unplanned, folder))
        if manifest.fresh:
            _check_foreign(plan, folder, ours)
        runner = _Runner(plan, folder, manifest, state, made_by, progress)
        if state.missing:
            try:
                with (Local(*counts, place) if workers is None and scheduler is None else
                      Cluster(threads, place, folder, scheduler=scheduler, workers=workers)) as pool:
                    if len(state.missing) == len(ours):
                        check_loading(pool, plan, state.missing, made_by)
                    runner.run(pool)
            finally:
                remove_leftovers(_folders(plan, folder), outputs)
    return Outcome(folder=folder, manifest=manifest.path, total=len(ours), kept=len(ours) - len(state.missing),
                   done=runner.done, failed=runner.failed, failures=tuple(runner.failures),
                   seconds=time.perf_counter() - start, redrawn=runner.redrawn,
                   labelled=None if plan.labels is None else runner.tally)


def standing(plan: Plan, folder: str, entries: Mapping[str, ManifestEntry], made_by: Mapping[str, str], *,
             verify: bool = False, part: Part = WHOLE) -> Standing:
    """Return the state of a sweep or a part; renders are missing unless their files exist and match the manifest."""
    missing, finished, changed, damaged = array.array("l"), array.array("l"), 0, 0
    seconds, sizes, tally, subsets = [], [], Tally(), {}

    def keep(index: int, entry: ManifestEntry) -> None:
        finished.append(index)
        seconds.append(entry.seconds)
        sizes.append(entry.bytes)
        if entry.labelled is not None:
            tally.add(json.loads(entry.labelled))
    digest = plan.digests()
    same = {} if verify else _of_this_plan(plan, folder, entries, made_by, digest)
    unplanned_outputs = {output for output, entry in entries.items() if entry.status == "ok"
                         and (entry.index not in same or same[entry.index] is not entry)}
    for index in part.indices(len(plan)):
        if (entry := same.get(index)) is not None:
            keep(index, entry)
            continue
        if not unplanned_outputs:                      # nothing that this render could be
            missing.append(index)
            continue
        render = plan.render(index)
        unplanned_outputs.discard(render.output)
        entry = entries.get(render.output)
        if entry is not None and entry.redrawn and plan.redraw:
            render = plan.render(index, entry.redrawn)
        if entry is None or entry.status != "ok" or not _is_there(folder, render.output, entry, plan.previews):
            missing.append(index)
        elif entry.key != key(render.parameters, render.seed, digest(render), made_by):
            missing.append(index)
            changed += 1
        elif verify and _digest(os.path.join(folder, render.output)) != entry.sha256:
            missing.append(index)
            damaged += 1
        else:
            keep(index, entry)
            if entry.split != render.split:
                subsets[render.output] = render.split
    unplanned = sorted(output for output in unplanned_outputs if os.path.exists(os.path.join(folder, output)))
    return Standing(missing=missing, changed=changed, damaged=damaged, finished=finished, seconds=seconds,
                    bytes=sizes, tally=tally, unplanned=unplanned, moved=subsets)


def _of_this_plan(plan, folder, entries, made_by, digest):
    """Return the finished entries of a plan that has not changed, by number; quickly, without drawing parameters.

    Entries with the same digest of inputs read the same files, so that one of them tells of all.
    """
    ours, same, unchanged = stamp_of(plan.stamp, made_by), {}, {}
    for output, entry in entries.items():
        if entry.status != "ok" or entry.stamp != ours or not 0 <= entry.index < len(plan):
            continue
        if entry.inputs not in unchanged:
            unchanged[entry.inputs] = digest(plan.render(entry.index, entry.redrawn)) == entry.inputs
        if unchanged[entry.inputs] and _is_there(folder, output, entry, plan.previews):
            same[entry.index] = entry
    return same


def unplanned_said(outputs: Sequence[str], folder: str) -> str:
    """Return a warning about images in the folder that the plan does not have."""
    shown = ", ".join(outputs[:UNPLANNED_SHOWN]) + (", ..." if len(outputs) > UNPLANNED_SHOWN else "")
    images = "1 image here belongs" if len(outputs) == 1 else f"{len(outputs)} images here belong"
    return (f"{images} to no render of this plan: {shown}; labels and datasets of {folder} include them. To exclude "
            "them, give this plan another folder by -o")


def job(plan: Plan, render: Render, folder: str | None, made_by: Mapping[str, str]) -> dict[str, Any]:
    """Return the job of a render for a worker; without a folder its scene is only loaded."""
    labels = render.recipe.labels
    return {"scene": render.recipe.scene, "parameters": texts(render), "seed": render.seed, "versions": made_by,
            "folder": folder or os.path.dirname(plan.path), "output": render.output if folder else None,
            "preview": preview(render.output) if plan.previews and folder else None, "soundings": plan.soundings,
            "labels": None if labels is None else [labels, plan.classes],
            "trial": False}


def check_loading(pool: Local | Cluster, plan: Plan, missing: Sequence[int], made_by: Mapping[str, str]) -> None:
    """Raise `ValueError` if of any scene of a sweep neither the first nor the last render can be loaded."""
    ends: dict[str, list[int]] = {}
    for index in missing if plan.turns is not None else (missing[0], missing[-1]):
        ends.setdefault(plan.turn(index)[0].name, [index, index])[1] = index
    for first, last in ends.values():
        _check_loading(pool, plan, dict.fromkeys((first, last)), made_by)


def _check_loading(pool, plan, indices, made_by):
    errors = []
    tries = range(1 + MOST_REDRAWN if plan.redraw else 1)
    for index, again in itertools.product(indices, tries):
        answer = _answer(pool.submit(job(plan, plan.render(index, again), None, made_by)))
        if not answer.get("error"):
            return
        errors.append(answer["error"])
    raise ValueError(f"no render of {os.path.basename(plan.path)} was started: {errors[0]}")


def only(plan: Plan, index: int, output: FilePath, *, threads: int | None = None) -> None:
    """Write the image of one render of a plan as an EXR; raises `ValueError` if it fails."""
    folder, name = os.path.split(os.path.abspath(output))
    processes, threads = shares(1, threads)
    with Local(processes, threads, os.path.dirname(plan.path)) as pool:
        for again in range(1 + (MOST_REDRAWN if plan.redraw else 0)):
            given = job(plan, plan.render(index, again), folder, versions())
            answer = _answer(pool.submit({**given, "output": name, "preview": None, "soundings": None, "labels": None}))
            if not answer.get("refused"):
                break
    if answer.get("error"):
        raise ValueError(f"render {index} fails: {answer['error']}")


class _Runner:
    """Loop that keeps a pool busy and writes the manifest."""

    def __init__(self, plan, folder, manifest, state, made_by, progress):
        self.plan, self.folder, self.manifest, self.made_by = plan, folder, manifest, made_by
        self.missing, self.tally = state.missing, state.tally
        self.progress = progress or (lambda done, total, failed: None)
        self.done, self.failed, self.redrawn, self.failures = 0, 0, 0, []
        self._answers, self._running = queue.SimpleQueue(), {}

    def run(self, pool: Local | Cluster) -> None:
        """Make all missing renders."""
        to_do = iter(self.missing)
        while True:
            while len(self._running) < pool.capacity and (index := next(to_do, None)) is not None:
                self._start(pool, index, 1)
            if not self._running:
                return
            try:
                future = self._answers.get(timeout=LOOK_SECONDS)
            except queue.Empty:
                pool.check()
                continue
            self._end(pool, future)

    def _start(self, pool, index, attempt, redrawn=0):
        render = self.plan.render(index, redrawn)
        digest = self.plan.digest(render)       # before the render, to detect later changes
        future = pool.submit(job(self.plan, render, self.folder, self.made_by))
        self._running[id(future)] = future, render, digest, attempt
        future.add_done_callback(self._answers.put)

    def _end(self, pool, future):
        _, render, digest, attempt = self._running.pop(id(future))
        answer = _answer(future)
        if answer.get("full"):
            raise OSError(f"{answer['error']} The sweep stopped and keeps finished renders; run it again afterwards.")
        if answer.get("refused") and self.plan.redraw and render.redrawn < MOST_REDRAWN:
            self._start(pool, render.index, 1, render.redrawn + 1)
            return
        if answer.get("error") and attempt < ATTEMPTS and not answer.get("refused"):
            pool.check()
            self._start(pool, render.index, attempt + 1)
            return
        error = answer.get("error")
        self.manifest.append({
            "index": render.index, "plan": self.plan.stamp, "output": render.output, "parameters": render.parameters,
            "seed": render.seed, "inputs": digest, "versions": self.made_by,
            "status": "failed" if error else "ok", "attempts": attempt,
            "instruction_set": answer.get("instruction_set"), "seconds": answer["seconds"],
            "bytes": answer.get("bytes"), "sha256": answer.get("sha256"), "error": error,
            **({"redrawn": render.redrawn} if self.plan.redraw else {}),
            **({"scene": render.recipe.name} if self.plan.turns is not None else {}),
            **({"split": render.split} if render.split is not None else {}),
            **({"classes": self.plan.classes} if self.plan.classes else {}),
            **({"labelled": answer["labelled"]} if answer.get("labelled") else {}),
            **({"balance": self.plan.balance} if self.plan.balance else {}),
            **({"preview": preview(render.output)} if self.plan.previews and not error else {}),
            **({"warnings": answer["warnings"]} if answer["warnings"] else {})})
        if error:
            self.failed += 1
            self.failures += [(render.output, error)] if self.failed <= MOST_LISTED else []
        else:
            self.done += 1
            self.redrawn += render.redrawn > 0
            if answer.get("labelled"):
                self.tally.add(answer["labelled"])
        self.progress(self.done + self.failed, len(self.missing), self.failed)


def _answer(future):
    """Return the answer of a job, or an answer with the error of the pool."""
    try:
        return future.result()
    except Exception as error:     # from Dask: a worker lost repeatedly, or without mitsonar
        return {"error": f"{type(error).__name__}: {' '.join(str(error).split())}", "seconds": 0.0, "warnings": []}


def preview(output: str) -> str:
    """Return the name of the picture beside an output."""
    return f"{os.path.splitext(output)[0]}.png"


def _is_there(folder, output, entry, previews):
    path = os.path.join(folder, output)
    with contextlib.suppress(OSError, ValueError):     # ValueError: no name of a file
        return os.path.getsize(path) == entry.bytes and (not previews or (
            entry.preview is not None and os.path.exists(os.path.join(folder, entry.preview))))
    return False


def _digest(path):
    with contextlib.suppress(OSError):
        return sha256(path)
    return ""


def _folders(plan, folder):
    """Return the folders of all outputs."""
    if (folders := plan.pattern.folders()) is None:
        folders = {os.path.dirname(plan.render(index).output) for index in range(len(plan))}
    return sorted(os.path.join(folder, name) if name else folder for name in folders)


@contextlib.contextmanager
def created(folder: str, *, keep: bool) -> Iterator[None]:
    """Create a folder, and unless it is to be kept remove it and its new parents at the end if they stay empty."""
    new, above = [], folder
    while not os.path.exists(above):
        new.append(above)
        above = os.path.dirname(above)
    try:
        os.makedirs(folder, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise ValueError(f"cannot write into {folder}: it is a file, or in one; give a folder by -o") from None
    except OSError as error:
        if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
            raise
        raise PermissionError(f"cannot write into {folder}: no permission to make it in {above}; give another folder "
                              "by -o") from None
    try:
        files.check_writable(os.path.join(folder, WHOLE.manifest))
        yield
    finally:
        with contextlib.suppress(OSError):             # the folder is not empty
            for created in () if keep else new:
                os.rmdir(created)


def _check_foreign(plan, folder, indices):
    """Raise `ValueError` if an output would replace a file that no manifest lists."""
    foreign = set(os.listdir(folder)) - {*manifests(folder), WHOLE.lock}
    for index in indices if foreign else ():
        output = plan.render(index).output
        if os.path.exists(os.path.join(folder, output)):
            raise ValueError(f"{folder} holds {output}, but no manifest lists it; move it away, or give another "
                             "folder by -o")
