"""Parts of a sweep joined: their manifests become one, and images of other folders are linked or copied to it.

Every image is checked against the plan and against its own line: parameters, seed, inputs, versions; size and SHA-256.
An image that does not agree is left out and named; a run of the sweep makes it anew.
"""
import contextlib
import errno
import json
import os
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mitsonar.device.files import FilePath, check_readable, clear_left, replacing
from mitsonar.labels.tally import Tally

from .execute import created, default_folder, preview
from .manifest import Line, changed, hold, key, lines, sha256, versions
from .parts import MANIFEST, WHOLE, manifests, part_of
from .plan import Plan, load_plan


@dataclass(frozen=True, kw_only=True)
class Merged:
    """Result of a merge.

    Attributes
    ----------
    folder : str
        Folder of the images and the joined manifest.
    total, joined : int
        Numbers of renders: in the plan, and joined.
    missing : tuple of int
        Numbers in the plan of renders that no part has finished.
    wrong : tuple of (int, str)
        Numbers in the plan of renders that do not agree with the plan or with their line, and what does not.
    twice : tuple of int
        Numbers of renders that several parts have made with different bytes; the first one is taken.
    instruction_sets : tuple of str
        Instruction sets of the machines that made them; bytes depend on these.
    labelled : Tally or None
        Numbers of the labelled pictures of joined samples; None for other products.
    """

    folder: str
    total: int
    joined: int
    missing: tuple[int, ...]
    wrong: tuple[tuple[int, str], ...]
    twice: tuple[int, ...]
    instruction_sets: tuple[str, ...]
    labelled: Tally | None = None


def merge(plan: Plan | FilePath, folders: Sequence[FilePath], folder: FilePath | None = None, *,
          progress: Callable[[int, int], None] | None = None) -> Merged:
    """Join the parts of a sweep in one folder.

    Parameters
    ----------
    plan : Plan, or str or path
        Plan of the sweep, or its file.
    folders : sequence of str or path
        Folders of the parts; several parts may share one.
    folder : str, path or None
        Folder of the whole sweep; default: the one of the parts if they share one, else the plan's name.
    progress : callable(done, total) or None
        Called after every render.

    Returns
    -------
    Merged
        What was joined, and what is missing or wrong.

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder holds no manifest, or a part in it is still being run.
    """
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    sources = list(dict.fromkeys(os.path.abspath(source) for source in folders))
    folder = os.path.abspath(folder or (sources[0] if len(sources) == 1 else default_folder(plan)))
    for source in sources:
        if not manifests(source):
            raise FileNotFoundError(f"cannot merge {source}: it holds no manifest of a sweep; give the folders of "
                                    "parts")
        for name in manifests(source):
            check_readable(os.path.join(source, name), "the manifest", "a manifest of a sweep")
    sources += [folder] if folder not in sources and manifests(folder) else []
    with created(folder, keep=False), contextlib.ExitStack() as held:
        runs = [(source, part_of(name)) for source in sources for name in manifests(source)]
        for source, part in dict.fromkeys([*runs, (folder, WHOLE)]):
            with _unless_read_only():
                held.callback(os.close, hold(source, part))
        clear_left(os.path.join(folder, MANIFEST))
        return _joined(plan, sources, folder, progress or (lambda done, total: None),
                       [part for source, part in dict.fromkeys(runs) if source == folder and not part.whole])


@contextlib.contextmanager
def _unless_read_only():
    """Pass over a folder that nobody can write into, as nobody runs a part there."""
    try:
        yield
    except OSError as error:
        if error.errno not in (errno.EACCES, errno.EPERM, errno.EROFS):
            raise


def _joined(plan, sources, folder, progress, parts):
    made_by, found, digest = versions(), _found(sources), plan.digests()
    missing, wrong, twice, sets, kept, tally = [], [], [], {}, 0, Tally()
    with replacing(os.path.join(folder, MANIFEST)) as temporary, open(temporary, "wb") as joined:
        for index in range(len(plan)):
            progress(index + 1, len(plan))
            render, faults, taken = plan.render(index), [], None
            candidates = found.pop(render.output, ())
            for line in candidates:
                record = line.record()
                fault = _fault(plan, index, line.folder, record, made_by, digest)
                if fault:
                    faults.append(fault)
                elif taken is None:
                    taken = line, record
                elif record["sha256"] != taken[1]["sha256"]:
                    twice.append(index)
                    break
            if taken is None:
                (wrong.append((index, faults[0])) if faults else missing.append(index))
                continue
            line, record = taken
            for name in _outputs(plan, record["output"]):
                _bring(os.path.join(line.folder, name), os.path.join(folder, name))
            changes = {"split": render.split, "balance": plan.balance or None}
            joined.write(line.text() if all(record.get(name) == item for name, item in changes.items()) else
                         json.dumps(changed(record, changes, plan.stamp)).encode() + b"\n")
            if line.entry is not None and line.entry.labelled is not None:
                tally.add(json.loads(line.entry.labelled))
            sets[str(record.get("instruction_set"))] = None
            kept += 1
        for line in (line for others in found.values() for line in others if line.folder == folder):
            joined.write(line.text())                  # of another plan in this folder
    for part in parts:                                 # those that were held: others may have begun since
        for left in (part.manifest, part.lock):
            with contextlib.suppress(FileNotFoundError):
                os.unlink(os.path.join(folder, left))
    return Merged(folder=folder, total=len(plan), joined=kept, missing=tuple(missing), wrong=tuple(wrong),
                  twice=tuple(twice), instruction_sets=tuple(sorted(sets)),
                  labelled=None if plan.labels is None else tally)


def _found(sources):
    """Return the lines of finished renders by output, of every manifest the last one about each."""
    found: dict[str, list[Line]] = {}
    for source in sources:
        for name in manifests(source):
            last = {line.output: line for line in lines(os.path.join(source, name)) if line.entry is not None}
            for output, line in last.items():
                if line.entry is not None and line.entry.status == "ok":
                    found.setdefault(output, []).append(line)
    return found


def _fault(plan, index, folder, record, made_by, digest):
    """Return what of a record does not agree with the plan or the image, or None."""
    render = plan.render(index, int(record.get("redrawn", 0)) if plan.redraw else 0)
    if record["versions"] != made_by:
        others = ", ".join(f"{name} {version}" for name, version in record["versions"].items()
                           if made_by.get(name) != version)
        return f"made by other versions ({others})"
    if key(record["parameters"], record["seed"], record["inputs"], record["versions"]) != key(
            render.parameters, render.seed, digest(render), made_by):
        return "made from other parameters or files"
    path, *others = (os.path.join(folder, name) for name in _outputs(plan, render.output))
    if not all(map(os.path.isfile, (path, *others))):
        return "not there"
    if os.path.getsize(path) != record["bytes"] or sha256(path) != record.get("sha256"):
        return "altered after writing, or not what its line says"
    return None


def _outputs(plan, output):
    """Return the names of the files of a render."""
    return [output, *([preview(output)] if plan.previews else [])]


def _bring(source, target):
    """Link a file to another folder, or copy it to another disk."""
    if os.path.exists(target) and os.path.samefile(source, target):
        return
    os.makedirs(os.path.dirname(target), exist_ok=True)
    with replacing(target) as temporary:
        temporary.unlink()
        try:
            os.link(os.path.realpath(source), temporary)
        except OSError:                                # another disk, or one without links
            shutil.copyfile(source, temporary)
