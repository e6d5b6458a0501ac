"""Run a sweep: what is missing is rendered, what happened is written down."""
import array
import contextlib
import errno
import hashlib
import itertools
import os
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mitsonar.device import files
from mitsonar.device.files import FilePath
from mitsonar.io.scene_files import scenes

from .cluster import Cluster
from .local import Local, shares
from .manifest import LOCK, MANIFEST, Manifest, ManifestEntry, key, remove_leftovers
from .plan import Plan, Render, load_plan
from .versions import versions

ATTEMPTS = 2                       # of a render before it counts as failed
LOOK_SECONDS = 5.0                 # how often to ask whether the workers are still there
MOST_LISTED = 100                  # failures kept to be shown
UNPLANNED_SHOWN = 3
MOST_REDRAWN = 20                  # times that a refused scene is drawn again


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Result of a sweep.

    Attributes
    ----------
    folder : str
    total, kept, done, failed : int
        Renders of the plan; those that were there before, were made now, and could not be made.
    failures : tuple of (str, str)
        Output and error of the first that failed.
    seconds : float
    redrawn : int
        How many of those made now have parameters that were drawn again.
    """

    folder: str
    total: int
    kept: int
    done: int
    failed: int
    failures: tuple[tuple[str, str], ...]
    seconds: float
    redrawn: int = 0


@dataclass(frozen=True, kw_only=True)
class Standing:
    """Progress of a sweep."""

    missing: "array.array[int]"  # numbers of the renders to be made
    changed: int  # how many of them are there, made of other parameters, files or versions
    damaged: int  # how many of them are there, with another content than was written
    seconds: list[float]  # of each render that is there
    bytes: list[float]  # of each render that is there
    unplanned: list[str]  # outputs that are there and done, of another plan or of this one before it was changed


def default_folder(plan: Plan) -> str:
    """Return the folder a sweep goes into where none is named: in the plan's home, named as the plan is."""
    bare, suffix = os.path.splitext(os.path.join(plan.home, os.path.basename(plan.path)))
    return bare if suffix else f"{bare}_renders"


def run(plan: Plan | FilePath, folder: FilePath | None = None, *, processes: int | None = None,
        threads: int | None = None, workers: int | None = None, scheduler: str | None = None, verify: bool = False,
        progress: Callable[[int, int, int], None] | None = None, say: Callable[[str], None] | None = None) -> Outcome:
    """Render all of a plan that is not there yet.

    Parameters
    ----------
    plan : Plan, or str or path
    folder : str, path or None
        Where files and manifest go; made if it is not there. Default: the plan's name without suffix.
    processes : int or None
        On this machine; default: as many as its cores bear.
    threads : int or None
        Of each process, at least 2; default: the cores shared out.
    workers : int or None
        Start a Dask cluster of this many workers here instead.
    scheduler : str or None
        Address of the scheduler of a Dask cluster to use instead; its workers must see the same files.
    verify : bool
        Read every image that is there, and make those anew whose SHA-256 is not the one that was written down; their
        size is compared always.
    progress : callable(done, total, failed) or None
        Told how many of the missing renders have ended.
    say : callable(str) or None
        Told what a user should know beside the result.

    Returns
    -------
    Outcome

    Raises
    ------
    FileNotFoundError, ValueError
        If the plan cannot be run, or somebody else runs it in this folder; nothing is rendered then.
    OSError
        If the disk is full; what is done is kept.

    Notes
    -----
    The same plan gives the same bytes on one instruction set, whatever the number of processes and threads, and however
    often it was interrupted; the manifest names the set of each render. A render that fails is tried once more, then
    written down as failed, and tried again by the next run.
    """
    start = time.perf_counter()
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    if sum(choice is not None for choice in (processes, workers, scheduler)) > 1:
        raise ValueError("processes, workers and a scheduler were asked for together; give one of them")
    counts = shares(workers if processes is None else processes, threads)
    folder = os.path.abspath(default_folder(plan) if folder is None else folder)
    made_by, say, place = versions(), say or (lambda text: None), os.path.dirname(plan.path)
    with _made(folder), Manifest(folder) as manifest:
        remove_leftovers(_folders(plan, folder))
        if manifest.damaged:
            lines, are = ("line", "is") if manifest.damaged == 1 else ("lines", "are")
            say(f"{manifest.damaged} damaged {lines} of {manifest.path} {are} passed over")
        now = standing(plan, folder, manifest.entries, made_by, verify=verify)
        if now.changed:
            renders, were, are = ("render", "was", "is") if now.changed == 1 else ("renders", "were", "are")
            say(f"{now.changed} {renders} in {folder} {were} made of other parameters, files or versions and {are} "
                "made anew")
        if now.damaged:
            renders, have = ("render", "has") if now.damaged == 1 else ("renders", "have")
            say(f"{now.damaged} {renders} in {folder} {have} another content than was written there, and "
                f"{'is' if now.damaged == 1 else 'are'} made anew")
        if now.unplanned:
            say(unplanned_said(now.unplanned, folder))
        if manifest.fresh:
            _check_foreign(plan, folder)
        runner = _Runner(plan, folder, manifest, now, made_by, progress)
        if now.missing:
            try:
                with (Local(*counts, place) if workers is None and scheduler is None else
                      Cluster(threads, place, folder, scheduler=scheduler, workers=workers)) as pool:
                    if len(now.missing) == len(plan):
                        check_loading(pool, plan, now.missing, made_by)
                    runner.run(pool)
            finally:
                remove_leftovers(_folders(plan, folder))
    return Outcome(folder=folder, total=len(plan), kept=len(plan) - len(now.missing), done=runner.done,
                   failed=runner.failed, failures=tuple(runner.failures), seconds=time.perf_counter() - start,
                   redrawn=runner.redrawn)


