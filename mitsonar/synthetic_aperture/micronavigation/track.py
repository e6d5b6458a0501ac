"""Steps from ping to ping as a record, the trajectory that they add up to, and both beside the truth.

See `micronavigation` for the sum. Between pings the correction is a cubic spline in time; it goes on for one delay
beyond the first and the last, and then stays.
"""
from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from ..focusing.poses import MOTION, Poses, poses_of
from .pairs import Arrays
from .step import SurgeEstimate

BENDS = 6                          # rounds, each a tenth of the last one's correction or less
PARTS = ("surge", "sway", "heave", "yaw")


def step_record(found: list[SurgeEstimate], window_range: np.ndarray, arrays: Arrays, time: np.ndarray, poses: Poses
                ) -> xr.Dataset:
    """Lay steps beside each other; see `micronavigation.micronavigate`."""
    nearest = [int(np.argmin(np.abs(one.apart))) for one in found]
    values = {name: ("step", np.array([getattr(one.correction, name) for one in found])) for name in PARTS}
    values |= {f"{name}_deviation": ("step", np.array([getattr(one.deviation, name) for one in found]))
               for name in PARTS}
    above = arrays.bed_depth - poses.spline(time)[:-1, 2]
    values |= {
        "slant": (("step", "window"), np.stack([one.slant for one in found])),
        "slant_deviation": (("step", "window"), np.stack([one.slant_deviation for one in found])),
        "coherence": (("step", "window"), np.stack([one.coherence[k] for k, one in zip(nearest, found)])),
        "expected": ("step", np.array([one.expected[k] for k, one in zip(nearest, found)])),
        "pairs": ("step", np.array([len(one.pairs.first) for one in found])),
        "grazing": (("step", "window"), np.arcsin(np.minimum(above[:, None] / window_range, 1.0)))}
    most = max(len(one.expected) for one in found)
    values |= {name: (("step", "pair"), np.stack([np.pad(some, (0, most - len(some)), constant_values=np.nan)
                                                  for some in parts]))
               for name, parts in (("pair_apart", [one.apart for one in found]),
                                   ("pair_coherence", [one.coherence.mean(1) for one in found]))}
    record = xr.Dataset(values, coords={"window_range": ("window", window_range), "sent": ("node", time)})
    units = {"yaw": "rad", "yaw_deviation": "rad", "coherence": "1", "expected": "1", "pairs": "1",
             "pair_coherence": "1", "grazing": "rad", "sent": "s"}
    for name in record.variables:
        record[name].attrs["units"] = units.get(str(name), "m")
    return record.assign_attrs(delay=float(2 * window_range.mean() / arrays.sound_speed),
                               sound_speed=arrays.sound_speed, side=arrays.side)


def increments(poses: Poses, sent: np.ndarray, delay: float) -> np.ndarray:
    """Return the ways (P - 1, 4) from ping to ping in the frames of their first pings: ahead, to starboard, down, yaw.

    Positions are means of those at transmission and at reception, headings those at reception.
    """
    place = 0.5 * (poses.position(sent) + poses.position(sent + delay))
    heading = poses.heading(sent + delay)
    way = np.diff(place, axis=0)
    sine, cosine = np.sin(heading[:-1]), np.cos(heading[:-1])
    return np.stack([way[:, 0] * sine + way[:, 1] * cosine, way[:, 0] * cosine - way[:, 1] * sine, -way[:, 2],
                     np.diff(heading)], -1)


def since(steps: xr.Dataset, poses: Poses, first: Poses) -> xr.Dataset:
    """Return steps beside the trajectory `first` that were estimated beside `poses`."""
    sent, speed = steps["sent"].values, steps.attrs["sound_speed"]
    more = increments(poses, sent, steps.attrs["delay"]) - increments(first, sent, steps.attrs["delay"])
    values = {name: steps[name] + more[:, k] for k, name in enumerate(PARTS)}
    nearer = [steps["slant"][:, k] + nearness(increments(poses, sent, 2 * reach / speed)
                                              - increments(first, sent, 2 * reach / speed),
                                              steps["grazing"].values[:, k], steps.attrs["side"])
              for k, reach in enumerate(steps["window_range"].values)]
    return steps.assign(**values, slant=xr.concat(nearer, "window").transpose("step", "window"))


