"""Typed, checked reading of a plugin's attributes, for every plugin's constructor.

Mitsuba hands a plugin a dictionary-like ``mi.Properties`` and checks neither type nor range: a word where a number
belongs passes silently. `Attributes` reads one attribute a call, names it with its unit, and answers anything else
than what was expected by one sentence: which plugin, which attribute, what was expected, what was got::

    class Seabed(mi.Mesh):
        def __init__(self, props):
            attributes = Attributes(props)
            spacing = attributes.number("spacing", 0.5, unit="m", above=0)
            heading = attributes.angle("slope_heading_deg", 0)          # [rad]
            attributes.finish()                                         # anything else written is an error
            super().__init__("seabed", ..., props=props)
"""
import os
from typing import NamedTuple

import numpy as np

import mitsuba as mi
from mitsonar.io.errors import shortened
from mitsonar.spelling import meant
from mitsonar.units import radians_from_deg

REQUIRED = object()  # the default of an attribute that has none

_SHAPE_ATTRIBUTES = ("to_world", "flip_normals", "face_normals", "silhouette_sampling_weight")
_OBJECTS = ("Object", "Reference", "ResolvedReference")
_TAGS = {"Bool": "boolean", "Integer": "integer", "Float": "float", "Vector": "point", "Transform": "transform",
         "Color": "rgb", "Spectrum": "spectrum", "String": "string", "Any": "array"}


class Declared(NamedTuple):
    """What a plugin expects of an attribute, in words, and what it takes without one."""

    expected: str
    default: object


declared = {}  # by the plugin's name and the attribute's: every attribute that one of its kind has asked for


