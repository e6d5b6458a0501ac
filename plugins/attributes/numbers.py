"""Declare attributes that are numbers."""
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from mitsonar.units import radians_from_deg

from .declaration import REQUIRED, Attribute, FromTable, Unfit, in_unit, shown


@dataclass(frozen=True)
class Number(Attribute):
    """Declare a finite number within bounds, written as a float or an integer."""

    minimum: float | None = None  # inclusive
    maximum: float | None = None
    above: float | None = None  # exclusive
    below: float | None = None
    unit: str = ""
    types = ("Float", "Integer")
    noun: ClassVar[str] = "a number"

    @property
    def expected(self) -> str:
        bounds = (("at least", self.minimum), ("above", self.above), ("at most", self.maximum), ("below", self.below))
        within = " and ".join(f"{word} {bound}" for word, bound in bounds if bound is not None)
        return f"{self.noun}{in_unit(self.unit)}{f' {within}' if within else ''}"

    def read(self, value: Any, written_as: str) -> Any:
        if not np.isfinite(value) or not self._within(value):
            raise Unfit
        return self.taken(value)

    def taken(self, default: Any) -> Any:
        return float(default)

    def _within(self, value: float) -> bool:
        return ((self.minimum is None or value >= self.minimum) and (self.maximum is None or value <= self.maximum)
                and (self.above is None or value > self.above) and (self.below is None or value < self.below))


@dataclass(frozen=True)
class Integer(Number):
    """Declare a whole number; a float is refused even if it is whole."""

    types = ("Integer",)
    noun = "an integer"

    def taken(self, default: Any) -> Any:
        return int(default)


@dataclass(frozen=True)
class Angle(Number):
    """Declare an angle in degrees, under a name that ends in ``_deg``; the plugin gets radians."""

    unit: str = "degrees"

    def taken(self, default: Any) -> Any:
        return float(radians_from_deg(default))


@dataclass(frozen=True)
class Point(Attribute):
    """Declare a point or vector; the plugin gets a float64 array (3,)."""

    unit: str = "m"
    types = ("Vector",)

    @property
    def expected(self) -> str:
        return f"a point{in_unit(self.unit)}"

    def read(self, value: Any, written_as: str) -> np.ndarray:
        return np.array(value, dtype=np.float64)


@dataclass(frozen=True)
class Transform(Attribute):
    """Declare a transform; the plugin gets a float64 matrix (4, 4), by default the identity."""

    default: Any = None
    types = ("Transform",)

    @property
    def expected(self) -> str:
        return "a transform"

    def read(self, value: Any, written_as: str) -> np.ndarray:
        return np.array(value.matrix, dtype=np.float64)


@dataclass(frozen=True)
class Numbers(Attribute):
    """Declare finite numbers in a string, such as "1, 2, 3e2"; the plugin gets a float64 array.

    Empty text counts as not written, except beside a preset with numbers: there it is an empty list.
    """

    count: int | None = None
    unit: str = ""
    types = ("String", "Float", "Integer")

    @property
    def expected(self) -> str:
        return f"{'a list of' if self.count is None else self.count} numbers{in_unit(self.unit)} separated by commas"

    def read(self, value: Any, written_as: str) -> Any:
        numbers = self._numbers(value)
        if numbers or self.default is REQUIRED or isinstance(self.default, FromTable):
            return self.taken(numbers)
        return None if self.default is None else self.taken(self.default)

    def taken(self, default: Any) -> Any:
        return np.array(default, dtype=np.float64)

    def _numbers(self, value: Any) -> list[float]:
        """Return the numbers in a written value; an empty list if it is blank."""
        if isinstance(value, str) and not value.strip() and self.default is not REQUIRED:
            return []
        try:
            numbers = [float(word) for word in value.replace(",", " ").split()] if isinstance(value, str) else [value]
        except ValueError:
            raise Unfit from None
        if not numbers or not np.isfinite(numbers).all() or (self.count is not None and len(numbers) != self.count):
            raise Unfit
        return numbers


@dataclass(frozen=True)
class Range(Numbers):
    """Declare a number, or two to draw from, "low, high"; the plugin gets two."""

    minimum: float = -np.inf  # of both numbers
    maximum: float = np.inf
    whole: bool = False

    @property
    def expected(self) -> str:
        return (f"{'a whole number' if self.whole else 'a number'} or two, \"low, high\", from {self.minimum:g} to "
                f"{self.maximum:g}{in_unit(self.unit)}")

    def read(self, value: Any, written_as: str) -> Any:
        try:
            numbers = self._numbers(value) or list(self.default)
        except Unfit:
            raise Unfit(expected=super().expected) from None
        low, high = self.taken(numbers) if len(numbers) in (1, 2) else (np.nan, np.nan)
        if not self.minimum <= low <= high <= self.maximum or self.whole and (low % 1 or high % 1):
            raise Unfit(got=shown(numbers))
        return low, high

    def taken(self, default: Any) -> Any:
        numbers = tuple(int(number) if self.whole and not number % 1 else float(number) for number in default)
        return numbers * 2 if len(numbers) == 1 else numbers
