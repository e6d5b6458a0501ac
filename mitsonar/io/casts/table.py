"""Plain table of depth and sound speed, or of quantities that determine it, with or without a header."""
from collections.abc import Sequence

from . import fields
from .records import Samples


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    first, second = (_split(line) for line in (*content, "")[:2])
    named = {what for what, _ in map(fields.title, first)}
    return _numeric(first) or (_numeric(second) and len(first) == len(second)) or fields.suffices(named)


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    rows = [(number, _split(row)) for number, row in fields.rows_of(lines)]
    (number, first), columns = rows[0], {"depth": 0, "sound speed": 1}
    if not _numeric(first):
        rows, columns = rows[1:], fields.titled(number, first)
        for needless, given in (("pressure", "depth"), ("conductivity", "salinity")):
            if given in columns:
                columns.pop(needless, None)
    elif len(first) > 2:
        raise ValueError(f"line {number} has {len(first)} columns and no header names them; give a header with the "
                         "names depth and sound_speed.")
    return fields.samples(rows, columns, "ordered")


def _split(line):
    """Split a row at semicolons (a comma is then a decimal point), else at commas, else at tabs or spaces."""
    line = line.partition("#")[0].strip().rstrip(",;")
    if ";" in line:
        return [field.strip() for field in line.replace(",", ".").split(";")]
    return [field.strip() for field in line.split(",")] if "," in line else line.split()


def _numeric(row):
    try:
        return len([float(field) for field in row]) >= 2
    except ValueError:
        return False
