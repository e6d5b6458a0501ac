"""Read a plugin's attributes as its module declares them, for every plugin's constructor.

Mitsuba's ``mi.Properties`` checks neither type nor range: a word in the place of a number passes silently.
`Attributes` reads everything that is declared; any other input raises an error that names the plugin, the attribute,
the expected value and the one that was found::

    class Seabed(mi.Mesh):
        def __init__(self, props):
            attributes = Attributes(props, ATTRIBUTES)
            spacing, heading = attributes.spacing, attributes.slope_heading_deg         # [m], [rad]
            super().__init__("seabed", ..., props=props)
"""
from typing import Any

import mitsuba as mi
import numpy as np

from mitsonar.device.sentences import shortened
from mitsonar.device.spelling import meant

from .declaration import NESTED, REQUIRED, Attribute, FromTable, Nested, SameAs, Unfit
from .groups import Group, flat
from .numbers import Transform

# attributes of Mitsuba's own shapes, accepted beside the declared ones
OF_MITSUBA = ("to_world", "flip_normals", "face_normals", "silhouette_sampling_weight")
TAGS = {"Bool": "boolean", "Integer": "integer", "Float": "float", "Vector": "point", "Transform": "transform",
        "Color": "rgb", "Spectrum": "spectrum", "String": "string", "Any": "array"}


class Attributes:
    """Read and check the attributes of one plugin instance; each is an attribute of this object."""

    def __init__(self, props: mi.Properties, declared: tuple[Attribute | Group, ...]) -> None:
        self._props = props
        self._declared = {one.name: one for one in flat(declared) if not isinstance(one, Nested)}
        self._values: dict[str, Any] = {}
        for one in flat(declared):
            self._values[one.name] = self._nested(one) if isinstance(one, Nested) else self._read(one)
        self._refuse_unknown()

    def __getattr__(self, name: str) -> Any:
        """Return the value of an attribute: as written, or its default."""
        try:
            return self.__dict__["_values"][name]
        except KeyError:
            raise AttributeError(f"{name} is not declared") from None

    def given(self, *names: str) -> list[str]:
        """Return those of ``names`` that are written in the scene."""
        return [name for name in names if name in self._props]

    def error(self, sentence: str | Exception) -> ValueError:
        """Return a `ValueError` that names the plugin, for checks across attributes."""
        name = f' "{self._props.id()}"' if self._props.id() else ""
        return ValueError(shortened(f"{self._props.plugin_name()}{name}: {' '.join(str(sentence).split())}"))

    def only_one(self, *names: str) -> None:
        """Refuse more than one of ``names``."""
        if len(written := self.given(*names)) > 1:
            raise self.error(f"{' and '.join(written)} are given; give one of them.")

    def _read(self, one: Attribute) -> Any:
        name = next(iter(self.given(one.name, one.formerly)), None)
        if name == one.name and one.formerly in self._props:
            raise self.error(f"{one.formerly} is an earlier name of {one.name}, and both are given; leave it out.")
        if one.only is not None and self._values[one.only[0]] not in one.only[1]:
            if name is not None:
                raise self.error(self._without_effect(name, one.only))
            return None if one.default is REQUIRED else self._default(one)
        if name is None:
            return self._default(one)
        written_as = self._props.type(name).name
        try:
            if written_as not in one.types:
                raise Unfit
            return one.read(self._props[name], written_as)
        except Unfit as unfit:
            raise self.error(unfit.sentence or f"{name} is {unfit.got or self._got(name)}; expected "
                             f"{unfit.expected or one.expected}{unfit.hint}.") from None

    def _default(self, one: Attribute) -> Any:
        if one.default is REQUIRED:
            hint = meant(one.name, set(self._props.keys()) - set(self._declared))
            raise self.error(f"attribute {one.name} is missing{hint.replace('did you mean', 'is it written as')}; "
                             f"expected {one.expected}.")
        if isinstance(one, Transform):
            return np.eye(4)
        if isinstance(one.default, SameAs):
            return self._values[one.default.name]
        default = one.default
        if isinstance(default, FromTable):
            default = default.table[self._values[default.by]][one.name]
        return None if default is None else one.taken(default)

    def _without_effect(self, name: str, only: tuple[str, tuple[str, ...]]) -> str:
        """Return the error message for an attribute that has no effect with the value of another."""
        other, values = only
        takes = [one.name for one in self._declared.values() if one.only is not None and one.only[0] == other
                 and self._values[other] in one.only[1]]
        if takes:
            return (f'{name} is written, but {other} is "{self._values[other]}", which takes {", ".join(takes)}; leave '
                    f"it out or change {other}.")
        listed = " or ".join(f'"{value}"' for value in values)
        return f"{name} is given, but it only counts with {other} {listed}; leave it out."

    def _nested(self, one: Nested) -> Any:
        kind, found = getattr(mi, "BSDF" if one.name == "bsdf" else one.name.capitalize()), []
        for name in self._props.keys():
            if self._props.type(name).name in NESTED and (one.many or not found):
                queried = self._props.was_queried(name)
                if isinstance(value := self._props[name], kind):
                    found.append(one.read(value, name))
                else:
                    self._props.mark_queried(name, queried)    # left for whoever knows it, or for Mitsuba to report
        if not found and one.default is REQUIRED:
            raise self.error(f"a nested <{one.name}> is missing.")
        return found if one.many else found[0] if found else None

    def _refuse_unknown(self) -> None:
        """Refuse undeclared attributes; undeclared nested objects are left to the base class and to Mitsuba."""
        former = {one.formerly for one in self._declared.values()}
        for name in self._props.keys():
            if name in self._declared or name in former or name in OF_MITSUBA or self._props.type(name).name in NESTED:
                continue
            known = sorted(one.name for one in self._declared.values()
                           if one.only is None or self._values[one.only[0]] in one.only[1])
            raise self.error(f'got {self._got(name)} for the unknown attribute "{name}"{meant(name, self._declared)}. '
                             f"Known: {', '.join(known) or 'none'}.")

    def _got(self, name: str) -> str:
        kind = self._props.type(name).name
        if kind in NESTED:
            return "a nested object"
        if kind == "String":
            return f'the string "{self._props[name]}"'
        if kind in ("Bool", "Integer", "Float"):
            value = self._props[name]
            return f"the {TAGS[kind]} {str(value).lower() if kind == 'Bool' else value}"
        return f"a {TAGS.get(kind, kind.lower())}"
