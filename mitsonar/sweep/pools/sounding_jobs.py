"""Soundings by processes: a line as a product of a sweep, and blocks of pings of one line.

Only the first block holds what all pings of a line share.
"""
import json
from collections.abc import Callable, Iterator
from typing import Any

import xarray as xr

from .answers import Answers, packed, unpacked
from .local import Local

BLOCK = 4                          # pings of a job
_SOUNDERS: dict[str, Any] = {}     # the line that this process has opened last


class PingBlocks:
    """Soundings of one line by several processes."""

    def __init__(self, pool: Local, job: dict[str, Any]):
        self._answers, self._job = Answers(pool), job
        self.count = int(next(self._answers.of([{**job, "pings": [0, 0], "whole": False}]))["count"])

    def pings_from(self, start: int) -> Iterator[xr.Dataset]:
        """Yield the pings from a number on; only the first has what is not of its own."""
        for answer in self._answers.of({**self._job, "pings": [number, min(number + BLOCK, self.count)],
                                        "whole": number == start} for number in range(start, self.count, BLOCK)):
            yield from unpacked(answer["block"])


def block(job: dict[str, Any], load: Callable[[], Any]) -> dict[str, Any]:
    """Return the answer to the job of a block of pings; the line stays open for the next."""
    from mitsonar.verbs.images import sounder

    line = json.dumps([job["scene"], job["parameters"], job["seed"], job["soundings"]], sort_keys=True)
    if line not in _SOUNDERS:
        _SOUNDERS.clear()
        _SOUNDERS[line] = sounder(load(), job["seed"], **job["soundings"])
    count, pings_of = _SOUNDERS[line]
    whole, pings = job["whole"], []
    for ping in pings_of(range(*job["pings"])):
        own = [name for name, variable in ping.variables.items() if whole or "ping" in variable.dims]
        pings.append(xr.Dataset({name: ping.variables[name] for name in own}, attrs=ping.attrs if whole else None))
    return {"count": count, "block": packed(pings)}


def line(job: dict[str, Any], scene: Any, path: str) -> dict[str, Any]:
    """Write the line of a job and return its instruction set; or, with ``trial``, its cost by a few pings."""
    from mitsonar.verbs import sounding_files
    from mitsonar.verbs.images import sounder

    about = dict(job["soundings"])
    place, start = about.pop("place", None), about.pop("start", None)
    filed: dict[str, Any] = {"place": None if place is None else tuple(place), "start": start}
    count, pings_of = sounder(scene, job["seed"], **about)
    if job.get("trial"):
        cost = sounding_files.cost(count, pings_of, path, **filed)
        return {"bytes": int(cost.bytes), "line_seconds": cost.seconds * count}
    made = {}

    def pings_from(start: int) -> Iterator[xr.Dataset]:
        for ping in pings_of(range(start, count)):
            made["instruction_set"] = ping.attrs["instruction_set"]
            yield ping

    sounding_files.store(pings_from, count, path, **filed, anew=True)
    return made
