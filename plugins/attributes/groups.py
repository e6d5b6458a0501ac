"""Group attributes that several plugins declare, and iterate over whole declarations."""
from collections.abc import Iterator
from dataclasses import dataclass, replace

from .declaration import Attribute


@dataclass(frozen=True, kw_only=True)
class Group:
    """Hold attributes that several plugins share, or that one plugin has several times under different prefixes."""

    title: str  # of their chapter in the reference page
    module: str  # whose docstring begins that chapter
    attributes: tuple[Attribute, ...]
    prefixes: tuple[str, ...] = ("",)

    def named(self, prefix: str) -> tuple[Attribute, ...]:
        """Return the attributes under their full names."""
        return tuple(replace(one, name=prefix + one.name, only=one.only and (prefix + one.only[0], one.only[1]))
                     for one in self.attributes)


def flat(declared: tuple[Attribute | Group, ...]) -> Iterator[Attribute]:
    """Yield all attributes of a declaration, those of its groups under their full names."""
    for one in declared:
        if isinstance(one, Group):
            for prefix in one.prefixes:
                yield from one.named(prefix)
        else:
            yield one
