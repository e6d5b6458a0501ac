"""Balance of a set of samples: numbers and shares that a plan asks for, beside those that were made.

Whether an object shows in a picture is known only after rendering. Nothing is therefore rejected and no part waits for
another: the plan decides what is drawn how often (`strata`), and what came of it is counted, compared and reported.
"""
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from mitsonar.device.spelling import meant
from mitsonar.labels.tally import Tally

from .values import number, shortened

WHOLE_SET = {"empty": "pictures without objects", "negative": "pictures of negatives alone"}
BY_CLASS = {"images": "pictures with {}", "boxes": "boxes of {}"}
LARGEST = 1_000_000_000


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Wish of a plan, and what came of it so far."""

    what: str  # counted, in words
    asked: float  # at least: a number, or a share below 1
    got: int
    total: int  # of which shares are taken: pictures, or boxes of all classes
    met: bool  # of an unfinished set: at this rate

    @property
    def words(self) -> str:
        """Return what was asked for and what there is, as text."""
        if self.asked < 1:
            return f"{self.what}: {self.got:,} of {self.total:,}, {self.got / max(self.total, 1):.1%}; asked for " \
                   f"{self.asked:.1%}"
        return f"{self.what}: {self.got:,}; asked for {self.asked:,.0f}"


def balance_of(given: Any, labels: Mapping[str, Any] | None, classes: Sequence[str]) -> dict[str, Any] | None:
    """Return the checked table ``[balance]`` of a plan: numbers, or shares below 1; None without the table."""
    if given is None:
        return None
    if labels is None:
        raise ValueError("[balance] counts labelled pictures, and output does not name samples; let its names end in "
                         ".tar, or leave [balance] out")
    check_balance(given, [*classes, *labels.get("negatives", ()), *filter(None, [labels.get("negative_class")])])
    return given


def check_balance(given: Any, known: Sequence[str] | None = None) -> None:
    """Raise `ValueError` for a table ``[balance]`` of other things than are counted, or of other classes than known."""
    if not isinstance(given, dict) or not given:
        raise ValueError(f"balance is {shortened(given)}; write under [balance] what is to be there, such as "
                         "empty = 0.1 or images = { tyre = 100 }")
    for key, item in given.items():
        if key not in (*WHOLE_SET, *BY_CLASS):
            raise ValueError(f"balance.{key} is unknown{meant(key, (*WHOLE_SET, *BY_CLASS))}; known: "
                             f"{', '.join((*BY_CLASS, *WHOLE_SET))}")
        if key in WHOLE_SET:
            _check(item, f"balance.{key}")
            continue
        if not isinstance(item, dict):
            raise ValueError(f"balance.{key} is {shortened(item)}; give numbers by class, such as {{ tyre = 100 }}")
        for name, least in item.items():
            if known is not None and name not in known:
                raise ValueError(f"balance.{key} has the class {shortened(name)}{meant(name, known)}; the plan has "
                                 f"{', '.join(known)}")
            _check(least, f"balance.{key}.{name}")


def _check(given, where):
    least = number(given, where)
    if not 0 < least <= LARGEST or least >= 1 and not isinstance(least, int):
        raise ValueError(f"{where} is {shortened(given)}; give a whole number of at least 1, or a share below 1")


def verdicts(balance: Mapping[str, Any], tally: Tally, finished: float = 1.0) -> list[Verdict]:
    """Return what came of the wishes of a plan of which the share ``finished`` is made."""
    wishes = [(words, balance[key], getattr(tally, key), tally.pictures) for key, words in WHOLE_SET.items()
              if key in balance]
    for key, words in BY_CLASS.items():
        counts = getattr(tally, key)
        total = tally.pictures if key == "images" else counts.total()
        wishes += [(words.format(name), least, counts[name], total) for name, least in balance.get(key, {}).items()]
    return [Verdict(what=what, asked=asked, got=got, total=total,
                    met=got >= asked * total if asked < 1 else got >= asked * finished) for what, asked, got, total in
            wishes]


def tally_said(tally: Tally) -> str:
    """Return the numbers of labelled pictures as text."""
    classes = ", ".join(f"{name} {boxes:,} in {tally.images[name]:,}" for name, boxes in sorted(tally.boxes.items()))
    return (f"{tally.pictures:,} picture{'s' * (tally.pictures != 1)}, {tally.empty:,} without objects"
            + f", {tally.negative:,} with negatives alone" * bool(tally.negative)
            + f"; boxes in pictures: {classes}" * bool(classes))


def missed_said(verdict: Verdict, made: int, renders: int) -> str:
    """Return a sentence about a wish that is not met, with that many renders made of a plan."""
    if verdict.asked < 1 or not verdict.got:
        why = "More samples do not change a share" if verdict.asked < 1 else "None has shown yet"
        return (f"{verdict.words}. {why}: let the plan draw them more often, by weights or counts of targets, or let "
                "the sonar see more of the area where they lie.")
    needed = math.ceil(made * verdict.asked / verdict.got)
    return (f"{verdict.words}. At this rate a plan of {needed:,} renders would have them, instead of {renders:,}; or "
            "let it draw them more often.")
