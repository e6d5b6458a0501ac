"""Sea-Bird CNV: notes after * and #, of which ``# name k = short: Long name [unit]`` name the columns; ``*END*``; rows.

Of two sensors of a kind the first counts. Depths in fresh water are pressures times 1.019716 m/dbar, and temperatures
in IPTS-68 are 1.00024 times those in ITS-90 (Sea-Bird application notes 69 and 42).
"""
import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from . import fields
from .records import Samples

PSI = 0.6894757                     # [dbar]
# beginning of the long name, unit in brackets, quantity, factor
NAMES = (
    (r"pressure\b(?! temp)", r"db|dbar", "pressure", 1.0),
    (r"pressure\b(?! temp)", r"psi", "pressure", PSI),
    (r"depth\b", r"salt water, m", "depth", 1.0),
    (r"depth\b", r"fresh water, m", "pressure", 1 / 1.019716),
    (r"temperature\b", r"its-90, deg c", "temperature", 1.0),
    (r"temperature\b", r"i[pt]ts-68, deg c", "temperature", 1 / 1.00024),
    (r"conductivity\b", r"s/m", "conductivity", 10.0),
    (r"conductivity\b", r"ms/cm|mmho/cm", "conductivity", 1.0),
    (r"conductivity\b", r"us/cm|[\N{MICRO SIGN}\N{GREEK SMALL LETTER MU}]s/cm", "conductivity", 1e-3),
    (r"salinity\b", r"psu|pss-78|", "salinity", 1.0),
    (r"sound velocity\b", r"(?:.*, )?m/s", "sound speed", 1.0),
)
NAME = re.compile(r"#\s*name\s+(\d{1,4})\s*=\s*[^:]*:\s*([^\[]*?)\s*(?:\[(.*?)\])?\s*")
NOTE = re.compile(r"[*#\s]*(?:nmea\s+)?(latitude|longitude|start_time|bad_flag)\s*[:=]\s*(.+)", re.IGNORECASE)
CAST = re.compile(r"\*.*\bcast\s+\d+\s+(\d+ \w{3} \d{4} \d+:\d+:\d+)\s+samples\b")
NO_NUMBER = -9.990e-29


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    return content[0].lower().startswith("* sea-bird") or any(line.strip() == "*END*" for line in content)


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    end = next((k for k, line in enumerate(lines) if line.strip() == "*END*"), None)
    if end is None:
        raise ValueError("it has no line *END*, after which the samples come; the file was cut: copy it again.")
    notes, columns, flag = _header(lines[:end])
    rows = [(number, line.split()) for number, line in enumerate(lines[end + 1:], end + 2) if line.strip()]
    samples = fields.samples(rows, {**columns, **({} if flag is None else {"flag": flag})}, "recorded",
                             time=notes.get("time"), latitude=fields.position(notes.get("latitude", ""), "latitude"),
                             longitude=fields.position(notes.get("longitude", ""), "longitude"))
    return _unflagged(samples, columns, fields.number(notes.get("bad_flag", "")))


def _header(lines):
    """Return the notes, the columns with their factors, and the column of flags or None."""
    notes, columns, flag, named = {}, {}, None, []
    for line in lines:
        line = " ".join(line.split())
        name, note, cast = NAME.fullmatch(line), NOTE.match(line), CAST.match(line)
        if name:
            column, long, unit = int(name[1]), name[2].lower(), (name[3] or "").lower()
            named.append(f"{name[2]} [{name[3] or ''}]")
            flag = column if long == "flag" else flag
            for beginning, units, what, factor in NAMES:
                if re.match(beginning, long) and re.fullmatch(units, unit):
                    columns.setdefault(what, (column, factor))
        elif cast:
            notes["time"] = fields.instant(cast[1], "%d %b %Y %H:%M:%S")
        elif note:
            notes.setdefault(note[1].lower(), note[2])
    if "pressure" in columns:
        columns.pop("depth", None)                  # computed from the pressure, by an older formula
    if not fields.suffices(columns):
        raise ValueError(f"its columns are {fields.shown(', '.join(named)) or 'not named'}; it needs pressure or "
                         "depth, and sound velocity or temperature with salinity or conductivity, in metric units.")
    if notes.get("time") is None:
        # A remark in brackets may follow: the source of the time.
        start = " ".join(notes.get("start_time", "").partition("[")[0].split()[:4])
        notes["time"] = fields.instant(start, "%b %d %Y %H:%M:%S")
    return notes, columns, flag


def _unflagged(samples, columns, bad_flag):
    """Drop samples marked bad, in the column of flags or by a bad value in another column."""
    bad_flag = NO_NUMBER if np.isnan(bad_flag) else bad_flag
    values = {what: samples.columns[what] / factor for what, (_, factor) in columns.items()}
    bad = np.any([np.isclose(value, bad_flag, rtol=1e-6, atol=0) for value in values.values()], axis=0)
    if "flag" in samples.columns:
        bad |= samples.columns["flag"] != 0
    if bad.all():
        raise ValueError(f"all {bad.size} samples are marked bad; give a cast with good ones.")
    kept = samples.taking(~bad)
    return replace(kept, flagged=int(bad.sum()), columns={what: kept.columns[what] for what in columns})