class Attributes:
    """Read and check the attributes of one plugin instance.

    Parameters
    ----------
    props : mi.Properties
        What Mitsuba hands to the plugin's constructor.

    Notes
    -----
    Every reader takes the attribute's name and its default; without a default the attribute must be written, with
    ``None`` it is optional. Bounds are inclusive (``minimum``, ``maximum``) or exclusive (``above``, ``below``).
    All raise `ValueError`; within an XML file Mitsuba adds file and line, see `mitsonar.plugins.errors.plain`.
    """

    def __init__(self, props):
        self.props = props
        self._asked = set()

    def given(self, *names):
        """Tell which of ``names`` are written in the scene, as a list."""
        return [name for name in names if name in self.props]

    def error(self, sentence):
        """Make (not raise) a `ValueError` that names the plugin, for checks across attributes."""
        name = f' "{self.props.id()}"' if self.props.id() else ""
        return ValueError(shortened(f"{self.props.plugin_name()}{name}: {' '.join(sentence.split())}"))

    def integer(self, name, default=REQUIRED, *, minimum=None, maximum=None, unit=None):
        """Read a whole number; a float is refused even where it is whole."""
        return self._scalar(name, default, int, "an integer", "Integer", unit, minimum=minimum, maximum=maximum)

    def number(self, name, default=REQUIRED, *, minimum=None, maximum=None, above=None, below=None, unit=None):
        """Read a finite number, written as a float or an integer."""
        return self._scalar(name, default, float, "a number", ("Float", "Integer"), unit,
                            minimum=minimum, above=above, maximum=maximum, below=below)

    def angle(self, name, default=REQUIRED, **bounds):
        """Read degrees, under a name that ends in ``_deg``, and give radians; default and bounds in degrees."""
        angle_deg = self.number(name, default, unit="degrees", **bounds)
        return None if angle_deg is None else float(radians_from_deg(angle_deg))

    def boolean(self, name, default=REQUIRED):
        """Read true or false."""
        return self._scalar(name, default, bool, "true or false", "Bool", None)

    def text(self, name, default=REQUIRED, *, choices=None):
        """Read a string, one of ``choices`` where these are given."""
        expected = "a string" if choices is None else "one of " + ", ".join(f'"{choice}"' for choice in choices)
        value = self._value(name, default, expected, "String")
        if choices is not None and value is not None and value not in choices:
            raise self._mismatch(name, expected, hint=meant(value, choices))
        return value

    def file(self, name, default=REQUIRED):
        """Read a file's name and give its path, looked for beside the scene file first; empty means not given."""
        expected = "the name of a file"
        value = self._value(name, default, expected, "String")
        if not value:
            if default is REQUIRED:
                raise self._mismatch(name, expected)
            return default
        path = str(mi.file_resolver().resolve(value))  # a name that is nowhere comes back unchanged
        if not os.path.isfile(path):
            if os.path.isdir(path):
                raise self.error(f'{name} names the folder "{value}"; give the name of a file.')
            if os.path.exists(path):
                raise self.error(f'{name} names "{value}", a device or a pipe; give the name of a file.')
            raise self.error(f'{name} names the file "{value}", which is not there; it is looked for beside the scene, '
                             "then where you are.")
        if not os.access(path, os.R_OK):
            raise self.error(f'{name} names the file "{path}", which you may not read; change its permissions.')
        return path

    def point(self, name, default=REQUIRED, *, unit="m"):
        """Read a point or vector as a float64 array (3,)."""
        value = self._value(name, default, f"a point{_in(unit)}", "Vector")
        return None if value is None else np.array(value, dtype=np.float64)

    def matrix(self, name="to_world"):
        """Read a transform as a float64 matrix (4, 4); the identity where none is written."""
        value = self._value(name, None, "a transform", "Transform")
        return np.eye(4) if value is None else np.array(value.matrix, dtype=np.float64)

    def numbers(self, name, default=REQUIRED, *, count=None, unit=None):
        """Read a list of finite numbers written in a string, such as "1, 2, 3e2"; empty means not given."""
        expected = f"{'a list of' if count is None else count} numbers{_in(unit)} separated by commas"
        value = self._value(name, default, expected, ("String", "Float", "Integer"))
        if isinstance(value, str):
            if not value.strip():
                if default is REQUIRED:
                    raise self._mismatch(name, expected)
                return default
            try:
                value = [float(word) for word in value.replace(",", " ").split()]
            except ValueError:
                raise self._mismatch(name, expected) from None
        elif value is None or value is default:
            return value
        array = np.atleast_1d(np.asarray(value, dtype=np.float64))
        if not np.isfinite(array).all() or (count is not None and array.size != count):
            raise self._mismatch(name, expected)
        return array

    def table(self, name, default=REQUIRED, *, expected='a table of finite numbers "0:1490.5, 10:1485"'):
        """Read a table such as <spectrum name=... value="0:1490.5, 10:1485"/> as two float64 arrays."""
        value = self._value(name, default, expected, ("Spectrum", "String"))
        if isinstance(value, str):
            try:
                pairs = [[float(word) for word in pair.split(":")] for pair in value.split(",")]
                columns = [np.array(column, dtype=np.float64) for column in zip(*pairs, strict=True)]
            except ValueError:
                raise self._mismatch(name, expected) from None
        elif value is None or value is default:
            return value
        else:
            columns = [np.array(column, dtype=np.float64) for column in (value.wavelengths, value.values)]
        if len(columns) != 2 or columns[0].size == 0 or not np.isfinite(columns).all():
            raise self._mismatch(name, expected)
        return tuple(columns)

    def number_or_table(self, name, default=REQUIRED, *, unit=None):
        """Read a number, or a table as `table` does, as two float64 arrays; of a number, at 0."""
        if name in self.props and self.props.type(name).name in ("Float", "Integer"):
            return np.zeros(1), np.array([self.number(name, unit=unit)])
        return self.table(name, default, expected=f'a number or a table of finite numbers "0:-60, 10:-75"{_in(unit)}')

    def texture(self, name, default=REQUIRED):
        """Read a number or a texture as a Mitsuba texture."""
        expected = "a number or a texture"
        if self._value(name, default, expected, ("Float", "Integer", "Spectrum", "Color", *_OBJECTS)) is None:
            return None
        try:
            return self.props.get_texture(name) if name in self.props else self.props.get_texture(name, default)
        except RuntimeError:
            raise self._mismatch(name, expected) from None

    def number_or_texture(self, name, default=REQUIRED, **bounds):
        """Read a finite number within bounds as a float, or a nested texture as it is."""
        self._declare(name, f"a number{_in(bounds.get('unit'))} or a texture", default)
        if name not in self.props or self.props.type(name).name not in _OBJECTS:
            return self.number(name, default, **bounds)
        self._asked.add(name)
        if not isinstance(self.props[name], mi.Texture):
            raise self._mismatch(name, "a number or a texture")
        return self.props[name]

    def object(self, kind, default=REQUIRED):
        """Read the first nested object of a Mitsuba class such as ``mi.Medium``, whatever its name."""
        found = self.objects(kind, most=1)
        if not found and default is REQUIRED:
            raise self.error(f"a nested <{kind.__name__.lower()}> is missing.")
        return found[0] if found else default

    def objects(self, kind, *, most=None):
        """Read the nested objects of a Mitsuba class, all or the first ``most``, as a list."""
        found = []
        for name in self.props.keys():
            if self.props.type(name).name in _OBJECTS and len(found) != most:
                queried = self.props.was_queried(name)
                if isinstance(value := self.props[name], kind):
                    found.append(value)
                else:
                    self.props.mark_queried(name, queried)  # left for whoever knows it, or for Mitsuba to report
        return found

    def finish(self, *also):
        """Refuse every attribute that no call asked for, except ``also`` and those of Mitsuba's own shapes.

        Nested objects are left alone: the base class takes those it knows, Mitsuba itself reports the others.
        """
        known = sorted({*self._asked, *also})
        for name in self.props.keys():
            if name in known or name in _SHAPE_ATTRIBUTES or self.props.type(name).name in _OBJECTS:
                continue
            raise self.error(f'got {self._got(name)} for the unknown attribute "{name}"{meant(name, known)}. '
                             f"Known: {', '.join(known) or 'none'}.")

    def _value(self, name, default, expected, types):
        self._asked.add(name)
        self._declare(name, expected, default)
        if name not in self.props:
            if default is REQUIRED:
                hint = meant(name, set(self.props.keys()) - self._asked).replace("did you mean", "is it written as")
                raise self.error(f"attribute {name} is missing{hint}; expected {expected}.")
            return default
        if self.props.type(name).name not in (types if isinstance(types, tuple) else (types,)):
            raise self._mismatch(name, expected)
        return self.props[name]

    def _declare(self, name, expected, default):
        declared.setdefault(self.props.plugin_name(), {}).setdefault(name, Declared(expected, default))

    def _scalar(self, name, default, convert, noun, types, unit, **bounds):
        expected = f"{noun}{_in(unit)}{_between(bounds)}"
        value = self._value(name, default, expected, types)
        if value is None:
            return None
        if not np.isfinite(value) or any(bound is not None and not _HOLDS[key](value, bound)
                                         for key, bound in bounds.items()):
            raise self._mismatch(name, expected)
        return convert(value)

    def _mismatch(self, name, expected, hint=""):
        return self.error(f"{name} is {self._got(name)}; expected {expected}{hint}.")

    def _got(self, name):
        kind = self.props.type(name).name
        if kind in _OBJECTS:
            return "a nested object"
        if kind == "String":
            return f'the string "{self.props[name]}"'
        if kind in ("Bool", "Integer", "Float"):
            value = self.props[name]
            return f"the {_TAGS[kind]} {str(value).lower() if kind == 'Bool' else value}"
        return f"a {_TAGS.get(kind, kind.lower())}"


_HOLDS = {"minimum": lambda value, bound: value >= bound, "maximum": lambda value, bound: value <= bound,
          "above": lambda value, bound: value > bound, "below": lambda value, bound: value < bound}
_WORDS = {"minimum": "at least", "maximum": "at most", "above": "above", "below": "below"}


def _in(unit):
    return f" [{unit}]" if unit else ""


def _between(bounds):
    said = [f"{_WORDS[key]} {bound}" for key, bound in bounds.items() if bound is not None]
    return f" {' and '.join(said)}" if said else ""
