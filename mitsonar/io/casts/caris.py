"""CARIS SVP: sections, each with a line of time and place, then lines of depth and sound speed."""
import re
from collections.abc import Sequence

from . import fields
from .records import Samples


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    return content[0].strip().upper().startswith("[SVP_VERSION")


def read(lines: Sequence[str], section: int) -> Samples:
    """Return the samples of a section, from 0."""
    starts = [k for k, line in enumerate(lines) if line.lower().startswith("section")]
    if not 0 <= section < len(starts):
        raise ValueError(f"section {section} does not exist; the file holds {len(starts)}; count from 0.")
    start, end = starts[section], (*starts, len(lines))[section + 1]
    rows = [(number, line.split()) for number, line in enumerate(lines[start + 1:end], start + 2) if line.strip()]
    header = re.match(r"section\s+(\d{4}-\d{3}\s+\d+:\d+:\d+)\s+(\S+)\s+(\S+)", lines[start], re.IGNORECASE)
    where = {"time": fields.instant(header[1], "%Y-%j %H:%M:%S"), "latitude": fields.position(header[2], "latitude"),
             "longitude": fields.position(header[3], "longitude")} if header else {}
    return fields.samples(rows, {"depth": 0, "sound speed": 1}, "processed", sections=len(starts), **where)
