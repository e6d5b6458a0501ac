"""Declare attributes that are a table, or a number in place of a table or a texture."""
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np

from .declaration import NESTED, Attribute, Unfit, in_unit
from .numbers import Number


@dataclass(frozen=True)
class Table(Attribute):
    """Declare a table such as <spectrum name=... value="0:1490.5, 10:1485"/>; the plugin gets two arrays (N,)."""

    unit: str = ""
    types = ("Spectrum", "String")

    @property
    def expected(self) -> str:
        return f'a table of finite numbers "0:1490.5, 10:1485"{in_unit(self.unit)}'

    def read(self, value: Any, written_as: str) -> tuple[np.ndarray, ...]:
        if written_as == "String":
            try:
                pairs = [[float(word) for word in pair.split(":")] for pair in value.split(",")]
                columns = [np.array(column, dtype=np.float64) for column in zip(*pairs, strict=True)]
            except ValueError:
                raise Unfit from None
        else:
            columns = [np.array(column, dtype=np.float64) for column in (value.wavelengths, value.values)]
        if len(columns) != 2 or columns[0].size == 0 or not np.isfinite(columns).all():
            raise Unfit
        return tuple(columns)


@dataclass(frozen=True)
class NumberOrTable(Table):
    """Declare a table, or a number, which the plugin gets as a table of one row at 0."""

    types = ("Spectrum", "String", "Float", "Integer")

    @property
    def expected(self) -> str:
        return f'a number or a table of finite numbers "0:-60, 10:-75"{in_unit(self.unit)}'

    def read(self, value: Any, written_as: str) -> tuple[np.ndarray, ...]:
        if written_as not in ("Float", "Integer"):
            return super().read(value, written_as)
        if not np.isfinite(value):
            raise Unfit
        return np.zeros(1), np.array([float(value)])


@dataclass(frozen=True)
class NumberOrTexture(Number):
    """Declare a finite number within bounds, or a nested texture, which the plugin gets as it is."""

    types = ("Float", "Integer", *NESTED)

    @property
    def expected(self) -> str:
        return f"{super().expected} or a texture"

    def read(self, value: Any, written_as: str) -> Any:
        if written_as not in NESTED:
            return super().read(value, written_as)
        if not isinstance(value, mi.Texture):
            raise Unfit
        return value
