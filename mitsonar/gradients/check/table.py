"""What a check of gradients found: a verdict for each part of each parameter, as text and as a dataset."""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

RIGHT = "right"
OFF = "off"
DISCONNECTED = "disconnected"      # the gradient is zero, the difference is not
UNSEEN = "unseen"                  # the record does not depend on it, by either
UNDECIDED = "undecided"            # differences at two steps disagree by more than what is asked
NOT_DIFFERENTIATED = "not differentiated"
WRONG = (OFF, DISCONNECTED)
NUMBERS = {"error": "of derivatives, as a share of what they are: rms over directions and weights",
           "slope": "of differences over derivatives",
           "asymmetry": "of forward and backward derivatives, as a share",
           "disagreement": "of differences at two steps, as a share",
           "step": "of the differences, in the unit of the parameter",
           "moved": "change of the weighted record between the outermost steps, as a share"}


@dataclass(frozen=True, kw_only=True)
class PartCheck:
    """What was found of one part of one parameter."""

    key: str  # of the parameter
    unit: str  # of the parameter
    size: int  # numbers that the parameter has
    verdict: str  # right, off, disconnected, unseen, undecided or not differentiated
    part: str = ""  # component or index
    error: float = np.nan  # see `NUMBERS`
    slope: float = np.nan  # see `NUMBERS`
    asymmetry: float = np.nan  # see `NUMBERS`
    disagreement: float = np.nan  # see `NUMBERS`
    step: float = np.nan  # see `NUMBERS`
    moved: float = np.nan  # see `NUMBERS`
    notes: tuple[str, ...] = ()  # what else there is to say, in words


@dataclass(frozen=True, kw_only=True)
class GradientCheck:
    """What was found of parameters of a model."""

    rows: tuple[PartCheck, ...]
    directions: int  # of each part, at most
    tolerance: float  # errors up to which a derivative is right
    told: Mapping[str, float] = field(default_factory=dict)

    @property
    def wrong(self) -> tuple[PartCheck, ...]:
        """The parts that are off or disconnected."""
        return tuple(row for row in self.rows if row.verdict in WRONG)

    @property
    def undecided(self) -> tuple[PartCheck, ...]:
        """The parts on which differences could not decide."""
        return tuple(row for row in self.rows if row.verdict == UNDECIDED)

    def text(self) -> str:
        """Return a table in words; what is said of many parts is said once."""
        head = ("parameter", "verdict", "error", "slope", "forward/backward", "two steps", "step")
        lines = [head, *(_cells(row) for row in self.rows)]
        widths = [max(len(line[k]) for line in lines) for k in range(len(head))]
        shown = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
                 for line in lines]
        said: dict[str, list[str]] = {}
        for row in self.rows:
            for note in row.notes:
                said.setdefault(note, []).append(_name(row))
        shown += [f"{', '.join(names)}: {note}" for note, names in said.items()]
        shown += [f"{name}: {share:.1%}" for name, share in self.told.items()]
        return "\n".join(shown)

    def to_dataset(self) -> xr.Dataset:
        """Return the table as a dataset with one dimension, `row`."""
        import xarray as xr

        columns: dict = {name: ("row", [getattr(row, name) for row in self.rows])
                         for name in ("key", "part", "unit", "verdict")}
        columns["size"] = ("row", np.array([row.size for row in self.rows], np.int64))
        columns |= {name: ("row", np.array([getattr(row, name) for row in self.rows], float), {"long_name": text})
                    for name, text in NUMBERS.items()}
        columns["notes"] = ("row", ["; ".join(row.notes) for row in self.rows])
        return xr.Dataset(columns, attrs={
            "title": "Gradients against differences", "directions": self.directions, "tolerance": self.tolerance,
            **{f"share_{name.replace(' ', '_')}": float(share) for name, share in self.told.items()}})


def joined(checks: Sequence[GradientCheck]) -> GradientCheck:
    """Return checks with the same options as one, and of what several tell the largest share."""
    told: dict[str, float] = {}
    for check in checks:
        for name, share in check.told.items():
            told[name] = max(share, told.get(name, share))
    return GradientCheck(rows=tuple(row for check in checks for row in check.rows), directions=checks[0].directions,
                         tolerance=checks[0].tolerance, told=told)


def _name(row):
    return f"{row.key} {row.part}".rstrip()


def _cells(row):
    def share(value: float) -> str:
        return "-" if np.isnan(value) else f"{value:.1e}"

    step = "-" if np.isnan(row.step) else f"{row.step:.2g}{'' if row.unit in ('', '1') else f' {row.unit}'}"
    slope = "-" if np.isnan(row.slope) else f"{row.slope:.4f}"
    return _name(row), row.verdict, share(row.error), slope, share(row.asymmetry), share(row.disagreement), step
