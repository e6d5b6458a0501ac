"""Parts of one picture's record by several processes: blocks of a sidescan's pings, single pings of other sonars.

Every process plans the same run. The runner asks for parts by their numbers, and makes the picture of them.
"""
import json
import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NoReturn

from .answers import Answers, packed, unpacked
from .local import Local

_PLANNED: dict[str, tuple[Callable[[Any], Any], Sequence[Any]]] = {}       # the run that this process planned last


class _Planned(Exception):
    """End of a run at the point where its parts are to be computed."""

    def __init__(self, work: Callable[[Any], Any], parts: Sequence[Any]):
        self.run = work, parts


class PictureParts:
    """Parts of a record, computed by several processes; see `survey.survey.RunParts`."""

    def __init__(self, pool: Local, job: dict[str, Any]):
        self._pool, self._job = pool, job

    def __call__(self, work: Callable[[Any], Any], parts: Sequence[Any]) -> Iterator[Any]:
        """Yield what ``work``, that of the other processes, makes of the parts."""
        for answer in Answers(self._pool).of({**self._job, "part": number} for number in range(len(parts))):
            yield unpacked(answer["made"])


def part(job: dict[str, Any], load: Callable[[], Any]) -> dict[str, Any]:
    """Return the answer to the job of a part; the plan is kept for the next."""
    run = json.dumps([job["scene"], job["parameters"], job["seed"], job["sensor"]], sort_keys=True)
    if run not in _PLANNED:
        _PLANNED.clear()
        with warnings.catch_warnings():                # the runner plans, too, and warns of the same
            warnings.simplefilter("ignore")
            _PLANNED[run] = _planned(load(), job)
    work, parts = _PLANNED[run]
    return {"made": packed(work(parts[job["part"]]))}


def _planned(scene, job):
    from mitsonar.verbs.images import rendered

    def stop(work: Callable[[Any], Any], parts: Sequence[Any]) -> NoReturn:
        raise _Planned(work, parts)

    try:
        rendered(scene, job["seed"], job["sensor"], run_parts=stop)
    except _Planned as planned:
        return planned.run
    raise ValueError(f"the sonar {job['sensor']} has no parts that processes can share; render it in one process")
