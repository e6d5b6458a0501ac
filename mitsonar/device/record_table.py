"""Tables of the variables of a record: dimensions, types, units and meanings, and the checks that follow from them."""
from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import xarray as xr

MOST_NAMED = 3                     # missing variables that an error names
KINDS = {"bool": ("b", "true or false"), "str": ("OUST", "text"), "c8": ("biufc", "numbers")}   # else numbers, real


@dataclass(frozen=True, kw_only=True)
class RecordVariable:
    """Variable of a record; ``needed`` variables are in every record."""

    name: str
    dims: tuple[str, ...]
    dtype: str
    unit: str
    meaning: str
    group: str
    needed: bool = False


def rows(group: str, dims: tuple[str, ...], needed: bool, *texts: tuple[str, str, str, str]) -> list[RecordVariable]:
    """Return variables of one group and shape, from their names, types, units and meanings."""
    return [RecordVariable(name=name, dims=dims, dtype=dtype, unit=unit, meaning=meaning, group=group, needed=needed)
            for name, dtype, unit, meaning in texts]


class RecordTable(dict[str, RecordVariable]):
    """Variables of a kind of record, by name."""

    def __init__(self, variables: Iterable[RecordVariable]):
        super().__init__({variable.name: variable for variable in variables})

    def variable(self, name: str, values: np.ndarray) -> xr.Variable:
        """Return a variable of the record, with its dimensions, type, unit and meaning."""
        about = self[name]
        values = np.asarray(values, about.dtype)
        if values.ndim != len(about.dims):
            raise ValueError(f"{name} has the dimensions {', '.join(about.dims)}, got an array {values.shape}.")
        return xr.Variable(about.dims, values, {"units": about.unit, "long_name": about.meaning})

    def check(self, record: xr.Dataset, what: str, source: str) -> None:
        """Refuse a dataset, named ``what``, that is no such record as ``source`` makes it."""
        missing = [name for name, about in self.items() if about.needed and name not in record.variables]
        if missing:
            raise ValueError(f"{what}: the record lacks {', '.join(missing[:MOST_NAMED])}"
                             f"{' ...' if len(missing) > MOST_NAMED else ''}; give a dataset as {source} makes it.")
        for name, found in record.variables.items():
            about = self.get(str(name))
            if about is None:
                continue
            if found.dims != about.dims:
                raise ValueError(f"{what}: {name} has the dimensions {found.dims}, it must have {about.dims}.")
            kinds, content = KINDS.get(about.dtype, ("biuf", "numbers"))
            if found.dtype.kind not in kinds:
                raise ValueError(f"{what}: {name} is of the type {found.dtype}, it must hold {content}.")
