"""Figures of a ping that sounders state beside its soundings: widths of their beams, strength at and off the vertical.

    width of the transmitted beam = footprint along / slant range
    width of a receiving beam = footprint across · cos(angle) / slant range        within 15 degrees of the vertical,
                                                                                  where no pulse is shorter than it
"""
from __future__ import annotations

import numpy as np

from .lines import Ping

STEEP, OBLIQUE = np.radians(15.0), np.radians(25.0)


def swath_figures(ping: Ping) -> dict[str, float]:
    """Return widths of beams [degrees] and strengths [dB] by their names in KMALL, 0 where they are unknown."""
    down = ping["depth"] - ping["ping_depth"]
    across = np.hypot(ping["across_track"], ping["along_track"])
    away, slant = np.abs(np.arctan2(across, down)), np.hypot(across, down)

    def typical(name: str, where: np.ndarray, factor: np.ndarray | float = 1.0) -> float:
        """Return the median over the valid soundings of a part, 0 without any."""
        values = factor * ping[name] if name in ping else np.zeros(0)
        values = values[where & ping["valid"]] if values.size else values
        values = values[np.isfinite(values)]
        return float(np.median(values)) if values.size else 0.0

    with np.errstate(divide="ignore", invalid="ignore"):
        per_range = np.degrees(1.0) / slant
    return {"transmitArraySizeUsed_deg": typical("footprint_along", slant > 0, per_range),
            "receiveArraySizeUsed_deg": typical("footprint_across", away < STEEP, np.cos(away) * per_range),
            "BSnormal_dB": typical("backscatter_db", away < STEEP),
            "BSoblique_dB": typical("backscatter_db", away > OBLIQUE)}
