"""What a plugin declares of an attribute, of whatever kind."""
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass
from typing import Any, ClassVar

import numpy as np

NESTED = ("Object", "Reference", "ResolvedReference")          # Mitsuba's types of properties that are objects


class _Required:
    """The default of an attribute that has none."""

    def __repr__(self) -> str:
        return "REQUIRED"


REQUIRED = _Required()


class Unfit(Exception):
    """A value is not what the attribute expects."""

    def __init__(self, *, got: str = "", expected: str = "", hint: str = "", sentence: str = "") -> None:
        super().__init__(sentence)
        self.got, self.expected, self.hint, self.sentence = got, expected, hint, sentence


@dataclass(frozen=True, kw_only=True)
class FromTable:
    """A default that is looked up: of a preset, by the attribute that names the preset."""

    table: Mapping[str, Mapping[str, Any]]  # values by preset and attribute
    by: str  # name of the attribute that holds the preset


@dataclass(frozen=True)
class SameAs:
    """A default that is the value of another attribute, declared before."""

    name: str


@dataclass(frozen=True)
class Attribute(ABC):
    """What a plugin takes under a name."""

    name: str
    _: KW_ONLY
    default: Any = REQUIRED  # as it would be written in a scene
    otherwise: str = ""  # what is taken where it is not written, in words
    text: str  # what it means
    only: tuple[str, tuple[str, ...]] | None = None
    types: ClassVar[tuple[str, ...]] = ()  # mitsuba's types of properties that are taken

    @property
    @abstractmethod
    def expected(self) -> str:
        """What must be written, in words."""

    @abstractmethod
    def read(self, value: Any, written_as: str) -> Any:
        """Return what the plugin gets of a property's value, which has one of the types; raise `Unfit` otherwise."""

    def taken(self, default: Any) -> Any:
        """Return what the plugin gets where the default is taken, which is not None."""
        return default

    @property
    def shown_default(self) -> str:
        """What is taken where nothing is written, in words; empty if nothing."""
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
    """Nested objects of a kind, such as "medium", whatever they are called: the first one, or all of them.

    The name is that of Mitsuba's class in small letters. What is nested and not declared is left to Mitsuba.
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
    """Return a unit in brackets, as it follows a noun."""
    return f" [{unit}]" if unit else ""


def shown(value: Any) -> str:
    """Return a value as it is written in a scene."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, (tuple, list, np.ndarray)):
        return ", ".join(map(shown, value))
    return f"{value:.10g}" if isinstance(value, (int, float)) else str(value)
