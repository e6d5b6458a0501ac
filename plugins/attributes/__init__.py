"""Attributes of plugins: each module declares the attributes of its plugin once, in a tuple called ``ATTRIBUTES``.

`Attributes` reads a scene by that tuple. Error messages, ``mitsonar describe``, the reference page
(`mitsonar.plugins.page`) and the input files of a sweep use it too::

    ATTRIBUTES = (
        Number("range", default=100.0, above=0, maximum=100_000, unit="m", text="end of the slant range window"),
        File("cast", default=None, text="file of a cast"),
    )

An attribute without a default is required; one with the default None is optional. ``otherwise`` describes the default
in words where its value does not. Texts are Markdown, without a full stop at their end.
"""
from .declaration import REQUIRED, Attribute, FromTable, Nested, SameAs, Unfit
from .groups import Group, flat
from .numbers import Angle, Integer, Number, Numbers, Point, Range, Transform
from .reading import Attributes
from .tables import NumberOrTable, NumberOrTexture, Table
from .words import Boolean, Choice, File, FileOrFolder, Files, Preset, Text, TextOrFile

__all__ = ["REQUIRED", "Angle", "Attribute", "Attributes", "Boolean", "Choice", "File", "FileOrFolder", "Files",
           "FromTable", "Group", "Integer", "Nested", "Number", "NumberOrTable", "NumberOrTexture", "Numbers", "Point",
           "Preset", "Range", "SameAs", "Table", "Text", "TextOrFile", "Transform", "Unfit", "flat"]
