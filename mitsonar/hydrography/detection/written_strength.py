"""Compute strengths as an instrument writes them, from bottom backscattering strengths.

    S' = S + C(θ) + E        E = 2 (α' - α) R - (SL' - SL) + 10 log10 (A / A') + P - P' + G + W

S -> ``backscatter_db``, θ -> ``incidence`` on a level bed, α and α' -> absorption of the water and the assumed one, R
-> length of the path, SL' - SL -> ``source_level_error_db``, A and A' -> ensonified area of the bed as it slopes and of
a level bed, P and P' -> ``pattern`` (real less ideal, both ways) and the part of it that the instrument corrects,
G -> gain steps, W -> strength of a short window about the detection less that of the whole footprint: speckle.

C flattens the response of a model bed with the strengths BSn at normal and BSo at oblique incidence, linear between
them up to the crossover angle θ_c, and Lambert's law beyond (Hammerstad 2000, Backscattering and seabed image
reflectivity, EM technical note):

    B(θ) = BSo + 20 log10 cos θ                           θ >= θ_c
    B(θ) = BSn + (B(θ_c) - BSn) θ / θ_c                   θ <  θ_c                                              (1)
    C(θ) = BSo - B(θ)                                     law "both"

"lambert" removes 20 log10 cos θ at all angles; "normal" flattens (1) within θ_c, without the cosine, and nothing
beyond.
"""
from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

__all__ = ["ANGLE_LAWS", "BeamPattern", "StrengthWriting", "angle_correction_db", "found_response"]

ANGLE_LAWS = ("none", "lambert", "normal", "both")
STEEPEST = np.deg2rad(89.0)        # incidence [rad] at which Lambert's law ends, so that corrections are finite


@dataclass(frozen=True, kw_only=True, eq=False)
class BeamPattern:
    """Pattern of both arrays together, real less ideal, of every sector across the track."""

    sector: np.ndarray  # (N,) numbers of sectors, from 0
    angle: np.ndarray  # (N,) [rad] from the normal of the receiving line, positive to starboard
    level_db: np.ndarray  # (N,)

    def at(self, sector: np.ndarray, angle: np.ndarray) -> np.ndarray:
        """Return the pattern [dB] at angles (B,) of sectors (B,): linear, constant beyond the ends, 0 without rows."""
        found = np.zeros(np.shape(angle))
        for number in np.unique(self.sector):
            rows = np.flatnonzero(self.sector == number)
            rows = rows[np.argsort(self.angle[rows])]
            mine = np.asarray(sector) == number
            found[mine] = np.interp(np.asarray(angle)[mine], self.angle[rows], self.level_db[rows])
        return found


@dataclass(frozen=True, kw_only=True, eq=False)
class StrengthWriting:
    """Corrections and assumptions with which an instrument writes strengths."""

    beam_law: str = "none"  # one of `ANGLE_LAWS`, of the beams' strengths
    image_law: str = "none"  # the same, of snippets
    crossover: float = np.deg2rad(25.0)  # [rad]
    normal_db: float | None = None  # BSn; None: found from every ping
    oblique_db: float | None = None  # BSo; likewise
    absorption_db: tuple[float, ...] = ()  # [dB/m] assumed, one a sector; empty: the water's
    source_level_error_db: tuple[float, ...] = (0.0,)  # assumed less true, one a sector or one for all
    window: float | None = None  # [s] about the detection in which intensities are averaged; None: the footprint
    level_bed: bool = False  # True: the area is that of a level bed
    pattern: BeamPattern | None = None
    pattern_correction: BeamPattern | None = None
    gain_steps: tuple[tuple[int, float], ...] = field(default=())  # (first ping, gain [dB]), in the order of pings

    def gain_db(self, ping: int) -> float:
        """Return the gain [dB] of a ping: that of the latest step, 0 before the first."""
        return next((gain for first, gain in reversed(self.gain_steps) if first <= ping), 0.0)

    def of_sector(self, name: str, number: int) -> float:
        """Return the value of a sector in a list with one value a sector, or one for all."""
        values = getattr(self, name)
        return values[number] if len(values) > 1 else values[0]

    def errors_db(self, ping: int, number: int, *, angle: np.ndarray, distance: np.ndarray,
                  absorption_db: np.ndarray, area_error_db: np.ndarray,
                  window_error_db: np.ndarray | float = 0.0) -> np.ndarray:
        """Return E (B,) [dB] of a sector's soundings.

        Parameters
        ----------
        ping, number : int
            Numbers of the ping and of the sector.
        angle : float (B,) [rad]
            Angles of the beams from the normal of the receiving line.
        distance : float (B,) [m]
            Length of the path to the soundings.
        absorption_db : float (B,) [dB/m]
            Mean absorption of the water along the paths.
        area_error_db : float (B,) [dB]
            Ensonified area of the bed over that of a level bed.
        window_error_db : float (B,) [dB]
            W.

        Returns
        -------
        float (B,) [dB]
        """
        error = np.full(np.shape(distance), self.gain_db(ping) - self.of_sector("source_level_error_db", number))
        error += window_error_db
        if self.absorption_db:
            error += 2 * (self.of_sector("absorption_db", number) - absorption_db) * distance
        if self.level_bed:
            error += area_error_db
        sector = np.full(np.shape(distance), number)
        for pattern, sign in ((self.pattern, 1), (self.pattern_correction, -1)):
            if pattern is not None:
                error += sign * pattern.at(sector, angle)
        return error

    def response(self, strength_db: np.ndarray, incidence: np.ndarray) -> tuple[float, float]:
        """Return BSn and BSo [dB] of a ping: those that are set, or those of `found_response`."""
        normal, oblique = found_response(strength_db, incidence, self.crossover)
        return (normal if self.normal_db is None else self.normal_db,
                oblique if self.oblique_db is None else self.oblique_db)


