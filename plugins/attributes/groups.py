"""Groups of attributes that several plugins declare, and the way through a whole declaration."""
from collections.abc import Iterator
from dataclasses import dataclass, replace

from .declaration import Attribute


@dataclass(frozen=True, kw_only=True)
class Group:
    """Attributes that several plugins share, or one has several times under names that begin differently."""

    title: str  # of the chapter that the reference page has for them
    module: str  # of the package, whose text that chapter begins with
    attributes: tuple[Attribute, ...]
    prefixes: tuple[str, ...] = ("",)  # what stands in front of every name

    def named(self, prefix: str) -> tuple[Attribute, ...]:
        """The attributes under their whole names."""
        return tuple(replace(one, name=prefix + one.name, only=one.only and (prefix + one.only[0], one.only[1]))
                     for one in self.attributes)


def flat(declared: tuple[Attribute | Group, ...]) -> Iterator[Attribute]:
    """Go through all attributes of a declaration, those of its groups under their whole names."""
    for one in declared:
        if isinstance(one, Group):
            for prefix in one.prefixes:
                yield from one.named(prefix)
        else:
            yield one
