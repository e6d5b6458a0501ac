"""Snippets as file formats hold them: runs of samples on one clock a ping, with the sample of each sounding."""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .lines import Ping

LAST = 65_535                              # last sample number in 16 bits


@dataclass(frozen=True, kw_only=True, eq=False)
class Runs:
    """Snippets of a ping."""

    rate: float  # [Hz]
    start: np.ndarray  # (B,): number of the first sample
    count: np.ndarray  # (B,): number of samples
    centre: np.ndarray  # (B,): sample of the sounding, counted from the first
    values: np.ndarray  # [dB]: beam after beam


def runs_of(ping: Ping) -> Runs | None:
    """Return a ping's snippets, or None if it has none or lacks their rate.

    A snippet that ends after the 65,535th sample is left out: formats count in 16 bits.
    """
    if "snippet_db" not in ping or "snippet_rate" not in ping or not ping["snippet_rate"] > 0:
        return None
    rate, samples = float(ping["snippet_rate"]), ping["snippet_db"]
    finite = np.isfinite(samples)
    first = np.argmax(finite, axis=1)
    end = samples.shape[1] - np.argmax(finite[:, ::-1], axis=1)
    begins = np.where(np.isfinite(ping["snippet_start"]), ping["snippet_start"], 0.0) * rate + first
    start = np.rint(begins).astype(int)
    kept = finite.any(axis=1) & np.isfinite(ping["snippet_start"]) & (start >= 0) & (start + end - first <= LAST)
    start, count = np.where(kept, start, 0), np.where(kept, end - first, 0)
    echo = np.rint(np.where(np.isfinite(ping["travel_time"]), ping["travel_time"], 0.0) * rate).astype(int)
    centre = np.where(kept, np.clip(echo - start, 0, np.maximum(count - 1, 0)), 0)
    number = np.arange(samples.shape[1])
    stored = kept[:, None] & (number >= first[:, None]) & (number < end[:, None])
    return Runs(rate=rate, start=start, count=count, centre=centre, values=samples[stored])
