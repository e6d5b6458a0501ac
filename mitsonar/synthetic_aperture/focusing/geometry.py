"""Places of the arrays when they passed each row of an image, from which the phases of its banks follow.

    ρ_b(p) = |p - P_t| + |p - P_b|                       two-way path of bank b, in the plane across the track

P_t -> ``sender``, P_b -> ``bank``: distance to starboard of the line through the grid's first points, and z, up. In the
image of bank b, the echo of s is focused at p with the phase -k (ρ_b(s) - ρ_b(p)).
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr
from scipy.interpolate import CubicSpline

from mitsonar.sonar.pulses.pulses import pulse_of

from ..micronavigation.pairs import arrays_of
from ..record import IMAGE_VARIABLES
from .poses import poses_of

FINE = 2001                        # moments along the track, splines between them
PATHS = ("sender_across", "sender_depth", "bank_across", "bank_depth")


@dataclass(frozen=True, kw_only=True)
class ArrayPaths:
    """Places of the arrays abeam of an image's rows."""

    sender: np.ndarray  # (A, 2) [m]: across the track and z
    bank: np.ndarray  # (B, A, 2) [m]


def image_variables(values: dict[str, np.ndarray]) -> dict[str, xr.Variable]:
    """Return arrays with the dimensions, types, units and meanings of `IMAGE_VARIABLES`."""
    return {name: IMAGE_VARIABLES.variable(name, array) for name, array in values.items()}


def with_array_paths(image: xr.Dataset, raw: xr.Dataset, trajectory: xr.Dataset | None = None) -> xr.Dataset:
    """Add to an image the places of the arrays when they passed each of its rows."""
    poses = poses_of(raw if trajectory is None else trajectory)
    along, across, start = _axes(image)
    time = np.linspace(poses.first, poses.last, FINE)
    way = (poses.position(time)[:, :2] - start) @ along
    if not np.all(np.diff(way) > 0):
        raise ValueError("the sonar does not pass the image's rows one after the other; heights from banks need a "
                         "track along the image")
    rows = image["along_track"].values
    tx, rx = (np.asarray(raw[name].values, float) for name in ("tx_position", "rx_position"))
    bank, half = np.asarray(raw["rx_bank"].values), 0.5 * pulse_of(raw.attrs["pulse"]).duration
    passed = CubicSpline(way, time)(np.clip(rows, way[0], way[-1]))
    sender = _seen(poses.place(passed, tx.mean(0)), across, start)
    # A receiver moves on until the echo arrives; only its movement aside matters.
    later = passed + half + float(raw["time"].values.mean())
    banks = [_seen(poses.place(later, rx[bank == number].mean(0)), across, start) for number in np.unique(bank)]
    return image.assign(image_variables({
        "sender_across": sender[:, 0], "sender_depth": -sender[:, 1],
        "bank_across": np.stack([place[:, 0] for place in banks]),
        "bank_depth": np.stack([-place[:, 1] for place in banks])})).assign_attrs(
            sound_speed=arrays_of(raw).sound_speed)


def array_paths(image: xr.Dataset) -> ArrayPaths:
    """Return the places of the arrays that `with_array_paths` added to an image."""
    missing = [name for name in PATHS if name not in image.variables]
    if missing:
        raise ValueError(f"the places of the arrays are needed, and the image lacks {', '.join(missing)}; call "
                         "with_array_paths(image, raw) first")
    values = {name: np.asarray(image[name].values, float) for name in PATHS}
    return ArrayPaths(sender=np.stack([values["sender_across"], -values["sender_depth"]], -1),
                      bank=np.stack([values["bank_across"], -values["bank_depth"]], -1))


def ground_across(image: xr.Dataset) -> np.ndarray:
    """Return the distances (A, C) [m] of an image's points to starboard of its first column."""
    _, across, start = _axes(image)
    return (np.stack([image["x"].values, image["y"].values], -1) - start) @ across


def bank_paths(paths: ArrayPaths, bank: int, across: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Return two-way paths ρ (A, C) [m] of a bank to points at `across` and `height` (A, C) [m], z up."""
    out, home = (np.hypot(across - place[:, :1], height - place[:, 1:]) for place in (paths.sender, paths.bank[bank]))
    return out + home


def _axes(image: xr.Dataset) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the grid's directions ahead and to starboard, and its origin, from the places of its points."""
    x, y, rows = (image[name].values for name in ("x", "y", "along_track"))
    if x.shape[0] < 2:
        raise ValueError("the image has one row, and the track's direction needs two or more; focus a larger grid")
    along = np.array([x[-1, 0] - x[0, 0], y[-1, 0] - y[0, 0]]) / (rows[-1] - rows[0])
    return along, np.array([along[1], -along[0]]), np.array([x[0, 0], y[0, 0]]) - rows[0] * along


def _seen(place: np.ndarray, across: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return places (A, 3) as (A, 2): distance to starboard of the grid's first column, and z."""
    return np.stack([(place[:, :2] - start) @ across, place[:, 2]], -1)
