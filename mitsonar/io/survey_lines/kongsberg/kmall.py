"""A line of soundings as Kongsberg's KMALL, the water column in the same file.

Installation, settings and cast come first, then motion (#SKM), positions (#SPO), the head's sound speed (#SVT), pings
(#MRZ) and their water column (#MWC) in the order of time. See `kmall_pings` and `column` for signs and steps.
"""
from __future__ import annotations

import struct

from mitsonar.device.files import FilePath, replacing

from ..lines import COLUMN, SOUNDINGS, Blocks, Place, Written, left_out, line_of, lost, pings, rated
from ..passage import passage_of
from .column import column_of, offset_of, water_column
from .kmall_pings import soundings
from .kmall_sensors import MODEL, head_speed, installation, model, profile, sensors, settings

__all__ = ["write"]

HELD = (SOUNDINGS - {"transmit_angle"}) | COLUMN | {"head_receive_offset", "head_receive_mounting"}


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as KMALL; arguments, result and errors as `mitsonar.io.survey_lines.write`.

    A ping may also not fit into a datagram.
    """
    line, some = line_of(blocks, place=place, start=start)
    passage, sounder, offset = passage_of(line), model(line), None
    waiting = sensors(line, passage)
    due = next(waiting, None)
    number = found = empty = louder = quieter = 0
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        for datagram in (installation, settings, profile):
            stream.write(datagram(line, passage))
        for ping, rate in rated(ping for block in some for ping in pings(line, block)):
            while due is not None and due[0] <= ping["since"]:
                stream.write(due[1])
                due = next(waiting, None)
            if not ping["valid"].size:
                empty += 1
                continue
            offset = offset_of(ping) if offset is None else offset
            try:
                column = column_of(line, ping, offset)
                stream.write(head_speed(line, ping))
                soundings(stream, line, ping, number, sounder, column, rate)
                if column is not None and offset is not None:
                    stream.write(water_column(line, passage, ping, number, sounder, column, offset=offset))
                    louder, quieter = louder + column.outside[0], quieter + column.outside[1]
            except (struct.error, OverflowError) as error:
                raise ValueError(f"ping {number} does not go into a KMALL datagram: {error}; check its values, or "
                                 "write a .nc.") from None
            number, found = number + 1, found + int(ping["valid"].sum())
        while due is not None:
            stream.write(due[1])
            due = next(waiting, None)
    return Written(pings=number, soundings=found, words=(
        *_words(line, sounder, empty), *_steps(offset, louder, quieter)))


def _words(line, sounder, empty):
    out = lost(line, HELD)
    return tuple(text for text in (
        line.placed, left_out(empty),
        f"KMALL has no room for {', '.join(out)}: write a .nc to keep them" if out else "",
        f"KMALL knows Kongsberg's sounders only, so it says EM {MODEL}" if f"{sounder}" not in line.sonar else "",
        "snippets lack snippet_rate, so KMALL holds none" if "snippet_db" in line.first
        and "snippet_rate" not in line.first else "") if text)


def _steps(offset, louder, quieter):
    if offset is None:
        return ()
    outside = f", {louder} samples are louder and {quieter} quieter" if louder or quieter else ""
    return (f"the water column is in steps of 0.5 dB from {-64 - offset} to {63.5 - offset:g} dB{outside}",)
