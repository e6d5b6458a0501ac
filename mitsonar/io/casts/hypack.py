"""HYPACK VEL: ``FTP NEW version latitude longitude hh:mm mm/dd/yyyy``, then depth and sound speed, in metric units."""
from collections.abc import Sequence

from . import fields
from .records import Samples


def recognises(content: Sequence[str]) -> bool:
    """Return True if the lines have this format."""
    return content[0].split()[:2] == ["FTP", "NEW"]


def read(lines: Sequence[str]) -> Samples:
    """Return the samples of the file."""
    (_, header), *rows = [(number, row.split()) for number, row in fields.rows_of(lines)]
    latitude, longitude, hour, day = (header[3:7] + [""] * 4)[:4]
    return fields.samples(rows, {"depth": 0, "sound speed": 1}, "processed",
                          time=fields.instant(f"{day} {hour}", "%m/%d/%Y %H:%M", "%m/%d/%Y %H:%M:%S"),
                          latitude=fields.position(latitude, "latitude"),
                          longitude=fields.position(longitude, "longitude"))
