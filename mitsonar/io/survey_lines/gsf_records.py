"""GSF records that are not of pings: parameters, casts, attitudes, comments, the summary.

As the Generic Sensor Format specification 03.06 (Leidos, 2014) has them. Its records are multiples of four bytes long
and 512 KiB at most; angles of records are hundredths of degrees, heave and offsets hundredths of metres.
"""
from __future__ import annotations

from collections.abc import Iterator
from typing import IO, Any

import numpy as np
from GSFU.gsfu import GSF_MAX_RECORD_SIZE, gsf

from ...units import deg_from_radians
from .lines import Line
from .passage import Passage

__all__ = ["MOST_RECEIVERS", "VERSION", "File", "attitudes", "cast", "comments", "order_of", "parameters"]

VERSION = "GSF-v03.09"
ATTITUDE_SECONDS = 10.0                    # of an attitude record; it takes 65 at most
NOT_APPLIED = ("DRAFT", "PITCH", "ROLL", "GYRO")
MOST_RECEIVERS = 2
OFFSETS = ("POSITION", "ANTENNA", "MRU", "CENTER_OF_ROTATION", "DEPTH_SENSOR")


class File(gsf):
    """A GSF file that is being written to an open stream."""

    def __init__(self, stream: IO[bytes]) -> None:
        super().__init__()
        self.FID = stream
        self.write_header({"Version": VERSION})

    def write_record(self, record_id: Any, payload: bytes, checksum: bool = False) -> None:
        """Append a record, padded to four bytes.

        Raises
        ------
        ValueError
            If it is larger than records may be.
        """
        padded = payload + bytes(-len(payload) % 4)
        if len(padded) + 8 > GSF_MAX_RECORD_SIZE:
            raise ValueError(f"a ping takes {len(padded)} bytes, more than the {GSF_MAX_RECORD_SIZE} of a GSF record; "
                             "give the line without snippets, or write a .kmall.")
        super().write_record(record_id, padded, checksum)


def order_of(line: Line) -> np.ndarray:
    """Return the numbers (R,) of the receive arrays from port to starboard, as GSF lists them, two at most."""
    return np.argsort(line.receivers[0][:, 1], kind="stable")[:MOST_RECEIVERS]


def parameters(line: Line, passage: Passage) -> dict[str, Any]:
    """Give the processing parameters: what has been applied, and that nothing is left to apply."""
    zero, none = "+0.000", "+0.000,+0.000,+0.000"
    values = {"REFERENCE TIME": "1970/001 00:00:00", "PLATFORM_TYPE": "SURFACE_SHIP", "FULL_RAW_DATA": "TRUE",
              "ROLL_COMPENSATED": "YES", "PITCH_COMPENSATED": "YES", "HEAVE_COMPENSATED": "YES",
              "TIDE_COMPENSATED": "NO", "NUMBER_OF_RECEIVERS": f"{len(order_of(line))}", "NUMBER_OF_TRANSMITTERS": "1",
              "DEPTH_CALCULATION": "CORRECTED", "RAY_TRACING": "YES", "MSB_APPLIED_TO_ATTITUDE": "NO",
              "HEAVE_REMOVED_FROM_GPS_TC": "NO", "UTC_OFFSET": "0", "ROLL_REFERENCE": "ROTATED"}
    values |= {f"{name}_TO_APPLY": zero for name in NOT_APPLIED}
    values |= {f"{name}_OFFSET_TO_APPLY": none for name in (*OFFSETS, "TRANSDUCER", "RX_TRANSDUCER")}
    values |= {"APPLIED_DRAFT": f"{passage.draught:+.3f}"}
    values |= {f"APPLIED_{name}_OFFSET": none for name in OFFSETS}
    sending = line.array("transmit_offset")[None], line.array("transmit_mounting")[None]
    for prefix, (offsets, turned) in (("", sending), ("RX_", tuple(one[order_of(line)] for one in line.receivers))):
        values[f"APPLIED_{prefix}TRANSDUCER_OFFSET"] = _words(offsets)
        values |= {f"APPLIED_{prefix}TRANSDUCER_{name}_OFFSET": _words(deg_from_radians(angle))
                   for name, angle in zip(("ROLL", "PITCH", "HEADING"), turned.T)}
    values |= {f"APPLIED_{name}_LATENCY": zero for name in ("POSITION", "ATTITUDE", "DEPTH_SENSOR")}
    values |= {"GEOID": "WGS-84", "TIDAL_DATUM": "UNKNOWN"}
    return {"ParamTime": passage.time[0], "Parameters": values}


def _words(numbers: np.ndarray) -> str:
    """Write the numbers of one array after the other."""
    return ",".join(f"{value:+.4f}" for value in np.ravel(numbers))


def cast(line: Line, passage: Passage) -> dict[str, Any]:
    """Give the sound-velocity profile."""
    return {"ObservationTime": passage.time[0], "ApplicationTime": passage.time[0],
            "Latitude_deg": float(passage.latitude[0]), "Longitude_deg": float(passage.longitude[0]),
            "Depth_m": np.maximum(line.array("cast_depth"), 0.0), "SoundSpeed_mPerSec": line.array("cast_sound_speed")}


def attitudes(passage: Passage) -> Iterator[dict[str, Any]]:
    """Give the attitude records, each of ten seconds."""
    number = np.floor((passage.time - passage.time[0]) / ATTITUDE_SECONDS)
    nanoseconds = np.rint(passage.time * 1e9).astype("int64").view("datetime64[ns]")
    for one in np.unique(number):
        some = number == one
        yield {"Time": nanoseconds[some], "Pitch_deg": deg_from_radians(passage.pitch[some]),
               "Roll_deg": deg_from_radians(passage.roll[some]), "Heave_m": passage.heave[some],
               "Heading_deg": deg_from_radians(passage.heading[some]) % 360.0}


def comments(line: Line, passage: Passage) -> Iterator[dict[str, Any]]:
    """Give the comments: where the line comes from, and what its numbers mean where the format leaves it open."""
    for text in (line.provenance(), line.placed,
                 "depths are below the still surface, across and along track about the reference point; heave is "
                 "positive upwards; beam angles are from the vertical, beam angles forward counterclockwise from "
                 "starboard; quality factor is log10 of depth over its spread; detection info 0 none, 1 amplitude, "
                 "2 phase; mean calibrated amplitude is bottom backscattering strength; intensity series are the same, "
                 "(value - 20000) / 100 dB, 0 for none"):
        if text:
            plain = text.replace("µ", "u").encode("ascii", "replace").decode("ascii")
            yield {"CommentTime": passage.time[0], "Comment": plain + "\0"}
