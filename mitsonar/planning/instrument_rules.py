"""By which rules an instrument reduced its soundings, found out from a line that it recorded.

Instruments differ in two things. The head's own sound-speed sensor may be the profile's node at the arrays, or the
profile may stand as it was cast; and the way that the ship makes while an echo comes in may count or be left out. No
file says which. The times do: of the rays from the transmit array to the soundings' places and back to the receive
array,

    residual = (t_T + t_R - travel_time) c / 2,        less what three lever arms of the ping can explain

is smallest for the rules that the places were made by. Angles play no part in it.
"""
from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
import xarray as xr

from mitsonar.hydrography.detection.sounding_beams import slowness_to
from mitsonar.hydrography.reduction.attitude import PlatformMotion
from mitsonar.hydrography.reduction.legs import Starts
from mitsonar.hydrography.reduction.resounding import heads_of, installation_of, measured_of, parts_of, profile_of

MOST_PINGS = 8                     # that are looked at
FEWEST, FEWEST_RAYS = 20, 4        # soundings of a ping that is; rays that three lever arms are fitted to
STEP, TURNS = 0.01, 3              # [m] of the lever arms' derivatives; rounds of fitting
ALIKE = 0.8                        # of the worse residual, above which a file does not tell the rules apart


@dataclass(frozen=True, kw_only=True)
class InstrumentRules:
    """Rules by which soundings were reduced."""

    node: bool = True  # the head's sound speed was the profile's node at the arrays
    under_way: bool = True  # the way of the ship while an echo came in was counted
    residual: dict[tuple[bool, bool], float]  # [m]: root mean square, one way

    def arguments(self, soundings: xr.Dataset) -> dict[str, Any]:
        """Return the arguments of `resounded` that reduce a line by these rules."""
        if self.node:
            return {"under_way": self.under_way}
        depth = soundings["ping_depth"].values + float(soundings["transmit_offset"].values[2])
        return {"under_way": self.under_way, "node": False, "head_speed": profile_of(soundings).at(depth)}

    @property
    def words(self) -> tuple[str, ...]:
        """Say in clauses what was found."""
        if not self.residual:
            return ()
        node = (f"the file's soundings were made with {'the head' if self.node else 'the cast'}'s sound speed at the "
                f"arrays (travel times differ by {self._millimetres(self.node, self.under_way)}; with the "
                f"{'cast' if self.node else 'head'}'s by {self._millimetres(not self.node, self.under_way)})")
        way = (f"{'with' if self.under_way else 'without'} the ship's way while echoes come in "
               f"({'without' if self.under_way else 'with'} it {self._millimetres(self.node, not self.under_way)})")
        alike = [what for what, other in (("which sound speed was used", (not self.node, self.under_way)),
                                          ("whether the way was counted", (self.node, not self.under_way)))
                 if self.residual[self.node, self.under_way] > ALIKE * self.residual[other]]
        return (f"{node}, and {way}", *(f"the times do not decide {what}" for what in alike))

    def _millimetres(self, node, under_way):
        off = self.residual[node, under_way]
        return f"{1e3 * off:.3g} mm" if np.isfinite(off) else "more than any ray"


def rules_of(soundings: xr.Dataset) -> InstrumentRules:
    """Find the rules by which a line was reduced."""
    last = soundings["ping_time"].values + np.nanmax(
        np.where(soundings["valid"].values, soundings["travel_time"].values, 0.0), axis=1, initial=0.0)
    time = soundings["motion_time"].values
    told = np.flatnonzero((soundings["ping_time"].values >= time[0]) & (last <= time[-1])
                          & (soundings["valid"].values.sum(1) >= FEWEST))
    some = soundings.isel(ping=np.unique(told[np.linspace(0, told.size - 1, MOST_PINGS).astype(int)]) if told.size
                          else told)
    residual = {}
    for rules in product((True, False), (True, False)):
        residual[rules] = _rms(np.concatenate([fitted for _, fitted in time_residuals(some, *rules)] or [np.zeros(0)]))
    if not np.isfinite(min(residual.values())):
        return InstrumentRules(residual={})
    node, under_way = min(residual, key=lambda rules: residual[rules])
    node |= residual[node, under_way] > ALIKE * residual[True, under_way]
    under_way |= residual[node, under_way] > ALIKE * residual[node, True]
    return InstrumentRules(node=node, under_way=under_way, residual=residual)


def time_residuals(soundings: xr.Dataset, node: bool, under_way: bool) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return residuals of times, ping by ping."""
    # -> (B,) [m]
    motion, measured, profile = PlatformMotion.of(soundings), measured_of(soundings), profile_of(soundings)
    found = []
    for number, pings in heads_of(soundings):
        installed = installation_of(soundings, number)
        for ping in pings:
            one = measured[np.array([ping])]
            valid = soundings["valid"].values[ping]
            row = one[np.array([valid])]
            offsets = np.zeros((valid.sum(), 3))
            for part, there in parts_of(soundings, np.array([ping])):
                offsets[there[0][valid]] = part
            bed = np.stack([soundings[name].values[ping][valid] for name in ("x", "y", "depth")], -1)
            found.append(_residuals(row, motion, installed, offsets, profile, bed, node, under_way,
                                    _shift(soundings, motion, ping)))
    return found


def _shift(soundings, motion, ping):
    """Return the ping's own place less that of the motion's stream (3,): heave is in steps of a centimetre."""
    there = motion.at(soundings["ping_time"].values[ping]).place
    return np.array([soundings[f"ping_{name}"].values[ping] for name in ("x", "y", "depth")]) - there


def _residuals(measured, motion, installed, offsets, profile, bed, node, under_way, shift):
    """Return residuals (B,) [m] of a ping, bare and with three lever arms fitted."""
    sent = motion.at(measured.transmit_time)
    received = motion.at(measured.transmit_time + measured.travel_time)
    if not under_way:
        received.place[:, :2] = sent.place[:, :2]
    half = 0.5 * measured.head_sound_speed

    def ours(arm: np.ndarray) -> np.ndarray:
        total = -measured.travel_time
        for pose, offset in ((sent, installed.transmit_offset + offsets), (received, installed.receive_offset)):
            place = pose.carried(offset + arm) + shift
            starts = Starts(profile=profile, depth=place[:, 2], head_speed=measured.head_sound_speed if node else None)
            total = total + slowness_to(starts, bed[:, 2], np.hypot(*(bed - place)[:, :2].T))[1]
        return half * total

    bare = best = left = ours(np.zeros(3))
    arm = np.zeros(3)
    for _ in range(TURNS):
        slopes = np.stack([(ours(arm + STEP * axis) - left) / STEP for axis in np.eye(3)], -1)
        some = np.isfinite(slopes).all(1) & np.isfinite(left)
        if some.sum() < FEWEST_RAYS:
            break
        arm = arm - np.linalg.lstsq(slopes[some], left[some], rcond=None)[0]
        left = ours(arm)
        best = left if _rms(left) < _rms(best) else best           # wrong water may have no best arms
    return bare, best


def _rms(values):
    """Return the root mean square, infinite where less than half are numbers."""
    some = np.isfinite(values)
    return float(np.sqrt(np.mean(values[some] ** 2))) if 2 * some.sum() >= max(some.size, 1) else np.inf
