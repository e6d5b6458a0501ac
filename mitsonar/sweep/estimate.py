"""Estimate of a sweep's cost, from finished renders or from a few trials."""
import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass

from mitsonar.device.files import FilePath
from mitsonar.device.machine import cores

from .execute import check_loading, default_folder, job, standing
from .manifest import read_all, versions
from .parts import WHOLE, Part, check_count
from .plan import Plan, load_plan
from .pools.local import Local, shares

TRIALS = 3
ENOUGH_SECONDS = 30.0              # [s]: longest time of trials, of which the first compiles
LONG_SECONDS = 300.0               # [s]: a first trial longer than this suffices, as compiling is a small part of it


@dataclass(frozen=True, kw_only=True)
class SceneCost:
    """Cost of the missing renders of one scene."""

    name: str
    missing: int
    seconds: float  # mean per render
    bytes: float  # mean per render
    trials: int


@dataclass(frozen=True, kw_only=True)
class Estimate:
    """Estimate of a sweep's cost."""

    folder: str
    total: int  # number of renders of the plan or its part
    missing: int  # number of renders to make
    changed: int  # number of the missing with an image from other parameters, files or versions
    damaged: int  # number of the missing with an altered image
    processes: int  # of the estimate
    threads: int  # per process
    at_once: int  # processes that the cores can run at a time
    seconds: float | None  # mean per render
    bytes: float | None  # mean per render
    duration: float | None  # [s]: of all missing renders
    trials: int  # renders made for the estimate
    free: int  # [bytes]: on the disk of the folder
    unplanned: list[str]  # outputs in the folder that the plan does not have
    scenes: tuple[SceneCost, ...] = ()  # of every scene with missing renders


def estimate(plan: Plan | FilePath, folder: FilePath | None = None, *, processes: int | None = None,
             threads: int | None = None, verify: bool = False, part: Part = WHOLE,
             say: Callable[[str], None] | None = None) -> Estimate:
    """Return an estimate of a sweep without writing into its folder."""
    plan = plan if isinstance(plan, Plan) else load_plan(plan)
    processes, threads = shares(processes, threads)
    folder = os.path.abspath(default_folder(plan) if folder is None else folder)
    made_by = versions()
    ours = part.indices(len(plan))
    check_count(folder, part)
    state = standing(plan, folder, read_all(folder, part)[0], made_by, verify=verify, part=part)
    scenes = tuple(_costs(plan, state, threads, made_by, say or (lambda text: None)))
    at_once = max(1, min(processes, cores() // threads))
    mean, size = (sum(scene.missing / len(state.missing) * scene.seconds for scene in scenes),
                  sum(scene.missing / len(state.missing) * scene.bytes for scene in scenes)) if scenes else (None, None)
    existing = folder
    while not os.path.exists(existing):
        existing = os.path.dirname(existing)
    return Estimate(folder=folder, total=len(ours), missing=len(state.missing), changed=state.changed,
                    damaged=state.damaged, processes=processes, threads=threads, at_once=at_once, seconds=mean,
                    bytes=size, trials=sum(scene.trials for scene in scenes), scenes=scenes,
                    duration=None if mean is None else mean * math.ceil(len(state.missing) / at_once),
                    free=shutil.disk_usage(existing).free,
                    unplanned=state.unplanned if part.whole else [])


def _costs(plan, state, threads, made_by, say):
    """Yield the cost of every scene with missing renders, from its finished ones or from trials."""
    missing, finished = _by_scene(plan, state.missing), _by_scene(plan, range(len(state.finished)), state.finished)
    for name, indices in missing.items():
        if name in finished:
            with Local(1, threads, os.path.dirname(plan.path)) as pool:
                check_loading(pool, plan, indices, made_by)
            seconds, sizes = ([costs[place] for place in finished[name]] for costs in (state.seconds, state.bytes))
        else:
            seconds, sizes = _try(plan, indices, threads, made_by,
                                  lambda text, name=name: say(text if plan.turns is None else f"{text} of {name}"))
        yield SceneCost(name=name, missing=len(indices), seconds=sum(seconds) / len(seconds),
                        bytes=sum(sizes) / len(sizes), trials=0 if name in finished else len(sizes))


def _by_scene(plan, places, indices=None):
    """Return numbers by the scene of the render of that number, or of the one at that place of a list."""
    if plan.turns is None:
        return {plan.recipes[0].name: places} if len(places) else {}
    found = {}
    for place in places:
        found.setdefault(plan.turn(place if indices is None else indices[place])[0].name, []).append(place)
    return {recipe.name: found[recipe.name] for recipe in plan.recipes if recipe.name in found}


def _try(plan, missing, threads, made_by, say):
    """Return seconds and bytes of a few renders across the plan, without the first one's time, which compiles."""
    spread = dict.fromkeys(missing[k * (len(missing) - 1) // (TRIALS - 1)] for k in range(TRIALS))
    say("timing a render" if len(spread) == 1 else f"timing {len(spread)} renders")
    seconds, sizes, start = [], [], time.perf_counter()
    place = os.path.dirname(plan.path)
    with tempfile.TemporaryDirectory(prefix="mitsonar-") as scratch, Local(1, threads, place) as pool:
        for index in spread:
            render = plan.render(index)
            answer = pool.submit({**job(plan, render, scratch, made_by), "trial": True}).result()
            if answer.get("error"):
                raise ValueError(f"render {index} ({render.output}) fails: {answer['error']}")
            seconds.append(answer.get("line_seconds", answer["seconds"]))     # of a line, from a few pings
            sizes.append(answer["bytes"])
            if time.perf_counter() - start > (ENOUGH_SECONDS if len(seconds) > 1 else LONG_SECONDS):
                break
    return seconds[1:] or seconds, sizes

