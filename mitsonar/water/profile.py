"""Sound-speed profile c(depth) that refracts the rays.

    c(d) = c_k + g_k (d - d_k)    between the nodes d_k <= d <= d_{k+1}, g_k = (c_{k+1} - c_k) / (d_{k+1} - d_k)
    c(d) = c_0 above the first node, c_K below the last

d -> ``depth`` [m, positive down], c -> ``sound_speed`` [m/s], g -> ``gradient`` [1/s].
"""
from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike

from mitsonar.units import Values

DEEPEST = 1e6                      # [m]: float32 still resolves a sixteenth of a metre
_SIDES: dict[str, Literal["left", "right"]] = {"below": "right", "above": "left"}    # of a node, in NumPy's terms
SAME_DEPTH = 0.005                 # [m]: a measured node replaces closer nodes
SLOWEST, FASTEST = 300.0, 3000.0  # [m/s], exclusive: air is slower, no liquid for a sonar is faster


@dataclass(frozen=True, eq=False, init=False)
class SoundSpeedProfile:
    """Sound speed against depth, linear between nodes and constant beyond the ends.

    Parameters
    ----------
    depth : array (K,) [m]
        Node depths, positive down, strictly increasing, at least one (one node: constant speed).
    sound_speed : array (K,) [m/s]
        Sound speed at the nodes, 300 < c < 3000.

    Raises
    ------
    ValueError
        If the arrays differ in length or are empty, a number is not finite, depths do not increase or a sound
        speed is out of range; the message has the first wrong node.

    Notes
    -----
    The arrays are read-only float64 copies. Profiles with equal nodes are equal.
    """

    depth: np.ndarray
    sound_speed: np.ndarray

    def __init__(self, depth: ArrayLike, sound_speed: ArrayLike):
        nodes, speeds = _as_column("depth", depth), _as_column("sound_speed", sound_speed)
        _check(nodes, speeds)
        object.__setattr__(self, "depth", nodes)
        object.__setattr__(self, "sound_speed", speeds)

    @classmethod
    def constant(cls, sound_speed: float) -> SoundSpeedProfile:
        """Return the profile of water with one sound speed [m/s]."""
        return cls([0.0], [sound_speed])

    def mirrored(self) -> SoundSpeedProfile:
        """Return the profile with the water below the surface mirrored above it."""
        return type(self)(*mirrored(self.depth, self.sound_speed))

    def lifted(self, height: float) -> SoundSpeedProfile:
        """Return the profile of water whose surface lies `height` [m] above depth 0; itself if nothing changes."""
        return self if height == 0 or len(self.depth) == 1 else type(self)(self.depth - height, self.sound_speed)

    def upside_down(self) -> SoundSpeedProfile:
        """Return the profile of the water upside down, in which upward rays go down."""
        return type(self)(-self.depth[::-1], self.sound_speed[::-1])

    @property
    def gradients(self) -> np.ndarray:
        """Return dc/d(depth) (K + 1,) [1/s] above the first node, between nodes, and below the last."""
        return np.r_[0.0, np.diff(self.sound_speed) / np.diff(self.depth), 0.0]

    def with_node(self, depth: float, sound_speed: float) -> SoundSpeedProfile:
        """Return the profile with one more node, such as a measurement at the sonar's head.

        Parameters
        ----------
        depth : float [m]
        sound_speed : float [m/s]
            Replaces nodes within 5 mm of the depth. The profile is linear from the new node to its neighbours, as in
            the real-time processing of multibeam sonars (`mitsonar.hydrography.reduction.legs`).

        Raises
        ------
        ValueError
            If a number is out of range, or the profile has no node below the depth: all deeper water would then have
            the speed of the new node.
        """
        if not depth + SAME_DEPTH < self.depth[-1]:
            raise ValueError(f"sound-speed profile: a node at {depth:g} m is not above the last of the profile, at "
                             f"{self.depth[-1]:g} m; give a profile that goes deeper.")
        kept = np.abs(self.depth - depth) > SAME_DEPTH
        place = int(np.searchsorted(self.depth[kept], depth))
        return type(self)(np.insert(self.depth[kept], place, depth),
                          np.insert(self.sound_speed[kept], place, sound_speed))

    def mixed(self, other: SoundSpeedProfile, share: float) -> SoundSpeedProfile:
        """Return the profile between this one, share 0, and another, share 1, at the nodes of both."""
        nodes = np.union1d(self.depth, other.depth)
        return type(self)(nodes, (1 - share) * self.at(nodes) + share * other.at(nodes))

    def at(self, depth: Values) -> Values:
        """Return the sound speed [m/s] at ``depth`` [m], any shape."""
        return cast(Values, np.interp(depth, self.depth, self.sound_speed))

    def extremes(self, top: float, bottom: float) -> tuple[float, float]:
        """Return the lowest and the highest sound speed between two depths [m/s]."""
        between = (self.depth > top) & (self.depth < bottom)
        speeds = [self.at(top), self.at(bottom), *self.sound_speed[between]]
        return float(min(speeds)), float(max(speeds))

    def gradient(self, depth: Values, side: Literal["below", "above"] = "below") -> Values:
        """Return dc/d(depth) [1/s] at ``depth`` [m], any shape.

        It is zero beyond the ends; at a node, it is the gradient of the layer "below" or "above" by ``side``.
        """
        return cast(Values, self.gradients[np.searchsorted(self.depth, depth, side=_SIDES[side])])

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, SoundSpeedProfile):
            return NotImplemented
        return np.array_equal(self.depth, other.depth) and np.array_equal(self.sound_speed, other.sound_speed)

    def __hash__(self) -> int:
        return hash((self.depth.tobytes(), self.sound_speed.tobytes()))


