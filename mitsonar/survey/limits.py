"""Refuse surveys that would exceed the machine's memory, or sum for hours, before they begin."""
import os

import numpy as np

from mitsonar.imaging.sidescan import speckle_gates

from .energy.sidescan_survey import SidescanSurvey
from .pressure.array_survey import ArraySurvey

BYTES_PER_BIN = 90                 # of the record while it is made and written, all variables together,
BYTES_PER_LABEL = 13               # and of each shape's share,
BYTES_PER_SUM = 72                 # of a ping of a fan, each bin and shape, while its truth is made
BYTES_PER_PATH = 12                # and of each path where there is more than one
BYTES_PER_SOUNDING = 130           # of those with phases and errors beside each
BYTES_PER_SAMPLE = 60              # of a beam, while a ping is sounded
BINS_PER_PULSE = 10_000
MOST_GATES = 1 << 19               # of speckle, up to the end of the range: far below where float32 ends to count


def check_sidescan(survey: SidescanSurvey) -> None:
    """Refuse a sidescan's survey that is too large."""
    pings, bins, paths = survey.track.pings, survey.bins, len(survey.paths)
    bin_length, pulse_length = survey.bin_length, survey.sonar.pulse_length
    if pulse_length > BINS_PER_PULSE * bin_length:
        raise ValueError(f"the film's bins last {1e6 * bin_length:.3g} µs and the pulse {1e6 * pulse_length:.3g} µs, "
                         f"more than {BINS_PER_PULSE} bins; take fewer bins, a longer range or a shorter pulse")
    per_bin = BYTES_PER_BIN + BYTES_PER_LABEL * len(survey.labels) + (BYTES_PER_PATH * paths if paths > 1 else 0)
    needed, there = per_bin * pings * 2 * bins, _memory()
    if needed > there:
        by_path, fewer = (f" and {paths} paths", "pings, bins or bounces") if paths > 1 else ("", "pings or bins")
        raise ValueError(f"a record of {pings} pings with 2 x {bins} bins{by_path} takes {needed / 1e9:.0f} GB, more "
                         f"than the {there / 1e9:.0f} GB of this machine; take fewer {fewer}")
    gate = bin_length / speckle_gates(bin_length, pulse_length)
    if survey.window[1] > MOST_GATES * gate * (1 + 1e-9):
        raise ValueError(f"speckle is drawn in steps of {1e6 * gate:.3g} µs, after the film's bins and the pulse, and "
                         f"the range lasts more than {MOST_GATES} of them; take longer bins, a longer pulse or a "
                         "shorter range")


def check_beams(survey: ArraySurvey, beams: int, *, pings: int) -> None:
    """Refuse the pictures of so many beams and pings if they do not fit into memory."""
    bins, labels = beams * (survey.samples - survey.lead), len(survey.labels)
    needed, there = bins * (labels * BYTES_PER_SUM + pings * (BYTES_PER_BIN + BYTES_PER_LABEL * labels)), _memory()
    if needed > there:
        raise ValueError(f"pictures of {pings} pings with {bins} bins of {beams} beams and {labels} shapes take "
                         f"{needed / 1e9:.0f} GB, more than the {there / 1e9:.0f} GB of this machine; take fewer pings "
                         "or beams, a shorter range, let shapes share an id, or take the pings one by one "
                         "(mitsonar.frames; render --each-ping)")


def check_soundings(survey: ArraySurvey, beams: int) -> None:
    """Refuse soundings of so many beams if those of one ping do not fit into memory."""
    needed, there = BYTES_PER_SAMPLE * beams * survey.samples, _memory()
    if needed > there:
        raise ValueError(f"a ping of {beams} beams with {survey.samples} samples takes {needed / 1e9:.0f} GB to sound, "
                         f"more than the {there / 1e9:.0f} GB of this machine; take fewer beams or a shorter range")


def check_rows(survey: ArraySurvey, bins: int, *, pings: int) -> None:
    """Refuse a record of rows of receivers with so many bins and pings if it does not fit into memory."""
    rows, labels = survey.receive.elements, len(survey.labels)
    needed = BYTES_PER_SAMPLE * rows * survey.samples + bins * (labels * BYTES_PER_SUM + pings * (
        BYTES_PER_BIN + BYTES_PER_SOUNDING + BYTES_PER_LABEL * labels))
    if needed > _memory():
        raise ValueError(f"a record of {pings} pings with {bins} bins of {rows} rows and {labels} shapes takes "
                         f"{needed / 1e9:.0f} GB, more than the {_memory() / 1e9:.0f} GB of this machine; take fewer "
                         "pings or bins, a shorter range or pulse, or let shapes share an id")


def _memory() -> float:
    """Return physical memory [bytes], or what a process may have of it; infinite where the system does not say."""
    try:
        physical = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return np.inf
    try:
        import resource
    except ImportError:                                # not on Windows
        return physical
    allowed = resource.getrlimit(resource.RLIMIT_AS)[0]
    return physical if allowed == resource.RLIM_INFINITY else min(physical, allowed)
