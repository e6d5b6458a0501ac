"""Parts of a sweep: each is run by itself, on machines that know nothing of each other.

Part k of n makes the renders whose number in the plan is k - 1 modulo n, so that all parts take about as long as each
other. It writes a manifest of its own; `merging` joins them.
"""
import os
import re
from dataclasses import dataclass

from .values import shortened

MANIFEST, LOCK = "manifest.jsonl", ".sweep.lock"
OF_PART = re.compile(r"manifest\.part-[1-9]\d*-of-[1-9]\d*\.jsonl")
MOST_PARTS = 100_000


@dataclass(frozen=True, kw_only=True)
class Part:
    """Part ``number`` of ``count``, from 1; part 1 of 1 is the whole plan."""

    number: int = 1
    count: int = 1

    @classmethod
    def of(cls, text: str) -> "Part":
        """Return the part that a text such as ``17/200`` names; raises `ValueError` if it names none."""
        match = re.fullmatch(r"\s*(\d{1,6})\s*/\s*(\d{1,6})\s*", text)
        number, count = map(int, match.groups()) if match else (0, 0)
        if not 1 <= number <= count <= MOST_PARTS:
            raise ValueError(f"the part is {shortened(text)}; give a number and how many parts there are, such as "
                             f"17/200: from 1, and at most {MOST_PARTS:,} parts")
        return cls(number=number, count=count)

    def __str__(self):
        return f"{self.number}/{self.count}"

    @property
    def whole(self) -> bool:
        """Return True for the whole plan."""
        return self.count == 1

    def indices(self, total: int) -> range:
        """Return the numbers of its renders in a plan of ``total``."""
        return range(self.number - 1, total, self.count)

    @property
    def manifest(self) -> str:
        """Return the name of its manifest."""
        return MANIFEST if self.whole else f"manifest.part-{self.number}-of-{self.count}.jsonl"

    @property
    def lock(self) -> str:
        """Return the name of the file that tells of its run."""
        return LOCK if self.whole else f".sweep.part-{self.number}-of-{self.count}.lock"


WHOLE = Part()


def check_count(folder: str, part: Part) -> None:
    """Raise `ValueError` if a folder has parts of another number of parts, which share renders with this one."""
    for name in () if part.whole else manifests(folder):
        if (count := part_of(name).count) not in (WHOLE.count, part.count):
            raise ValueError(f"part {part} was asked for, and {folder} has parts of {count} ({name}): parts of another "
                             "number would make the same renders. Join these parts first by --merge, or give another "
                             "folder by -o")


def part_of(manifest: str) -> Part:
    """Return the part whose manifest has that name."""
    if manifest == MANIFEST:
        return WHOLE
    number, count = manifest.removeprefix("manifest.part-").removesuffix(".jsonl").split("-of-")
    return Part(number=int(number), count=int(count))


def manifests(folder: str) -> list[str]:
    """Return the names of the manifests in a folder: those of parts in the order of names, then the whole sweep's."""
    names = os.listdir(folder) if os.path.isdir(folder) else []
    return [*sorted(filter(OF_PART.fullmatch, names)), *([MANIFEST] if MANIFEST in names else [])]

