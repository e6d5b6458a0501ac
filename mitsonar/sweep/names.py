"""Names of a sweep's renders from a pattern such as ``{index:04}_{range}.exr``."""
import itertools
import os
import re
import string
from collections.abc import Iterable, Mapping

from .products import SAMPLE, SUFFIXES
from .values import shortened

SPEC = re.compile(r"0?\d{0,2}(\.\d{1,2})?[defg]?")           # excludes huge widths
NUMBER = re.compile(r"0?\d*d?")
UNFIT = re.compile(r"[^\w.+=,-]+")                           # not allowed in a value; only the pattern may make folders
FOLDERS = re.compile(r"[^,]*/")                              # of a file, or of each of several
LONGEST = 200                                                # bytes of a part; temporary names are longer
LONGEST_KEY = 64                   # bytes; names in a tar take 100, with turn, tile and ending such as .bed_shadow.png


class Pattern:
    """Pattern of names, and the parameters it uses."""

    def __init__(self, text: str, known: Iterable[str], paths: Iterable[str] = (),
                 own: Mapping[str, tuple[str, ...]] | None = None):
        self.own = {**(own or {})}                     # fields of the plan, and the texts that they may have
        known = {"index", "seed", *self.own, *known}
        if not isinstance(text, str) or len(text) > 500 or any(ord(letter) < 32 for letter in text) or "\\" in text:
            raise ValueError(f"output is {shortened(text)}; give a pattern of names, such as \"{{index:04}}.exr\"")
        try:
            self.parts = list(string.Formatter().parse(text))
        except ValueError as error:
            raise ValueError(f"output is {shortened(text)}: {error}; give a pattern such as "
                             "\"{index:04}.exr\"") from None
        for _, field, spec, conversion in self.parts:
            if field is not None and (field not in known or conversion):
                raise ValueError(f"output has the field {shortened(field)}; known: {', '.join(sorted(known))}")
            if spec and not SPEC.fullmatch(spec):
                raise ValueError(f"output has the field {field} with the format {shortened(spec)}; give one such as "
                                 "04, .1f or g")
        names = text.split("/")
        self.suffix = os.path.splitext(text)[1].lower()
        if self.suffix not in SUFFIXES or text.startswith("/") or not all(names):
            raise ValueError(f"output is {shortened(text)}; give names that end in .exr, for samples in .tar, or for "
                             f"soundings in {', '.join(SUFFIXES[2:])}, inside the sweep's folder")
        if any(name.startswith(".") for name in names):
            raise ValueError(f"output is {shortened(text)}; give names that do not begin with a dot")
        self.text, self.paths = text, frozenset(paths)
        self.parameters = {field for _, field, *_ in self.parts if field is not None} - {"index", "seed",
                                                                                                   *self.own}

    def numbered(self) -> bool:
        """Return True if the index makes names unique: no digit can follow, and it comes first, or last in a folder."""
        for number, (before, field, spec, _) in enumerate(self.parts):
            if field == "index":
                after, later, *_ = (*self.parts[number + 1:], ("", None))[0]
                return ((not number and not before or before.endswith("/") and later is None)
                        and NUMBER.fullmatch(spec or "") is not None and after[:1] not in (*string.digits, ""))
        return False

    def folders(self) -> set[str] | None:
        """Return the folders of all names, or None if parameters or numbers are part of them."""
        parts = list(string.Formatter().parse(self.text.rpartition("/")[0]))
        if not {field for _, field, *_ in parts if field is not None} <= self.own.keys():
            return None
        fields = {field: self.own[field] for _, field, *_ in parts if field is not None}
        return {"".join(literal + (_written(field, chosen[field], spec) if field is not None else "")
                        for literal, field, spec, _ in parts)
                for values in itertools.product(*fields.values()) for chosen in [dict(zip(fields, values))]}

    def name(self, index: int, seed: int, parameters: Mapping[str, object]) -> str:
        """Return the name of a render."""
        values = {**parameters, "index": index, "seed": seed}
        values |= {name: FOLDERS.sub("", values[name]) for name in self.parameters & self.paths
                   if isinstance(values[name], str)}
        name = "".join(literal + ("" if field is None else _written(field, values[field], spec))
                       for literal, field, spec, _ in self.parts)
        for part in name.split("/"):
            if part.startswith(".") or not part.strip() or len(os.fsencode(part)) > LONGEST:
                raise ValueError(f"the output pattern {shortened(self.text)} makes the name {shortened(name)} of "
                                 f"render {index}; give one that makes visible names of at most {LONGEST} bytes")
        if self.suffix == SAMPLE and len(os.fsencode(name)) - len(SAMPLE) > LONGEST_KEY:
            raise ValueError(f"the output pattern {shortened(self.text)} makes the name {shortened(name)} of render "
                             f"{index}, which is too long for files in a tar; give one that makes names of at most "
                             f"{LONGEST_KEY} bytes before .tar, with folders")
        return name


def _written(field, value, spec):
    if isinstance(value, tuple):
        value = ",".join(map(str, value))
    elif isinstance(value, bool):
        value = str(value).lower()
    try:
        return UNFIT.sub("_", format(value, spec))
    except ValueError:
        raise ValueError(f"output has the field {field} with the format {spec}, which does not fit its value "
                         f"{shortened(value)}") from None
