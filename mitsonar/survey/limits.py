"""Limits of a survey, checked before it begins: the machine's memory, and sums that would take hours."""
from __future__ import annotations

from typing import TYPE_CHECKING

from mitsonar.device.machine import memory
from mitsonar.signal.gates import speckle_gates

if TYPE_CHECKING:
    from .energy.sidescan_survey import SidescanSurvey
    from .pressure.array_survey import ArraySurvey

BYTES_PER_BIN = 90                 # record while it is made and written, all variables together
BYTES_PER_LABEL = 13               # and for each shape's share of a bin
BYTES_PER_SUM = 72                 # each bin and shape of a fan's ping, while its truth is computed
BYTES_PER_PATH = 12                # each path of a bin, where there is more than one
BYTES_PER_SOUNDING = 130           # sounding with its phases and errors
BYTES_PER_SAMPLE = 60              # sample of a beam, while a ping's soundings are made
BINS_PER_PULSE = 10_000
MOST_GATES = 1 << 19               # gates of speckle to the end of the range; float32 counts up to 2^24


def check_sidescan(survey: SidescanSurvey) -> None:
    """Refuse a sidescan's survey that is too large."""
    pings, bins, paths = survey.track.pings, survey.bins, len(survey.paths)
    bin_length, pulse_length = survey.bin_length, survey.sonar.pulse_length
    if pulse_length > BINS_PER_PULSE * bin_length:
        raise ValueError(f"the film's bins last {1e6 * bin_length:.3g} µs and the pulse {1e6 * pulse_length:.3g} µs, "
                         f"more than {BINS_PER_PULSE} bins; take fewer bins, a longer range or a shorter pulse")
    per_bin = BYTES_PER_BIN + BYTES_PER_LABEL * len(survey.labels) + (BYTES_PER_PATH * paths if paths > 1 else 0)
    by_path, fewer = (f" and {paths} paths", "pings, bins or bounces") if paths > 1 else ("", "pings or bins")
    _check_memory(per_bin * pings * 2 * bins, f"a record of {pings} pings with 2 x {bins} bins{by_path}",
                  f"take fewer {fewer}")
    gate = bin_length / speckle_gates(bin_length, pulse_length)
    if survey.window[1] > MOST_GATES * gate * (1 + 1e-9):
        raise ValueError(f"speckle has steps of {1e6 * gate:.3g} µs, by the film's bins and the pulse, and the range "
                         f"has more than {MOST_GATES} of them; take longer bins, a longer pulse or a shorter range")


def check_beams(survey: ArraySurvey, beams: int, *, pings: int) -> None:
    """Refuse pictures of beams and pings that do not fit into memory."""
    bins, labels = beams * (survey.samples - survey.lead), len(survey.labels)
    _check_memory(bins * (labels * BYTES_PER_SUM + pings * (BYTES_PER_BIN + BYTES_PER_LABEL * labels)),
                  f"a picture of {pings} pings with {bins} bins of {beams} beams and {labels} shapes",
                  "take fewer pings or beams, a shorter range, let shapes share an id, or render the pings one by one "
                  "(mitsonar.frames; render --each-ping)")


def check_soundings(survey: ArraySurvey, beams: int) -> None:
    """Refuse soundings of beams of which one ping does not fit into memory."""
    _check_memory(BYTES_PER_SAMPLE * beams * survey.samples,
                  f"sounding a ping of {beams} beams with {survey.samples} samples",
                  "take fewer beams or a shorter range")


def check_rows(survey: ArraySurvey, bins: int, *, pings: int) -> None:
    """Refuse a record of rows of receivers, bins and pings that does not fit into memory."""
    rows, labels = survey.receive.elements, len(survey.labels)
    _check_memory(BYTES_PER_SAMPLE * rows * survey.samples + bins * (labels * BYTES_PER_SUM + pings * (
                  BYTES_PER_BIN + BYTES_PER_SOUNDING + BYTES_PER_LABEL * labels)),
                  f"a record of {pings} pings with {bins} bins of {rows} rows and {labels} shapes",
                  "take fewer pings or bins, a shorter range or pulse, or let shapes share an id")


def _check_memory(needed: float, request: str, remedy: str) -> None:
    """Refuse a request that needs more bytes than the machine has."""
    available = memory()
    if needed > available:
        raise ValueError(f"{request} takes {needed / 1e9:.0f} GB, more than the {available / 1e9:.0f} GB of this "
                         f"machine; {remedy}")
