"""Kongsberg ASVP: one line in brackets, ``( SoundVelocity version id time latitude longitude radius from to source
history count )``, then depth and sound speed. Time is YYYYMMDDhhmm, newer YYYYMMDDhhmmss.
"""
import re
from collections.abc import Sequence

from . import fields
from .records import Samples


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    return re.match(r"\s*\(\s*soundvelocity\b", content[0], re.IGNORECASE) is not None


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    (_, header), *rows = [(number, row.split()) for number, row in fields.rows_of(lines)]
    ended, header = header[-1] == ")", [word for word in header if word not in "()"]
    if ended and re.fullmatch(r"[0-9]{1,9}", header[-1]) and len(rows) < int(header[-1]):
        raise ValueError(f"its header counts {int(header[-1])} samples, but {len(rows)} follow; the file was cut: "
                         "copy it again.")
    time, latitude, longitude = (header[3:6] + [""] * 3)[:3]
    return fields.samples(rows, {"depth": 0, "sound speed": 1}, "processed",
                          time=fields.instant(time, "%Y%m%d%H%M%S" if len(time) > 12 else "%Y%m%d%H%M"),
                          latitude=fields.position(latitude, "latitude"),
                          longitude=fields.position(longitude, "longitude"))
