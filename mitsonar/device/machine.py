"""Cores and memory of this machine that our processes may use.

A container's share is a limit of its control group (Linux, cgroup versions 1 and 2), which no count of cores or pages
tells: a container with 2 of 64 cores would start 64 processes, and be stopped when all of them have a scene.
"""
import contextlib
import math
import os
from collections.abc import Iterator
from pathlib import Path, PurePosixPath

GROUPS, OWN = "/sys/fs/cgroup", "/proc/self/cgroup"
PERIOD = 100_000                   # [us] of a limit of cores, where its file does not say


def cores() -> int:
    """Return the number of cores that our processes may use."""
    whole = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    share = min((_share(*limit) for limit in _group_limits("cpu", "cpu.max", "cpu.cfs_quota_us", "cpu.cfs_period_us")),
                default=math.inf)
    return max(1, math.ceil(share)) if share < whole else whole


def memory() -> float:
    """Return the memory [bytes] that our processes may use; infinite where the system does not report it."""
    limits = [limit for limit, *_ in _group_limits("memory", "memory.max", "memory.limit_in_bytes")]
    with contextlib.suppress(AttributeError, ValueError, OSError):
        limits.append(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    with contextlib.suppress(ImportError):             # not on Windows
        import resource

        if (allowed := resource.getrlimit(resource.RLIMIT_AS)[0]) != resource.RLIM_INFINITY:
            limits.append(allowed)
    return min(limits, default=math.inf)


def _share(quota: float, period: float = PERIOD) -> float:
    """Return the cores of a limit of time [us] in each period [us]."""
    return quota / period if quota > 0 and period > 0 else math.inf


def _group_limits(controller: str, unified: str, *older: str) -> Iterator[list[float]]:
    """Yield the numbers of the limits of our control group and of those around it: version 2's file, or version 1's."""
    try:
        lines = os.fsdecode(Path(OWN).read_bytes()).splitlines()
    except OSError:
        return
    for _, controllers, path in (line.split(":", 2) for line in lines if line.count(":") >= 2):
        if controllers and controller not in controllers.split(","):
            continue
        base, files = (Path(GROUPS, controller), older) if controllers else (Path(GROUPS), (unified,))
        # a container sees its own group as the root, whatever its path outside
        for group in (own := PurePosixPath(path), *own.parents):
            if numbers := [number for file in files for number in _numbers(base / str(group).lstrip("/") / file)]:
                yield numbers


def _numbers(file: Path) -> list[float]:
    """Return the numbers in a file of a control group; "max" is infinite."""
    try:
        return [math.inf if word == "max" else float(word) for word in file.read_text().split()]
    except (OSError, ValueError):
        return []
