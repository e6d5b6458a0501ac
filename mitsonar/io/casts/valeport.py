"""Valeport MiniSVP: notes ``name: value``, the last ``Pressure units: m`` or ``dBar``, then rows of pressure,
temperature and sound speed as recorded, with the tare subtracted from the pressure. In air the sound speed is 0. In
dates the day comes before the month.
"""
from collections.abc import Sequence

from . import fields
from .records import Samples

UNITS = {"m": "depth", "dbar": "pressure"}


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    return any(line.lower().startswith(("minisvp:", "pressure units:")) for line in content[:20])


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    notes, rows = {}, []
    for number, line in enumerate(lines, 1):
        key, colon, value = line.partition(":")
        if "pressure units" in notes and line.strip():
            rows.append((number, line.replace(",", " ").split()))
        elif colon:
            notes[key.strip().lower()] = value.strip()
    if "pressure units" not in notes:
        raise ValueError("no line says 'Pressure units:', after which the samples come; the file was cut: copy it "
                         "again.")
    unit = notes["pressure units"].lower()
    if unit not in UNITS:
        raise ValueError(f"its pressure is in {fields.shown(notes['pressure units'])!r}; set the instrument to m or "
                         "dBar, or convert the cast.")
    return fields.samples(rows, {UNITS[unit]: 0, "temperature": 1, "sound speed": 2}, "recorded",
                          time=fields.instant(notes.get("now", ""), "%d/%m/%Y %H:%M:%S"),
                          latitude=fields.position(notes.get("latitude", ""), "latitude"),
                          longitude=fields.position(notes.get("longitude", ""), "longitude"))
