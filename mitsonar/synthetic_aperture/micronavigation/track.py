"""Steps from ping to ping as a record, the trajectory that they add up to, and their errors against the truth.

`micronavigation` has the sum. Between pings the correction is a cubic spline in time; the spline extends one delay
beyond the first and the last ping, and stays constant from there.
"""
from __future__ import annotations

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from ..focusing.poses import MOTION, Poses, poses_of
from .pairs import Arrays
from .step import SurgeEstimate

BENDS = 6                          # rounds; each changes the correction by a tenth of the previous change or less
PARTS = ("surge", "sway", "heave", "yaw")


def step_record(steps: list[SurgeEstimate], window_range: np.ndarray, arrays: Arrays, time: np.ndarray, poses: Poses
                ) -> xr.Dataset:
    """Return the estimated steps as one record, described in `micronavigation.micronavigate`."""
    nearest = [int(np.argmin(np.abs(step.apart))) for step in steps]
    values = {name: ("step", np.array([getattr(step.correction, name) for step in steps])) for name in PARTS}
    values |= {f"{name}_deviation": ("step", np.array([getattr(step.deviation, name) for step in steps]))
               for name in PARTS}
    above = arrays.bed_depth - poses.spline(time)[:-1, 2]
    values |= {
        "slant": (("step", "window"), np.stack([step.slant for step in steps])),
        "slant_deviation": (("step", "window"), np.stack([step.slant_deviation for step in steps])),
        "coherence": (("step", "window"), np.stack([step.coherence[k] for k, step in zip(nearest, steps)])),
        "expected": ("step", np.array([step.expected[k] for k, step in zip(nearest, steps)])),
        "pairs": ("step", np.array([len(step.pairs.first) for step in steps])),
        "grazing": (("step", "window"), np.arcsin(np.minimum(above[:, None] / window_range, 1.0)))}
    most = max(len(step.expected) for step in steps)
    values |= {name: (("step", "pair"), np.stack([np.pad(row, (0, most - len(row)), constant_values=np.nan)
                                                  for row in rows]))
               for name, rows in (("pair_apart", [step.apart for step in steps]),
                                  ("pair_coherence", [step.coherence.mean(1) for step in steps]))}
    record = xr.Dataset(values, coords={"window_range": ("window", window_range), "sent": ("node", time)})
    units = {"yaw": "rad", "yaw_deviation": "rad", "coherence": "1", "expected": "1", "pairs": "1",
             "pair_coherence": "1", "grazing": "rad", "sent": "s"}
    for name in record.variables:
        record[name].attrs["units"] = units.get(str(name), "m")
    return record.assign_attrs(delay=float(2 * window_range.mean() / arrays.sound_speed),
                               sound_speed=arrays.sound_speed, side=arrays.side)


def increments(poses: Poses, sent: np.ndarray, delay: float) -> np.ndarray:
    """Return the steps (P - 1, 4) from ping to ping in the frames of their first pings: ahead, to starboard, down, yaw.

    Positions are means of those at transmission and at reception, headings those at reception.
    """
    place = 0.5 * (poses.position(sent) + poses.position(sent + delay))
    heading = poses.heading(sent + delay)
    way = np.diff(place, axis=0)
    sine, cosine = np.sin(heading[:-1]), np.cos(heading[:-1])
    return np.stack([way[:, 0] * sine + way[:, 1] * cosine, way[:, 0] * cosine - way[:, 1] * sine, -way[:, 2],
                     np.diff(heading)], -1)


def since(steps: xr.Dataset, poses: Poses, first: Poses) -> xr.Dataset:
    """Return steps, estimated as errors of `poses`, as errors of the trajectory `first`."""
    sent, speed = steps["sent"].values, steps.attrs["sound_speed"]
    more = increments(poses, sent, steps.attrs["delay"]) - increments(first, sent, steps.attrs["delay"])
    values = {name: steps[name] + more[:, k] for k, name in enumerate(PARTS)}
    nearer = [steps["slant"][:, k] + nearness(increments(poses, sent, 2 * reach / speed)
                                              - increments(first, sent, 2 * reach / speed),
                                              steps["grazing"].values[:, k], steps.attrs["side"])
              for k, reach in enumerate(steps["window_range"].values)]
    return steps.assign(**values, slant=xr.concat(nearer, "window").transpose("step", "window"))


def nearness(way: np.ndarray, grazing: np.ndarray, side: float) -> np.ndarray:
    """Return the decrease (P - 1,) [m] of the distance to the bed by steps (P - 1, 4) as of `increments`."""
    return side * way[:, 1] * np.cos(grazing) + way[:, 2] * np.sin(grazing)


def integrated(steps: xr.Dataset, believed: xr.Dataset, poses: Poses) -> xr.Dataset:
    """Return the trajectory that steps add up to: the navigation, corrected."""
    sent, delay = steps["sent"].values, steps.attrs["delay"]
    way = increments(poses, sent, delay) + np.stack([steps[name].values for name in PARTS], -1)
    heading = poses.heading(sent[0] + delay) + np.concatenate([[0.0], np.cumsum(way[:, 3])])
    sine, cosine = np.sin(heading[:-1]), np.cos(heading[:-1])
    moved = np.stack([way[:, 0] * sine + way[:, 1] * cosine, way[:, 0] * cosine - way[:, 1] * sine, way[:, 2]], -1)
    first = 0.5 * (poses.spline(sent[0]) + poses.spline(sent[0] + delay))[:3]
    place = first + np.concatenate([np.zeros((1, 3)), np.cumsum(moved, 0)])
    was = 0.5 * (poses.spline(sent) + poses.spline(sent + delay))[:, :3]
    time = believed["motion_time"].values
    # where a track bends, the mean of two times is not the place at the middle: move nodes until their means are right
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
    """Return the errors of micronavigation against the true trajectory."""
    truth, believed = poses_of(raw), poses_of(trajectory)
    sent, speed = navigated["sent"].values, navigated.attrs["sound_speed"]
    estimates = np.stack([navigated[name].values for name in PARTS], -1)
    error = estimates - (increments(truth, sent, navigated.attrs["delay"])
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
    """Return a spline through nodes at times; it extends one delay, as the last ping's echoes arrive after its node."""
    return CubicSpline(node, values, axis=0)(np.clip(time, node[0] - beyond, node[-1] + beyond))
