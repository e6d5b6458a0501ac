"""The scenes that come with mitsonar: files of this folder, which ``mitsonar.scenes()`` lists.

This is the package of the files, for `importlib.resources`, and a function at once: whichever of the two is used first,
the name ``mitsonar.scenes`` serves both.
"""
import sys
import types
from typing import Any


class _Scenes(types.ModuleType):
    """A package of files that can be called."""

    def __call__(self) -> Any:
        """Return the scenes that come with mitsonar; see `mitsonar.verbs.guide.scenes`."""
        from mitsonar.verbs.guide import scenes

        return scenes()


sys.modules[__name__].__class__ = _Scenes
