"""Frozen records that Dr.Jit's symbolic loops leave alone.

A loop traced by `dr.syntax` carries every dataclass it can see as loop state and writes it back field by field, which
frozen dataclasses refuse. Tables that a loop only reads are therefore plain objects.
"""

from typing import Any

__all__ = ["Record"]


class Record:
    """Keep keyword values, exactly the annotated ones, and refuse changes."""

    def __init__(self, **values: Any):
        expected = set(type(self).__annotations__)
        if set(values) != expected:
            raise TypeError(f"{type(self).__name__} takes {sorted(expected)}, got {sorted(values)}")
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen; make a new one to change {name}")
