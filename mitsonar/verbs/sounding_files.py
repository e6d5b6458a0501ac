"""Soundings of a scene into a file of any format, resumed after an interruption, and an estimate of what a line costs.

Pings go into `OUT.part` beside the output. The output is written last, from that file, which is then removed.
"""
from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import xarray as xr

from mitsonar.device import files
from mitsonar.device.files import FilePath
from mitsonar.io import survey_lines
from mitsonar.io.records import ping_file
from mitsonar.io.survey_lines import Place, Written

TRIALS = 12                        # pings of an estimate; the first compiles and is not counted
ENOUGH_SECONDS = 30.0              # [s]: longest time of these, if at least two were made
PingsFrom = Callable[[int], Iterator[xr.Dataset]]


@dataclass(frozen=True, kw_only=True)
class LineCost:
    """Estimate of what the soundings of a line cost."""

    pings: int  # of the line
    seconds: float  # per ping, in one process
    cores: float  # that this process kept busy
    part: float  # [bytes]: of the unfinished file
    bytes: float  # of the output
    tried: int  # pings that were made for the estimate
    free: int  # [bytes]: on the disk of the output


def store(pings_from: PingsFrom, count: int, output: FilePath, *, place: Place | None = None, start: str | None = None,
          progress: Callable[[int, int], None] | None = None, anew: bool = False) -> tuple[int, Written]:
    """Write the soundings of a line, or go on with its unfinished file; return the first ping made and the summary.

    With ``anew``, an unfinished file of other pings is removed; otherwise it is refused.
    """
    part = ping_file.part_of(files.check_writable(output))

    firsts: list[xr.Dataset] = []

    def check(first: xr.Dataset) -> None:
        survey_lines.check_asked(place, start, first)
        firsts[:] = [first]

    def fill() -> int:
        return ping_file.fill(pings_from, part, count=count, progress=progress, check=check)

    try:
        first = fill()
    except ping_file.OtherRun:
        if not anew:
            raise
        part.unlink()
        first = fill()
    files.clear_left(output)
    written = survey_lines.write(survey_lines.stored(part, firsts[0]), output, place=place, start=start)
    part.unlink()
    return first, written


def cost(count: int, pings: Callable[[Iterable[int]], Iterator[xr.Dataset]], output: FilePath, *,
         place: Place | None = None, start: str | None = None) -> LineCost:
    """Return an estimate from some pings spread over the line; nothing is left beside the output."""
    numbers = sorted({round(k * (count - 1) / (TRIALS - 1)) for k in range(TRIALS)})
    made, ends = [], []
    for ping in pings(numbers * 2 if count == 1 else numbers):
        made.append(ping)
        ends.append((time.perf_counter(), time.process_time()))
        if len(made) > 1 and ends[-1][0] - ends[0][0] > ENOUGH_SECONDS:
            break
    seconds, work = (last - first for first, last in zip(ends[0], ends[-1]))
    with tempfile.TemporaryDirectory(prefix="mitsonar-") as folder:
        first, all_ = (_size(made[:number], Path(folder) / f"{number}{os.path.splitext(output)[1]}", place, start)
                     for number in (1, len(made)))
    each = max(all_ - first, 0) / (len(made) - 1)
    return LineCost(pings=count, seconds=seconds / (len(made) - 1), cores=work / seconds,
                    part=ping_file.size_of(made[0], count), bytes=first + each * (count - 1), tried=len(made),
                    free=shutil.disk_usage(os.path.dirname(os.path.abspath(output))).free)


def _size(pings: list[xr.Dataset], path: Path, place: Place | None, start: str | None) -> int:
    survey_lines.write(iter(pings), path, place=place, start=start)
    return path.stat().st_size
