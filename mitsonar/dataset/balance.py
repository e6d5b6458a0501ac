"""Class balance of a set of shards: what the plans of its sweeps asked for, and what the pictures have."""
from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mitsonar.labels.tally import Tally
from mitsonar.sweep.balance import Verdict, check_balance, verdicts

if TYPE_CHECKING:
    from .shards import SampleFile, Shard


@dataclass(frozen=True, kw_only=True)
class SweepBalance:
    """Pictures of one sweep, beside what its plan asked for."""

    folder: Path
    tally: Tally
    verdicts: tuple[Verdict, ...]


def balances(shards: Sequence[Shard]) -> list[SweepBalance]:
    """Return the balance of every sweep in a set, in the order of their folders."""
    sweeps: dict[Path, list[SampleFile]] = {}
    for shard in shards:
        for sample in shard.samples:
            sweeps.setdefault(sample.folder, []).append(sample)
    return [_balance(folder, samples) for folder, samples in sorted(sweeps.items())]


def tally_of(samples: Iterable[SampleFile]) -> Tally:
    """Return the numbers of the pictures of samples."""
    tally = Tally()
    for sample in samples:
        for picture in sample.pictures:
            tally.picture(picture["counts"], picture.get("negatives") or {}, picture.get("negative_class"))
    return tally


def _balance(folder, samples):
    """Return the balance of a sweep; of its samples, the last ones of the plan have the latest wishes."""
    last, tally = max(samples, key=lambda sample: sample.record["index"]), tally_of(samples)
    if (wishes := last.record.get("balance")) is None:
        return SweepBalance(folder=folder, tally=tally, verdicts=())
    try:
        check_balance(wishes)
    except ValueError as error:
        raise ValueError(f"{folder} has a manifest with a balance that no plan can have: {error}.") from None
    return SweepBalance(folder=folder, tally=tally, verdicts=tuple(verdicts(wishes, tally)))
