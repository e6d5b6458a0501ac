"""Estimate of the rules by which an instrument reduced its soundings, from a recorded line.

Instruments differ in two rules. The sound speed measured at the head may replace the profile's value at the arrays, or
the profile may be used as cast; and the way of the ship during reception may be counted or neglected. Files do not
state the rules, but travel times reveal them. For rays from the transmit array to the sounding and back to the receive
array,

    residual = (t_T + t_R - travel_time) c / 2,        less the part that three lever arms per ping explain

is smallest for the rules that produced the soundings. Beam angles are not used.
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

MOST_PINGS = 8                     # to examine
FEWEST, FEWEST_RAYS = 20, 4        # soundings of an examined ping; rays to fit three lever arms
STEP, TURNS = 0.01, 3              # [m], for derivatives by the lever arms; rounds of fitting
ALIKE = 0.8                        # ratio of residuals above which the rules cannot be told apart


@dataclass(frozen=True, kw_only=True)
class InstrumentRules:
    """Rules by which soundings were reduced, and the residual of every pair of rules."""

    node: bool = True  # the head's sound speed replaces the profile's at the arrays
    under_way: bool = True  # the way of the ship during reception counts
    residual: dict[tuple[bool, bool], float]  # [m]: root mean square, one way

    def arguments(self, soundings: xr.Dataset) -> dict[str, Any]:
        """Return the arguments with which `resounded` reduces a line by these rules."""
        if self.node:
            return {"under_way": self.under_way}
        depth = soundings["ping_depth"].values + float(soundings["transmit_offset"].values[2])
        return {"under_way": self.under_way, "node": False, "head_speed": profile_of(soundings).at(depth)}

    @property
    def words(self) -> tuple[str, ...]:
        """Return the estimate and its doubts as clauses."""
        if not self.residual:
            return ()
        speed, other_speed = ("head", "cast") if self.node else ("cast", "head")
        way, other_way = ("with", "without") if self.under_way else ("without", "with")
        node = (f"the file's soundings were made with the {speed}'s sound speed at the arrays (travel-time residual "
                f"{self._millimetres(self.node, self.under_way)}; with the {other_speed}'s "
                f"{self._millimetres(not self.node, self.under_way)})")
        under_way = (f"{way} the ship's way during reception ({other_way} it "
                     f"{self._millimetres(self.node, not self.under_way)})")
        alike = [question for question, other in (("which sound speed was used", (not self.node, self.under_way)),
                                                  ("whether the way was counted", (self.node, not self.under_way)))
                 if self.residual[self.node, self.under_way] > ALIKE * self.residual[other]]
        return (f"{node}, and {under_way}", *(f"the times do not decide {question}" for question in alike))

    def _millimetres(self, node, under_way):
        residual = self.residual[node, under_way]
        return f"{1e3 * residual:.3g} mm" if np.isfinite(residual) else "too few rays"


def rules_of(soundings: xr.Dataset) -> InstrumentRules:
    """Estimate the rules by which a line was reduced; places by mitsonar are by its own rules, without residuals."""
    if "reduction" in soundings.attrs:
        return InstrumentRules(residual={})
    usable = under_record(soundings)
    if usable.size:
        usable = np.unique(usable[np.linspace(0, usable.size - 1, MOST_PINGS).astype(int)])
    examined = soundings.isel(ping=usable)
    residual = {}
    for rules in product((True, False), (True, False)):
        fitted = [residuals for _, residuals in time_residuals(examined, *rules)]
        residual[rules] = _rms(np.concatenate(fitted or [np.zeros(0)]))
    if not np.isfinite(min(residual.values())):
        return InstrumentRules(residual={})
    node, under_way = min(residual, key=lambda rules: residual[rules])
    node |= residual[node, under_way] > ALIKE * residual[True, under_way]
    under_way |= residual[node, under_way] > ALIKE * residual[node, True]
    return InstrumentRules(node=node, under_way=under_way, residual=residual)


def under_record(soundings: xr.Dataset) -> np.ndarray:
    """Return the pings with enough soundings whose motion was recorded from transmission to the last echo."""
    last = soundings["ping_time"].values + np.nanmax(
        np.where(soundings["valid"].values, soundings["travel_time"].values, 0.0), axis=1, initial=0.0)
    time = soundings["motion_time"].values
    return np.flatnonzero((soundings["ping_time"].values >= time[0]) & (last <= time[-1])
                          & (soundings["valid"].values.sum(1) >= FEWEST))


def time_residuals(soundings: xr.Dataset, node: bool, under_way: bool) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the residuals (B,) [m] of each ping, bare and with three lever arms fitted."""
    motion, measured, profile = PlatformMotion.of(soundings), measured_of(soundings), profile_of(soundings)
    residuals = []
    for number, pings in heads_of(soundings):
        installed = installation_of(soundings, number)
        for ping in pings:
            valid = soundings["valid"].values[ping]
            echoes = measured[np.array([ping])][np.array([valid])]
            offsets = np.zeros((valid.sum(), 3))
            for part, there in parts_of(soundings, np.array([ping])):
                offsets[there[0][valid]] = part
            # the motion records round heave to 1 cm
            shift = np.array([soundings[f"ping_{name}"].values[ping] for name in ("x", "y", "depth")]) \
                - motion.at(soundings["ping_time"].values[ping]).place
            bed = np.stack([soundings[name].values[ping][valid] for name in ("x", "y", "depth")], -1)
            residuals.append(_residuals(echoes, motion, installed, offsets, profile, bed, node, under_way,
                                        shift))
    return residuals


def _residuals(measured, motion, installed, offsets, profile, bed, node, under_way, shift):
    """Return residuals (B,) [m] of a ping, bare and with three lever arms fitted."""
    sent = motion.at(measured.transmit_time)
    received = motion.at(measured.transmit_time + measured.travel_time)
    if not under_way:
        received.place[:, :2] = sent.place[:, :2]
    half = 0.5 * measured.head_sound_speed

    def residuals_with(arm: np.ndarray) -> np.ndarray:
        total = -measured.travel_time
        for pose, offset in ((sent, installed.transmit_offset + offsets), (received, installed.receive_offset)):
            place = pose.carried(offset + arm) + shift
            starts = Starts(profile=profile, depth=place[:, 2], head_speed=measured.head_sound_speed if node else None)
            total = total + slowness_to(starts, bed[:, 2], np.hypot(*(bed - place)[:, :2].T))[1]
        return half * total

    bare = best = left = residuals_with(np.zeros(3))
    arm = np.zeros(3)
    for _ in range(TURNS):
        slopes = np.stack([(residuals_with(arm + STEP * axis) - left) / STEP for axis in np.eye(3)], -1)
        finite = np.isfinite(slopes).all(1) & np.isfinite(left)
        if finite.sum() < FEWEST_RAYS:
            break
        arm = arm - np.linalg.lstsq(slopes[finite], left[finite], rcond=None)[0]
        left = residuals_with(arm)
        best = left if _rms(left) < _rms(best) else best           # with wrong water the fit may diverge
    return bare, best


def _rms(values):
    """Return the root mean square of the finite values; infinity if less than half are finite."""
    finite = np.isfinite(values)
    return float(np.sqrt(np.mean(values[finite] ** 2))) if 2 * finite.sum() >= max(finite.size, 1) else np.inf
