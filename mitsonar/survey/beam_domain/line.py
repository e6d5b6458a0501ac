"""Receive arrays that are a line, or parallel lines, so that one sine describes the direction of a beam.

    W(s, t) = Σ_n w_n e^(i2π x_n (s - s_b) / λ) · Σ_m v_m e^(i2π y_m t / λ),     s = l·a,  t = l·p

l -> unit vector towards the echo, a -> ``axis``, p -> unit vector across it in the array's face; x_n, w_n -> ``place``
and ``received`` along the line, y_m, v_m -> those of the rows. The second sum is the pattern of the rows, steered to
the plane of the fan.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mitsonar.sonar.arrays.array import Array

FLAT = 0.02                        # [wavelengths] largest distance of elements from the line or plane
SEPARABLE = 1e-6                   # share of the largest weight: largest error of a product of rows and columns


@dataclass(frozen=True, kw_only=True)
class LineArray:
    """An array, described as a line of columns."""

    axis: np.ndarray  # (3,), unit vector along the line, in the fan's plane, body frame
    normal: np.ndarray  # (3,), unit vector across the axis in the fan's plane, body frame
    centre: np.ndarray  # (3,) [m], of the array, body frame
    place: np.ndarray  # (N,) [m], of the columns along the axis
    weight: np.ndarray  # (N,) [-], of the columns
    row_place: np.ndarray  # (M,) [m], of the rows; a line has one
    row_weight: np.ndarray  # (M,) [-], of the rows
    channel: np.ndarray  # (N,) [-], of the columns, complex; see `Array`

    @property
    def received(self) -> np.ndarray:
        """Return the weights of the columns with their channels (N,)."""
        return self.weight if np.all(self.channel == 1) else self.weight * self.channel

    @property
    def resolves(self) -> bool:
        """Return True if beams of the line tell directions apart."""
        return len(self.place) > 1

    @property
    def length(self) -> float:
        """Return the length of the aperture [m]: from the first to the last column, plus one spacing."""
        count = len(self.place)
        return float(np.ptp(self.place)) * count / max(count - 1, 1)

    @classmethod
    def of(cls, array: Array, direction: np.ndarray, wavelength: float) -> LineArray:
        """Return an array as a line; raise `ValueError` if it is none. See `refusal`."""
        reason = refusal(array, direction, wavelength)
        if reason:
            raise ValueError(f"The receive array is neither a line nor parallel lines: {reason}.")
        axis, normal = _axes(direction)
        return cls(axis=axis, normal=normal, centre=array.position.mean(0), **_columns(array, axis, normal))

    @classmethod
    def along(cls, array: Array, axis: np.ndarray, wavelength: float) -> LineArray:
        """Return an array as a line along an axis (3,), body frame, with beams around the axis of its elements."""
        sines = np.array([-0.5, 0.0, 0.5])
        return cls.of(array, sines[:, None] * axis + np.sqrt(1 - sines ** 2)[:, None] * array.normal[0], wavelength)

    @classmethod
    def of_element(cls, array: Array) -> LineArray:
        """Return the only element of an array as a line across its long side; its beam resolves no directions."""
        normal = array.normal[0]
        return cls(axis=np.cross(normal, array.along[0]), normal=normal, centre=array.position[0], place=np.zeros(1),
                   weight=np.ones(1), row_place=np.zeros(1), row_weight=np.ones(1), channel=np.ones(1))


def refusal(array: Array, direction: np.ndarray, wavelength: float) -> str:
    """Return the reason why an array is not a line or parallel lines for beams along directions; empty if it is."""
    # direction (B, 3), body frame; wavelength [m]
    if len(direction) < 2:
        return "there is only one beam"
    if len(array.faces()) > 1 and not (array.pattern == "omni" and array.baffle == "none"):
        return "its elements look in different directions"
    axis, normal = _axes(direction)
    if np.abs(direction @ np.cross(axis, normal)).max() > 1e-6:
        return "the beams do not lie in one plane"
    place = array.position - array.position.mean(0)
    if np.abs(place @ normal).max() > FLAT * wavelength:
        return "its elements do not lie in one plane with the fan's axis"
    across = place @ np.cross(axis, normal)
    if np.ptp(place @ axis) < 0.5 * wavelength:
        return "it is shorter than half a wavelength along the fan"
    if np.ptp(across) > 2 * FLAT * wavelength and _table(array, axis, normal) is None:
        return "its weights are not products of a row weight and a column weight, or rows have channels of their own"
    return ""


def _axes(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the axis, from the first beam to the last, and the normal to it in the plane of a fan."""
    axis = direction[-1] - direction[0]
    axis = axis / np.linalg.norm(axis)
    normal = direction.mean(0)
    normal = normal - (normal @ axis) * axis
    return axis, normal / np.linalg.norm(normal)


def _columns(array: Array, axis: np.ndarray, normal: np.ndarray) -> dict[str, np.ndarray]:
    """Return the places and weights of columns and rows, as fields of `LineArray`."""
    table = _table(array, axis, normal)
    if table is None or len(table[1]) == 1:
        place = (array.position - array.position.mean(0)) @ axis
        return {"place": place, "weight": array.weight.astype(float), "row_place": np.zeros(1),
                "row_weight": np.ones(1), "channel": array.channel}
    columns, rows, weight, channel = table
    peak = np.unravel_index(np.abs(weight).argmax(), weight.shape)
    return {"place": columns, "weight": weight[peak[0]], "row_place": rows,
            "row_weight": weight[:, peak[1]] / weight[peak], "channel": channel[0]}


def _table(array: Array, axis: np.ndarray,
           normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None:
    """Return places of columns (N,) and rows (M,), weights and channels (M, N); None if rows are not alike."""
    place = array.position - array.position.mean(0)
    x, y = place @ axis, place @ np.cross(axis, normal)
    columns, column = np.unique(x.round(9), return_inverse=True)
    rows, row = np.unique(y.round(9), return_inverse=True)
    if len(columns) * len(rows) != array.elements or len(rows) == array.elements:
        return None
    weight = np.zeros((len(rows), len(columns)))
    weight[row, column] = array.weight
    peak = np.unravel_index(np.abs(weight).argmax(), weight.shape)
    product = np.outer(weight[:, peak[1]], weight[peak[0]]) / weight[peak]
    if np.abs(product - weight).max() > SEPARABLE * np.abs(weight).max():
        return None
    channel = np.ones(weight.shape, complex)
    channel[row, column] = array.channel
    if np.abs(channel - channel[0]).max() > SEPARABLE:
        return None
    return columns, rows, weight, channel
