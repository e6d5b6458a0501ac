"""CastAway CSV, the processed cast: notes after %, a header, then rows."""
import re
from collections.abc import Sequence

from . import fields
from .records import Samples

COLUMNS = {"depth": "Depth (Meter)", "sound speed": "Sound velocity (Meters per Second)",
           "temperature": "Temperature (Celsius)", "salinity": "Salinity (Practical Salinity Scale)"}


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    return re.match(r"%\s*device\s*,", content[0], re.IGNORECASE) is not None


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    notes, rows = {}, []
    for number, line in enumerate(lines, 1):
        if line.startswith("%"):
            key, _, value = line[1:].partition(",")
            notes[key.strip().lower()] = value.strip()
        elif line.strip():
            rows.append((number, line.split(",")))
    header = [column.strip() for column in rows[0][1]] if rows else []
    columns = {what: header.index(title) for what, title in COLUMNS.items() if title in header}
    for what in ("depth", "sound speed"):
        if what not in columns:
            raise ValueError(f"there is no column {COLUMNS[what]!r}; export the processed cast in metric units.")
        if header.count(COLUMNS[what]) > 1:
            raise ValueError(f"the column {COLUMNS[what]!r} is there twice; keep one of them.")
    time = fields.instant(notes.get("cast time (utc)", ""), "%Y-%m-%d %H:%M:%S", "%Y-%m-%dT%H:%M:%S")
    return fields.samples(
        rows[1:], columns, "processed", time=time,
        **{what: fields.position(notes.get(f"start {what}", ""), what) for what in ("latitude", "longitude")})