def standing(plan: Plan, folder: str, entries: Mapping[str, ManifestEntry], made_by: Mapping[str, str], *,
             verify: bool = False) -> Standing:
    """Find out what is missing: all that the manifest does not call done, or whose files are not there as it says."""
    missing, changed, damaged, seconds, sizes = array.array("l"), 0, 0, [], []
    others = {output for output, entry in entries.items() if entry.status == "ok"}
    for index in range(len(plan)):
        render = plan.render(index)
        others.discard(render.output)
        entry = entries.get(render.output)
        if entry is not None and entry.redrawn and plan.redraw:
            render = plan.render(index, entry.redrawn)
        if entry is None or entry.status != "ok" or not _is_there(folder, render, entry, plan.previews):
            missing.append(index)
        elif entry.key != key(render.parameters, render.seed, plan.inputs.digest(_texts(render)), made_by):
            missing.append(index)
            changed += 1
        elif verify and _sha256(os.path.join(folder, render.output)) != entry.sha256:
            missing.append(index)
            damaged += 1
        else:
            seconds.append(entry.seconds)
            sizes.append(entry.bytes)
    unplanned = sorted(output for output in others if os.path.exists(os.path.join(folder, output)))
    return Standing(missing=missing, changed=changed, damaged=damaged, seconds=seconds, bytes=sizes,
                    unplanned=unplanned)


def unplanned_said(outputs: Sequence[str], folder: str) -> str:
    """Say that images are there which the plan does not make."""
    shown = ", ".join(outputs[:UNPLANNED_SHOWN]) + (", ..." if len(outputs) > UNPLANNED_SHOWN else "")
    what = "1 image here belongs" if len(outputs) == 1 else f"{len(outputs)} images here belong"
    return (f"{what} to no render of this plan: {shown}; labels and datasets of {folder} take them too: give this plan "
            "another folder by -o if they should not")


def job(plan: Plan, render: Render, folder: str | None, made_by: Mapping[str, str]) -> dict[str, Any]:
    """Describe a render to whoever makes it; without a folder it is only loaded."""
    return {"scene": plan.scene, "parameters": _texts(render), "seed": render.seed, "versions": made_by,
            "folder": folder or os.path.dirname(plan.path), "output": render.output if folder else None,
            "preview": _preview(render) if plan.previews and folder else None}


def check_loading(pool: Local | Cluster, plan: Plan, missing: Sequence[int], made_by: Mapping[str, str]) -> None:
    """Refuse a sweep whose first and last scene cannot be loaded: then none can, as far as one can tell."""
    errors = []
    tries = range(1 + MOST_REDRAWN if plan.redraw else 1)
    for index, again in itertools.product(dict.fromkeys((missing[0], missing[-1])), tries):
        answer = _answer(pool.submit(job(plan, plan.render(index, again), None, made_by)))
        if not answer.get("error"):
            return
        errors.append(answer["error"])
    raise ValueError(f"no render of {os.path.basename(plan.path)} was started: {errors[0]}")