def mirrored(depth: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the nodes of a column of water below the surface, with the same water mirrored above it."""
    below = depth > 0
    depth, values = np.r_[0.0, depth[below]], np.r_[np.interp(0.0, depth, values), values[below]]
    return np.r_[-depth[:0:-1], depth], np.r_[values[:0:-1], values]


def _as_column(name: str, values: ArrayLike) -> np.ndarray:
    try:
        column = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise ValueError(f"sound-speed profile: {name} must be a list of numbers, got {values!r}.") from None
    if column.ndim != 1 or column.size == 0:
        raise ValueError(f"sound-speed profile: {name} must be a one-dimensional list of at least one number, "
                         f"got shape {column.shape}.")
    column += 0.0  # turns -0.0 into 0.0, so that equal profiles have equal hashes
    column.flags.writeable = False
    return column


def _check(depth: np.ndarray, sound_speed: np.ndarray) -> None:
    if depth.size != sound_speed.size:
        raise ValueError(f"sound-speed profile: {depth.size} depths but {sound_speed.size} sound speeds; "
                         "give one sound speed for each depth.")
    for name, column in (("depth", depth), ("sound_speed", sound_speed)):
        bad = np.flatnonzero(~np.isfinite(column))
        if bad.size:
            raise ValueError(f"sound-speed profile: {name}[{bad[0]}] is {column[bad[0]]}; "
                             "remove or repair nodes that are not finite numbers.")
    bad = np.flatnonzero(np.abs(depth) > DEEPEST)
    if bad.size:
        raise ValueError(f"sound-speed profile: depth[{bad[0]}] = {depth[bad[0]]:g} m is beyond +-{DEEPEST:g} m; check "
                         "columns and units.")
    bad = np.flatnonzero(np.diff(depth) <= 0)
    if bad.size:
        k = bad[0] + 1
        raise ValueError(f"sound-speed profile: depths must increase downwards, but depth[{k}] = {depth[k]:g} m "
                         f"follows depth[{k - 1}] = {depth[k - 1]:g} m; sort the nodes and merge repeated depths.")
    bad = np.flatnonzero((sound_speed <= SLOWEST) | (sound_speed >= FASTEST))
    if bad.size:
        raise ValueError(f"sound-speed profile: sound_speed[{bad[0]}] = {sound_speed[bad[0]]:g} m/s at "
                         f"{depth[bad[0]]:g} m is outside {SLOWEST:g}..{FASTEST:g} m/s; check columns and units.")