def nearness(way: np.ndarray, grazing: np.ndarray, side: float) -> np.ndarray:
    """Return how much nearer (P - 1,) [m] the bed comes by ways (P - 1, 4) as of `increments`."""
    return side * way[:, 1] * np.cos(grazing) + way[:, 2] * np.sin(grazing)


def integrated(steps: xr.Dataset, believed: xr.Dataset, poses: Poses) -> xr.Dataset:
    """Add steps up to a trajectory: what was believed, corrected."""
    sent, delay = steps["sent"].values, steps.attrs["delay"]
    way = increments(poses, sent, delay) + np.stack([steps[name].values for name in PARTS], -1)
    heading = poses.heading(sent[0] + delay) + np.concatenate([[0.0], np.cumsum(way[:, 3])])
    sine, cosine = np.sin(heading[:-1]), np.cos(heading[:-1])
    moved = np.stack([way[:, 0] * sine + way[:, 1] * cosine, way[:, 0] * cosine - way[:, 1] * sine, way[:, 2]], -1)
    first = 0.5 * (poses.spline(sent[0]) + poses.spline(sent[0] + delay))[:3]
    place = first + np.concatenate([np.zeros((1, 3)), np.cumsum(moved, 0)])
    was = 0.5 * (poses.spline(sent) + poses.spline(sent + delay))[:, :3]
    time = believed["motion_time"].values
    # the mean of two moments is not the middle one's where a way bends: nodes give way until their means are right
    node, wanted = place - was, place - was
    for _ in range(BENDS):
        means = 0.5 * sum(_joined(sent + 0.5 * delay, node, moment, delay) for moment in (sent, sent + delay))
        node = node + wanted - means
    correction = _joined(sent + 0.5 * delay, node, time, delay)
    turn = _joined(sent + delay, heading - poses.heading(sent + delay), time, delay)
    added = {"motion_x": correction[:, 0], "motion_y": correction[:, 1], "motion_depth": correction[:, 2],
             "motion_heading": turn}
    return xr.Dataset({"motion_time": ("motion", time), **{
        name: ("motion", np.asarray(believed[name].values, float) + added.get(name, 0.0)) for name in MOTION}})


def compare(navigated: xr.Dataset, raw: xr.Dataset, trajectory: xr.Dataset) -> xr.Dataset:
    """Return the errors of micronavigation beside the truth."""
    truth, believed = poses_of(raw), poses_of(trajectory)
    sent, speed = navigated["sent"].values, navigated.attrs["sound_speed"]
    found = np.stack([navigated[name].values for name in PARTS], -1)
    error = found - (increments(truth, sent, navigated.attrs["delay"])
                     - increments(believed, sent, navigated.attrs["delay"]))
    slant = np.empty_like(navigated["slant"].values)
    for number, reach in enumerate(navigated["window_range"].values):
        off = increments(truth, sent, 2 * reach / speed) - increments(believed, sent, 2 * reach / speed)
        slant[:, number] = navigated["slant"].values[:, number] - nearness(
            off, navigated["grazing"].values[:, number], navigated.attrs["side"])
    at = sent + 0.5 * navigated.attrs["delay"]
    away = poses_of(navigated).position(at) - truth.position(at)
    heading = float(truth.heading(at).mean())
    aside = away[:, 0] * np.cos(heading) - away[:, 1] * np.sin(heading)
    line = np.polynomial.polynomial.polyvander(at - at.mean(), 1)
    aside = aside - line @ np.linalg.lstsq(line, aside, rcond=None)[0]
    return xr.Dataset({**{f"{name}_error": ("step", error[:, k]) for k, name in enumerate(PARTS)},
                       "slant_error": (("step", "window"), slant), "track_error": ("ping", aside)},
                      coords={"window_range": navigated["window_range"]})


def _joined(node: np.ndarray, values: np.ndarray, time: np.ndarray, beyond: float) -> np.ndarray:
    """A spline through nodes that goes on for a delay: the last ping's echoes come in after its node."""
    return CubicSpline(node, values, axis=0)(np.clip(time, node[0] - beyond, node[-1] + beyond))
