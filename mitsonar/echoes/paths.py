"""Names of paths: the bounces of sound on its way, one letter each.

    b   the seabed or an object
    s   the sea surface
    v   the volume of the water

A path and its reverse take the same time and share a name: "bs" is seabed then surface, or surface then seabed. On the
device a path is a code: a leading 1, then one bit per bounce, which is 1 at the surface.
"""
from __future__ import annotations

from itertools import product

import drjit as dr
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.device.types import Bool, UInt32


class Paths:
    """The paths of a run, numbered from 1."""

    def __init__(self, max_depth: int, *, surface: bool = False, volume: bool = False):
        kinds = "bs" if surface else "b"
        words = ["".join(word) for length in range(1, max_depth + 1) for word in product(kinds, repeat=length)]
        named = dict.fromkeys(map(_canonical, words))
        self.names = tuple(sorted(named, key=lambda name: (len(name), name))) + (("v",) if volume else ())
        self.max_depth = max_depth
        numbers = np.zeros(2 << max_depth, np.uint32)
        for word in words:
            numbers[_code(word)] = 1 + self.names.index(_canonical(word))
        self._numbers = numbers

    def number(self, name: str) -> int:
        """Return the number of a path from its name, in either direction."""
        return 1 + self.names.index(_canonical(name))

    def numbers(self, code: UInt32) -> UInt32:
        """Return the numbers of codes, UInt32 (R,)."""
        return dr.gather(type(code), upload(type(code), self._numbers), code)

    @staticmethod
    def extended(code: UInt32, at_surface: Bool) -> UInt32:
        """Return the codes after one more bounce; `at_surface` Bool (R,)."""
        return 2 * code + dr.select(at_surface, type(code)(1), type(code)(0))

    def __len__(self) -> int:
        return len(self.names)


def _canonical(word):
    return min(word, word[::-1])


def _code(word):
    code = 1
    for letter in word:
        code = 2 * code + (letter == "s")
    return code