def _lambert_db(incidence: np.ndarray) -> np.ndarray:
    """Return 20 log10 cos θ [dB]."""
    return 20 * np.log10(np.cos(np.minimum(np.abs(incidence), STEEPEST)))


def angle_correction_db(incidence: np.ndarray, law: str, *, normal_db: float, oblique_db: float,
                        crossover: float) -> np.ndarray:
    """Return C, the angle correction that an instrument adds to strengths.

    Parameters
    ----------
    incidence : float (B,) [rad]
        Incidence on a level bed, of either sign.
    law : str
        One of `ANGLE_LAWS`.
    normal_db, oblique_db : float [dB]
        BSn and BSo.
    crossover : float [rad]
        θ_c.

    Returns
    -------
    float (B,) [dB]

    Raises
    ------
    ValueError
        If the law is unknown.
    """
    if law not in ANGLE_LAWS:
        raise ValueError(f"the angle law is {law!r}; it is one of {', '.join(ANGLE_LAWS)}.")
    incidence = np.abs(np.asarray(incidence, float))
    beyond = -_lambert_db(incidence) if law in ("lambert", "both") else np.zeros(incidence.shape)
    if law in ("none", "lambert"):
        return beyond
    end = oblique_db + (float(_lambert_db(np.array(crossover))) if law == "both" else 0.0)
    within = oblique_db - (normal_db + (end - normal_db) * incidence / crossover)
    return np.where(incidence < crossover, within, beyond)


def found_response(strength_db: np.ndarray, incidence: np.ndarray, crossover: float) -> tuple[float, float]:
    """Return BSn and BSo of a ping's strengths.

    BSo is the median of S - 20 log10 cos θ beyond the crossover. BSn is the least-squares fit of (1) within it, and
    BSo where no sounding lies there.

    Parameters
    ----------
    strength_db : float (B,) [dB]
        Strengths, NaN where there is none.
    incidence : float (B,) [rad]
        Incidence on a level bed.
    crossover : float [rad]
        θ_c.

    Returns
    -------
    float, float [dB]
        NaN without any strength.
    """
    strength_db, incidence = np.asarray(strength_db, float), np.abs(np.asarray(incidence, float))
    known = np.isfinite(strength_db) & np.isfinite(incidence)
    level = strength_db - _lambert_db(incidence)
    far, near = known & (incidence >= crossover), known & (incidence < crossover)
    if not known.any():
        return np.nan, np.nan
    oblique = float(np.median(level[far] if far.any() else level[known]))
    if not near.any():
        return oblique, oblique
    share = incidence[near] / crossover
    rest = strength_db[near] - (oblique + float(_lambert_db(np.array(crossover)))) * share
    return float(np.sum((1 - share) * rest) / np.sum((1 - share) ** 2)), oblique