class _Runner:
    """Keeps a pool busy, and the manifest."""

    def __init__(self, plan, folder, manifest, now, made_by, progress):
        self.plan, self.folder, self.manifest, self.missing, self.made_by = plan, folder, manifest, now.missing, made_by
        self.progress = progress or (lambda done, total, failed: None)
        self.done, self.failed, self.redrawn, self.failures = 0, 0, 0, []
        self._answers, self._running = queue.SimpleQueue(), {}

    def run(self, pool):
        """Render all that is missing."""
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
        digest = self.plan.inputs.digest(_texts(render))       # before it is rendered: a file that changes then is seen
        future = pool.submit(job(self.plan, render, self.folder, self.made_by))
        self._running[id(future)] = future, render, digest, attempt
        future.add_done_callback(self._answers.put)

    def _end(self, pool, future):
        _, render, digest, attempt = self._running.pop(id(future))
        answer = _answer(future)
        if answer.get("full"):
            raise OSError(f"{answer['error']} The sweep stopped and keeps what is done; run it again then.")
        if answer.get("refused") and self.plan.redraw and render.redrawn < MOST_REDRAWN:
            self._start(pool, render.index, 1, render.redrawn + 1)
            return
        if answer.get("error") and attempt < ATTEMPTS and not answer.get("refused"):
            pool.check()
            self._start(pool, render.index, attempt + 1)
            return
        error = answer.get("error")
        self.manifest.append({
            "index": render.index, "output": render.output, "parameters": render.parameters, "seed": render.seed,
            "inputs": digest, "versions": self.made_by, "status": "failed" if error else "ok", "attempts": attempt,
            "instruction_set": answer.get("instruction_set"), "seconds": answer["seconds"],
            "bytes": answer.get("bytes"), "sha256": answer.get("sha256"), "error": error,
            **({"redrawn": render.redrawn} if self.plan.redraw else {}),
            **({"classes": self.plan.classes} if self.plan.classes else {}),
            **({"preview": _preview(render)} if self.plan.previews and not error else {}),
            **({"warnings": answer["warnings"]} if answer["warnings"] else {})})
        if error:
            self.failed += 1
            self.failures += [(render.output, error)] if self.failed <= MOST_LISTED else []
        else:
            self.done += 1
            self.redrawn += render.redrawn > 0
        self.progress(self.done + self.failed, len(self.missing), self.failed)


def _answer(future):
    """The answer of a job, also where the pool itself failed it."""
    try:
        return future.result()
    except Exception as error:     # of Dask: a worker lost again and again, or one that has no mitsonar
        return {"error": f"{type(error).__name__}: {' '.join(str(error).split())}", "seconds": 0.0, "warnings": []}


def _texts(render):
    return {name: scenes.text(name, value) for name, value in render.parameters.items()}


def _preview(render):
    return f"{os.path.splitext(render.output)[0]}.png"


def _is_there(folder, render, entry, previews):
    path = os.path.join(folder, render.output)
    with contextlib.suppress(OSError):
        return os.path.getsize(path) == entry.bytes and (not previews or (
            entry.preview is not None and os.path.exists(os.path.join(folder, entry.preview))))
    return False


def _sha256(path):
    with contextlib.suppress(OSError), open(path, "rb") as file:
        digest = hashlib.sha256()
        while block := file.read(1 << 20):
            digest.update(block)
        return digest.hexdigest()
    return ""


def _folders(plan, folder):
    """The folders that outputs go to."""
    if "/" not in plan.pattern.text:
        return [folder]
    return sorted({os.path.dirname(os.path.join(folder, plan.render(index).output)) for index in range(len(plan))})


@contextlib.contextmanager
def _made(folder):
    """A folder to write into; what was made for it goes again if nothing came into it."""
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
        files.check_writable(os.path.join(folder, MANIFEST))
        yield
    finally:
        with contextlib.suppress(OSError):             # something is in it
            for made in new:
                os.rmdir(made)


def _check_foreign(plan, folder):
    """Refuse to write over files that no sweep made."""
    there = set(os.listdir(folder))
    for index in range(len(plan) if there - {MANIFEST, LOCK} else 0):
        output = plan.render(index).output
        if os.path.exists(os.path.join(folder, output)):
            raise ValueError(f"{folder} holds {output}, but no manifest that knows it; move it away, or give another "
                             "folder by -o")
