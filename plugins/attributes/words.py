"""Declare attributes that are words: true or false, text, names of files."""
import os
from dataclasses import dataclass
from typing import Any

from mitsonar.device.spelling import meant
from mitsonar.sonar.preset_tables import TABLES, instruments, presets

from .declaration import REQUIRED, Attribute, Unfit
from .input_files import found_file, resolved


@dataclass(frozen=True)
class Boolean(Attribute):
    """Declare a value of true or false."""

    types = ("Bool",)

    @property
    def expected(self) -> str:
        return "true or false"

    def read(self, value: Any, written_as: str) -> bool:
        return bool(value)


@dataclass(frozen=True)
class Text(Attribute):
    """Declare a string."""

    types = ("String",)

    @property
    def expected(self) -> str:
        return "a string"

    def read(self, value: Any, written_as: str) -> str | None:
        return value


@dataclass(frozen=True)
class Choice(Text):
    """Declare one of a list of words."""

    choices: tuple[str, ...] = ()

    @property
    def expected(self) -> str:
        return "one of " + ", ".join(f'"{choice}"' for choice in self.choices)

    def read(self, value: Any, written_as: str) -> str:
        if value not in self.choices:
            raise Unfit(hint=meant(value, self.choices))
        return value


@dataclass(frozen=True)
class Preset(Choice):
    """Declare the name of a preset of the sonar's own kind: of a class, or of an instrument."""

    @property
    def expected(self) -> str:
        named = {name for kind in TABLES for name in instruments(kind)}
        listed = ", ".join(f'"{choice}"' for choice in self.choices if choice not in named)
        return f"one of {listed}" + ", or the name of an instrument" * bool(named.intersection(self.choices))

    def read(self, value: Any, written_as: str) -> str:
        others = [kind for kind in TABLES if value in presets(kind)]
        if value not in self.choices and others:
            raise Unfit(hint=f" ({value!r} is a preset of {' and '.join(others)})".replace("'", '"'))
        return super().read(value, written_as)


@dataclass(frozen=True)
class File(Text):
    """Declare the name of a file, looked for beside the scene first; the plugin gets its path. Empty: not given."""

    @property
    def expected(self) -> str:
        return "the name of a file"

    def read(self, value: Any, written_as: str) -> str | None:
        if not value:
            if self.default is REQUIRED:
                raise Unfit
            return self.default
        try:
            return found_file(self.name, value)
        except ValueError as error:
            raise Unfit(sentence=str(error)) from None

    def names_of_files(self, value: str) -> tuple[str, ...]:
        """Return the names of input files in a written value."""
        return (value,) if value else ()


@dataclass(frozen=True)
class FileOrFolder(File):
    """Declare the name of a file or a folder, looked for as a `File`; the plugin gets its path. Empty: not given."""

    @property
    def expected(self) -> str:
        return "the name of a file or a folder"

    def read(self, value: Any, written_as: str) -> str | None:
        return path if value and os.path.isdir(path := resolved(value)) else super().read(value, written_as)


@dataclass(frozen=True)
class TextOrFile(File):
    """Declare text that contains a certain sign, or else the name of a file. Empty means not given."""

    sign: str = ":"

    @property
    def expected(self) -> str:
        return "a string, or the name of a file"

    def read(self, value: Any, written_as: str) -> str | None:
        return value if self.sign in value else super().read(value, written_as)

    def names_of_files(self, value: str) -> tuple[str, ...]:
        return () if self.sign in value else super().names_of_files(value)


@dataclass(frozen=True)
class Files(File):
    """Declare a folder, or names of files separated by commas; the plugin gets the text."""

    @property
    def expected(self) -> str:
        return "the name of a folder, or names of files separated by commas"

    def read(self, value: Any, written_as: str) -> str:
        return value

    def names_of_files(self, value: str) -> tuple[str, ...]:
        return tuple(name.strip() for name in value.split(",") if name.strip())
