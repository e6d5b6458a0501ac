"""AML: sections of ``name=value``, from ``[cast header]`` to ``[data]``, newer ``[Header]`` to ``[MeasurementData]``.

Columns are named by a line of titles at the head of the data, or by ``Columns=`` and ``Units=``. Without either, the
settings of the instrument determine them: date and time, then the sensors slot by slot (``CT.X C SN ... T SN``
is conductivity [mS/cm] and temperature, ``P.X`` pressure [dbar], ``SV.X`` sound speed), then battery, salinity,
density and sound speed, each if it was displayed. Salinity must then agree with conductivity, temperature and pressure;
otherwise the columns were not recognised correctly.
"""
import re
from collections.abc import Sequence

import gsw
import numpy as np

from . import fields
from .records import Samples

SENSORS = {"CT": ("conductivity", "temperature"), "C": ("conductivity",), "T": ("temperature",), "P": ("pressure",),
           "SV": ("sound speed",)}
SHOWN = {"displaydate": ("date",), "displaytime": ("time",)}
COMPUTED = {"displaybattery": ("battery",), "displaysalinity": ("salinity",), "displaydensity": ("density",),
            "displaysoundvelocity": ("sound speed",)}
SALINITIES_AGREE = 0.5


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    first = content[0].strip().lower()
    return first in ("[cast header]", "[header]", "[instrument]") or (
        first.startswith("[") and any(_begins_data(line) for line in content))


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    start = next((k for k, line in enumerate(lines) if _begins_data(line)), None)
    if start is None:
        raise ValueError("it has no section [data]; the file was cut: copy it again.")
    notes = _notes(lines[:start])
    rows = []
    for number, line in enumerate(lines[start + 1:], start + 2):
        if line.lstrip().startswith("["):
            break
        if line.strip():
            rows.append((number, [field.strip() for field in line.split(",")]))
    columns, rows = _columns(notes, rows, start + 1)
    latitude, longitude = (_first_position(notes, name) for name in ("latitude", "longitude"))
    if latitude == longitude == 0:                  # written by an instrument without a fix
        latitude = longitude = None
    date, time = notes.get("date", [""])[0], notes.get("time", [""])[0].partition(".")[0]
    samples = fields.samples(
        rows, columns, "recorded", time=fields.instant(f"{date} {time}", "%Y-%m-%d %H:%M:%S", "%m/%d/%y %H:%M:%S"),
        latitude=latitude, longitude=longitude)
    _check_salinity(samples.columns)
    return samples


def _begins_data(line):
    return line.strip().lower() in ("[data]", "[measurementdata]")


def _notes(lines):
    """Return all values of each name, in order, since sections repeat names."""
    notes = {}
    for line in lines:
        name, equals, value = line.partition("=")
        if equals:
            notes.setdefault(name.strip().lower(), []).append(value.strip())
    return notes


def _first_position(notes, name):
    positions = (fields.position(text, name) for text in (*notes.get(name, ()), *notes.get(f"gps{name}", ())))
    return next((value for value in positions if value is not None), None)


def _columns(notes, rows, line):
    """Return the columns, and the rows without a line of titles."""
    if "columns" in notes:
        names, units = (notes.get(key, [""])[0].split(",") for key in ("columns", "units"))
        titles = [f"{name} ({unit})" for name, unit in zip(names, units + [""] * len(names), strict=False)]
    elif rows and any(field[:1].isalpha() for field in rows[0][1]):
        (line, titles), *rows = rows
    else:
        return _columns_of_settings(notes, rows), rows
    titles = [re.sub(r"(?i)^temp(ct|sv)\b", "temperature", title) for title in titles]
    plain = {what for what, _ in map(fields.title, titles)}
    calculated = re.compile(r"(?i)^calc(ulated|\.)?\s*")
    titles = [title if "sound speed" in plain else calculated.sub("", title) for title in titles]
    return fields.titled(line, _each_once(titles)), rows


def _each_once(titles):
    """Blank the titles of second sensors, which an instrument may carry; doubled depths stay."""
    seen, kept = set(), []
    for title in titles:
        what, _ = fields.title(title)
        kept.append("" if what == "temperature" and what in seen else title)
        seen.add(what)
    return kept


def _columns_of_settings(notes, rows):
    order = [name for key, names in SHOWN.items() if notes.get(key, [""])[0].lower() == "yes" for name in names]
    for sensors in notes.get("sensorname", ()):
        for sensor in re.findall(r"\b(\w+)\.X\b", sensors):
            order += SENSORS.get(sensor, (sensor,))
    order += [name for key, names in COMPUTED.items() if notes.get(key, [""])[0].lower() == "yes" for name in names]
    width = len(rows[0][1]) if rows else len(order)
    columns = {what: order.index(what) for what in fields.QUANTITIES if what in order}
    if width != len(order) or not fields.suffices(columns):
        raise ValueError(f"its {width} columns have no titles, and the settings of the instrument name "
                         f"{fields.shown(', '.join(order)) or 'none'}; export the cast with the titles of columns.")
    return columns


def _check_salinity(columns):
    if not {"salinity", "conductivity", "temperature", "pressure"} <= set(columns):
        return
    with np.errstate(all="ignore"):                 # NaN for impossible water is refused below
        computed = gsw.SP_from_C(*(columns[what] for what in ("conductivity", "temperature", "pressure")))
    if not np.median(np.abs(computed - columns["salinity"])) < SALINITIES_AGREE:
        raise ValueError("its salinity is not that of its conductivity, temperature and pressure; check columns and "
                         "units, or export the cast with the titles of columns.")
