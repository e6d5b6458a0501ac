"""Declare an attribute of a plugin: the base class of all kinds of attributes."""
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import numpy as np

NESTED = ("Object", "Reference", "ResolvedReference")          # Mitsuba's types of properties that are objects


class _Required:
    """Mark an attribute without a default."""

    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED = _Required()


class Unfit(Exception):
    """Report a value that does not fit its attribute."""

    def __init__(self, *, got: str = "", expected: str = "", hint: str = "", sentence: str = "") -> None:
        super().__init__(sentence)
        self.got, self.expected, self.hint, self.sentence = got, expected, hint, sentence


@dataclass(frozen=True, kw_only=True)
class FromTable:
    """Hold a default that depends on a preset, looked up by the attribute that names the preset."""

    table: Mapping[str, Mapping[str, Any]]  # values by preset and attribute
    by: str  # name of the attribute that holds the preset


@dataclass(frozen=True)
class SameAs:
    """Hold a default that is the value of an attribute declared before."""

    name: str


@dataclass(frozen=True)
class Attribute(ABC):
    """Declare one attribute of a plugin."""

    name: str
    _: KW_ONLY
    default: Any = REQUIRED  # as it would be written in a scene
    otherwise: str = ""  # the default in words
    text: str  # meaning
    only: tuple[str, tuple[str, ...]] | None = None
    formerly: str = ""  # an earlier name, still read
    types: ClassVar[tuple[str, ...]] = ()  # accepted types of Mitsuba's properties

    @property
    @abstractmethod
    def expected(self) -> str:
        """Return a description of the expected value."""

    @abstractmethod
    def read(self, value: Any, written_as: str) -> Any:
        """Return the plugin's value for a property of one of the types; raise `Unfit` if the property does not fit."""

    def taken(self, default: Any) -> Any:
        """Return the plugin's value for a default other than None."""
        return default

    @property
    def shown_default(self) -> str:
        """Return the default in words; empty without a default."""
        if self.otherwise:
            return self.otherwise
        if self.default is REQUIRED:
            return "needed"
        if isinstance(self.default, FromTable):
            return f"*{self.default.by}*"
        if isinstance(self.default, SameAs):
            return f"`{self.default.name}`"
        return "" if self.default is None else shown(self.default)


@dataclass(frozen=True)
class Nested(Attribute):
    """Declare nested objects of a kind, such as "medium", whatever their names: the first one, or all of them.

    The name is that of Mitsuba's class in lower case. Nested objects that are not declared are left to Mitsuba.
    """

    many: bool = False
    types = NESTED

    @property
    def expected(self) -> str:
        return f"nested `<{self.name}>`, one or more" if self.many else f"a nested `<{self.name}>`"

    def read(self, value: Any, written_as: str) -> Any:
        """Return the object as Mitsuba made it."""
        return value


def in_unit(unit: str) -> str:
    """Return a unit in brackets, with a space before it."""
    return f" [{unit}]" if unit else ""


def shown(value: Any) -> str:
    """Return a value as it is written in a scene."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list, np.ndarray)):
        return ", ".join(map(shown, value))
    return f"{value:.10g}" if isinstance(value, (int, float)) else str(value)
