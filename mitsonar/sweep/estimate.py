"""Estimate of a sweep's cost, from finished renders or from a few trials."""
import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass

from mitsonar.device.files import FilePath

from .execute import check_loading, default_folder, job, standing
from .local import Local, cores, shares
from .manifest import MANIFEST, read
from .plan import Plan, load_plan
from .versions import versions

TRIALS = 3
ENOUGH_SECONDS = 30.0              # of trials, of which the first compiles,
LONG_SECONDS = 300.0               # unless it alone lasts so long that compiling is a small part of it


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Estimate of a sweep's cost."""

    folder: str
    total: int  # number of renders of the plan
    missing: int  # number of renders that are not there yet
    changed: int  # number of the missing whose image is there, from other parameters, files or versions
    damaged: int  # number of the missing whose image is there with other content than was written
    processes: int  # for which the estimate is made
    threads: int  # likewise
    at_once: int  # how many of the processes the cores bear
    seconds: float | None  # mean of a render
    bytes: float | None  # mean of a render
    duration: float | None  # seconds of all that is missing
    trials: int  # renders made to find out
    free: int  # bytes free where the folder is
    unplanned: list[str]  # outputs in the folder that the plan does not make


def estimate(plan: Plan | FilePath, folder: FilePath | None = None, *, processes: int | None = None,
             threads: int | None = None, verify: bool = False, say: Callable[[str], None] | None = None) -> Estimate:
    """Find out what a sweep will take, without writing into its folder."""
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    processes, threads = shares(processes, threads)
    folder = os.path.abspath(default_folder(plan) if folder is None else folder)
    made_by = versions()
    now = standing(plan, folder, read(os.path.join(folder, MANIFEST))[0], made_by, verify=verify)
    seconds, sizes, trials = now.seconds, now.bytes, 0
    if now.missing and seconds:
        with Local(1, threads, os.path.dirname(plan.path)) as one:
            check_loading(one, plan, now.missing, made_by)
    elif now.missing:
        seconds, sizes = _try(plan, now.missing, threads, made_by, say or (lambda text: None))
        trials = len(sizes)
    at_once = max(1, min(processes, cores() // threads))
    each, size = (sum(seconds) / len(seconds), sum(sizes) / len(sizes)) if now.missing else (None, None)
    return Estimate(folder=folder, total=len(plan), missing=len(now.missing), changed=now.changed,
                    damaged=now.damaged, processes=processes, threads=threads, at_once=at_once, seconds=each,
                    bytes=size, trials=trials,
                    duration=None if each is None else each * math.ceil(len(now.missing) / at_once),
                    free=shutil.disk_usage(_above(folder)).free, unplanned=now.unplanned)


def _try(plan, missing, threads, made_by, say):
    """Seconds and bytes of a few renders, over the plan; the first one loads and compiles, and does not count."""
    spread = dict.fromkeys(missing[k * (len(missing) - 1) // (TRIALS - 1)] for k in range(TRIALS))
    say("timing a render" if len(spread) == 1 else f"timing {len(spread)} renders")
    seconds, sizes, start = [], [], time.perf_counter()
    place = os.path.dirname(plan.path)
    with tempfile.TemporaryDirectory(prefix="mitsonar-") as scratch, Local(1, threads, place) as one:
        for index in spread:
            render = plan.render(index)
            answer = one.submit(job(plan, render, scratch, made_by)).result()
            if answer.get("error"):
                raise ValueError(f"render {index} ({render.output}) fails: {answer['error']}")
            seconds.append(answer["seconds"])
            sizes.append(answer["bytes"])
            if time.perf_counter() - start > (ENOUGH_SECONDS if len(seconds) > 1 else LONG_SECONDS):
                break
    return seconds[1:] or seconds, sizes


def _above(folder):
    """The folder, or the nearest above it that is there."""
    while not os.path.exists(folder):
        folder = os.path.dirname(folder)
    return folder
