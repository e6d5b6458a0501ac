"""A line of soundings as a Generic Sensor Format file, version 03.09; see `gsf_pings` for scales and signs."""
from __future__ import annotations

import struct

import numpy as np

from ..files import FilePath, replacing
from .gsf_pings import MOST_SECTORS, SCALES, swath
from .gsf_records import MOST_RECEIVERS, File, attitudes, cast, comments, parameters
from .held import SOUNDINGS
from .lines import Blocks, Place, Written, left_out, line_of, lost, pings
from .passage import passage_of

__all__ = ["write"]


def write(blocks: Blocks, path: FilePath, *, place: Place | None = None, start: str | None = None) -> Written:
    """Write a line of soundings as GSF; arguments, result and errors as `mitsonar.io.survey_lines.write`.

    A ping may also not fit into a record.
    """
    line, some = line_of(blocks, place=place, start=start)
    passage = passage_of(line)
    number = soundings = empty = 0
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    time = passage.time[0]
    with replacing(path) as temporary, open(temporary, "wb") as stream:
        file = File(stream)
        for comment in comments(line, passage):
            file.write_comment(comment)
        file.write_processing_parameters(parameters(line, passage))
        file.write_sound_velocity_profile(cast(line, passage))
        for attitude in attitudes(passage):
            file.write_attitude(attitude)
        for block in some:
            for ping in pings(line, block):
                if not ping["valid"].size:
                    empty += 1
                    continue
                _add(file, swath(line, passage, ping, number), number)
                found = np.stack([ping["latitude"], ping["longitude"], ping["depth"]])[:, ping["valid"]]
                low = np.minimum(low, found.min(1, initial=np.inf))
                high = np.maximum(high, found.max(1, initial=-np.inf))
                number, soundings, time = number + 1, soundings + found.shape[1], float(ping["since"])
        if soundings:
            file.write_swath_bathy_summary({
                "StartTime": line.start + float(line.first["ping_time"][0]), "EndTime": time,
                "MinLatitude_deg": low[0], "MinLongitude_deg": low[1], "MinDepth_m": low[2],
                "MaxLatitude_deg": high[0], "MaxLongitude_deg": high[1], "MaxDepth_m": high[2]})
    return Written(pings=number, soundings=soundings, words=_words(line, empty))


def _add(file, record, number):
    try:
        file.write_swath_bathymetry_ping(record, SCALES)
    except (struct.error, OverflowError, ValueError) as error:
        raise ValueError(f"ping {number} does not go into a GSF record: {error}; check its values, or write a "
                         ".nc.") from None


def _words(line, empty):
    few = len(line.receivers[0]) <= MOST_RECEIVERS
    out = lost(line, SOUNDINGS | ({"head_receive_offset", "head_receive_mounting"} if few else set()))
    sectors = line.first.sizes["transmission"]
    return tuple(text for text in (
        line.placed, left_out(empty),
        f"GSF has no room for {', '.join(out)}: write a .nc to keep them" if out else "",
        f"GSF lists {MOST_SECTORS} sectors of the {sectors}" if sectors > MOST_SECTORS else "",
        "snippets lack snippet_rate, so GSF holds none" if "snippet_db" in line.first
        and "snippet_rate" not in line.first else "") if text)
