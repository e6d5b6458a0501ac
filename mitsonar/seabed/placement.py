"""Random placement of bodies on a bed: species, pose, burial and position, with a least spacing.

Target number k has two random streams (seed, k): one for its properties, one for its positions. It takes the first
position that is free of earlier targets. Its position therefore does not depend on later targets, nor its properties on
its position.
"""
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

import numpy as np

from .bed import Bed
from .bodies import Body, turn_onto

TRIES = 1000                       # positions tried for a target
MOST_MISSES = 20                   # targets without room before placement stops
SMALLEST, LARGEST = 1e-3, 100.0    # [m]: size of a target; otherwise its file is not in metres
_SAMPLES = 9                       # samples of the bed's height along either side of a footprint

Box: TypeAlias = tuple[float, float, float, float]    # [m] west, south, east, north


@dataclass(frozen=True, kw_only=True)
class Rules:
    """Distributions of targets; a pair holds the bounds of a uniform distribution.

    Parameters
    ----------
    area : (float, float, float, float) [m], optional
        West, south, east and north; targets lie completely inside. Default: the bounds of the bed.
    exclude : array (E, 4) [m]
        Boxes like `area` that targets must not touch.
    spacing : float [m]
        Least distance between the bounding circles of two targets.
    scale, burial : (float, float) [-]
        Factor of size; share of the height below the bed.
    heading : (float, float) [rad]
        Compass heading of the front.
    tilt : (float, float) [rad]
        Angle of tilt from the pose, in a uniformly random direction.
    pose : str
        "upright": as in the mesh; "rest": a stable pose, with the probability after a fall; "any": uniformly random
        attitude.
    height : (float, float) [m]
        Height over where the target would rest: fish, moored mines.
    along_slope : bool
        True to stand normal to the bed under the footprint instead of vertically.
    weights : array (B,), optional
        Relative frequency of each body; equal by default.
    """

    area: tuple[float, float, float, float] | None = None
    exclude: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    spacing: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)
    burial: tuple[float, float] = (0.0, 0.0)
    height: tuple[float, float] = (0.0, 0.0)
    heading: tuple[float, float] = (0.0, 2 * np.pi)
    tilt: tuple[float, float] = (0.0, 0.0)
    pose: Literal["upright", "rest", "any"] = "upright"
    along_slope: bool = False
    weights: np.ndarray | None = None


@dataclass(frozen=True, kw_only=True, eq=False)
class Placed:
    """Body in its position on the bed.

    Attributes
    ----------
    number : int
        Number of the target, from 1.
    body : Body
        Placed body.
    position : array (3,) [m]
        Middle of the footprint, at the mean height of the bed there.
    radius : float [m]
        Radius of the bounding circle around `position`, seen from above.
    heading, tilt, tilt_heading : float [rad]
        Compass heading of the front; angle between the upward axis of the pose and the vertical (or the normal of the
        bed); compass heading of the tilt.
    scale, burial : float [-]
        Factor of size; share of the height below the bed.
    height : float [m]
        Height over where the body would rest.
    vertices : array (V, 3) [m]
        Vertices of the body in scene coordinates.
    """

    number: int
    body: Body
    position: np.ndarray
    radius: float
    heading: float
    tilt: float
    tilt_heading: float
    scale: float
    burial: float
    height: float
    vertices: np.ndarray


def draw_count(low: int, high: int, seed: int | Sequence[int]) -> int:
    """Draw an integer from `low` to `high`, both included; for `seed` see `place`."""
    return int(np.random.default_rng([*np.atleast_1d(seed), 0]).integers(low, high, endpoint=True))


def place(bodies: Sequence[Body], bed: Bed, rules: Rules, *, count: int, seed: int | Sequence[int],
          taken: Sequence | np.ndarray = (), crowded: Literal["refuse", "fewer"] = "refuse") -> list[Placed]:
    """Return targets placed at random on a bed.

    Parameters
    ----------
    bodies : sequence of Body
        Species to draw from.
    bed : Bed
        Seabed under the targets.
    rules : Rules
        Distributions of the targets.
    count : int
        Number of targets.
    seed : int or sequence of int
        Seed, at least 0.
    taken : array (T, 3) [m]
        Circles (x, y, radius) that are occupied already.
    crowded : {'refuse', 'fewer'}
        For a target without room: raise an error, or leave it out.

    Returns
    -------
    list of Placed
        Placed targets, without the numbers of targets left out.

    Raises
    ------
    ValueError
        If a body is too small or too large, the area has no seabed, or `crowded` is "refuse" and a target finds no
        room.

    Notes
    -----
    A body rests with its lowest point on a plane through the bed under its footprint (the rectangle around it, along
    and across its heading): the level plane at the mean height, or with ``along_slope`` the plane of best fit. It is
    then lowered by the share ``burial`` of its height over that plane.
    """
    for body in bodies:
        for scale in rules.scale:
            if not SMALLEST <= body.size * scale <= LARGEST:
                raise ValueError(f"the mesh {body.name} is {body.size * scale:.4g} m long at a scale of {scale:g}; "
                                 f"targets measure {SMALLEST:g} to {LARGEST:g} m: is the file in metres? If not, set "
                                 "scale")
    west, south, east, north = bed.bounds if rules.area is None else rules.area
    area = west, south, east, north
    if not all(area[k] < bed.bounds[k + 2] and area[k + 2] > bed.bounds[k] for k in (0, 1)):
        # for example eastings and northings of a survey
        asked, bounds = (", ".join(f"{edge:.0f}" for edge in edges) for edges in (area, bed.bounds))
        raise ValueError(f"the area {asked} lies beside the seabed, which is {bounds} (west, south, east, north) in "
                         "metres from the scene's origin; give the area in these coordinates")
    circles = np.empty((len(taken) + count, 3))
    circles[:len(taken)] = np.reshape(taken, (-1, 3))
    done, misses = [], 0
    for number in range(1, count + 1):
        others = circles[:len(taken) + len(done)]
        target = _draw(bodies, bed, rules, area, others, number, seed)
        if target is None and crowded == "fewer":
            misses += 1
            if misses == MOST_MISSES:
                break
            continue
        if target is None:
            west, south, east, north = area
            less = f"fewer, a spacing below {rules.spacing:g} m," if rules.spacing else "fewer"
            raise ValueError(f"only {len(done)} of {count} targets found room on {east - west:g} x {north - south:g} m "
                             f"(x from {west:g}, y from {south:g}), the next none in {TRIES} tries; use {less} or a "
                             "larger area of seabed")
        circles[len(others)] = *target.position[:2], target.radius
        done.append(target)
    return done


def _draw(bodies: Sequence[Body], bed: Bed, rules: Rules, area: Box, others: np.ndarray, number: int,
          seed: int | Sequence[int]) -> Placed | None:
    """Return the target of a number, or None without room."""
    stream = np.random.default_rng([*np.atleast_1d(seed), number])
    share = stream.random(7)                                           # always all, so that rules stay independent
    attitude = stream.normal(size=4)
    lift = float(stream.uniform(*rules.height))                        # last, as it came last: older draws stay
    odds = np.ones(len(bodies)) if rules.weights is None else np.asarray(rules.weights, float)
    body = bodies[int(np.searchsorted(np.cumsum(odds) / odds.sum(), share[0], side="right"))]
    scale, heading, tilt, burial = (low + part * (high - low) for part, (low, high) in
                                    zip(share[1:5], (rules.scale, rules.heading, rules.tilt, rules.burial)))
    tilt_heading = 2 * np.pi * share[5]
    # first into the frame of the heading, where the footprint is a rectangle, then into the scene
    towards = tilt_heading - heading
    up = np.sin(tilt) * np.sin(towards), np.sin(tilt) * np.cos(towards), np.cos(tilt)
    lean = turn_onto((0.0, 0.0, 1.0), up) @ _pose(body, rules.pose, share[6], attitude)
    cosine, sine = np.cos(-heading), np.sin(-heading)
    turned = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
    corners = scale * body.outline @ lean.T
    low, high = corners.min(axis=0), corners.max(axis=0)
    middle = np.array([*(low + high)[:2] / 2, low[2]])                 # of the footprint, at its lowest point
    corners = (corners - middle) @ turned.T
    corners[:, 2] -= burial * (high - low)[2]
    grid = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5
    footprint = np.stack(np.meshgrid(*(grid * side for side in (high - low)[:2])), -1).reshape(-1, 2) @ turned[:2, :2].T
    for spot in _places(area, _radius(corners), number, seed):
        x, y = spot
        if not _free(x, y, _radius(corners), area, rules, others):
            continue
        ground = bed.heights(*(spot + footprint).T)
        if np.isnan(ground).any():
            continue                                                   # a hole, or the edge of the bed
        slope = _upright(footprint, ground) if rules.along_slope else np.eye(3)
        radius = _radius(corners @ slope.T)
        if rules.along_slope and not _free(x, y, radius, area, rules, others):
            continue                                                   # a tilted body is wider
        position = np.array([*spot, ground.mean()])
        vertices = (scale * body.vertices @ lean.T - middle) @ turned.T
        vertices[:, 2] += lift - burial * (high - low)[2]
        return Placed(number=number, body=body, position=position, radius=radius, heading=heading, tilt=tilt,
                      tilt_heading=tilt_heading, scale=scale, burial=burial, height=lift,
                      vertices=vertices @ slope.T + position)
    return None


def _places(area: Box, radius: float, number: int, seed: int | Sequence[int]) -> Iterator[np.ndarray]:
    """Yield uniformly random points (2,) [m] whose circle lies inside the area."""
    west, south, east, north = area
    low, high = np.array([west + radius, south + radius]), np.array([east - radius, north - radius])
    if (low <= high).all():
        yield from low + np.random.default_rng([*np.atleast_1d(seed), number, 1]).random((TRIES, 2)) * (high - low)


def _free(x: float, y: float, radius: float, area: Box, rules: Rules, others: np.ndarray) -> bool:
    """Return True if a circle lies in the area, outside excluded boxes, and far enough from other circles."""
    west, south, east, north = area
    slack = 1e-9 * max(1.0, abs(x), abs(y))
    if min(x - west, east - x, y - south, north - y) < radius - slack:
        return False
    boxes = np.reshape(rules.exclude, (-1, 4))
    nearest = np.clip(x, boxes[:, 0], boxes[:, 2]), np.clip(y, boxes[:, 1], boxes[:, 3])
    if (np.hypot(nearest[0] - x, nearest[1] - y) < radius).any():
        return False
    return not (np.hypot(others[:, 0] - x, others[:, 1] - y) < others[:, 2] + radius + rules.spacing).any()


def _radius(corners: np.ndarray) -> float:
    return float(np.hypot(corners[:, 0], corners[:, 1]).max())


def _pose(body: Body, pose: str, share: float, attitude: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of a body into its pose, from a random share (0 to 1) and four normal deviates."""
    if pose == "upright":
        return np.eye(3)
    if pose == "any":
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(np.roll(attitude, -1)).as_matrix()   # normal deviates give uniform attitudes
    rotations, probability = body.rest_poses
    return rotations[int(np.searchsorted(np.cumsum(probability), share, side="right").clip(0, len(rotations) - 1))]


def _upright(footprint: np.ndarray, ground: np.ndarray) -> np.ndarray:
    """Return the rotation (3, 3) of the vertical onto the normal of the bed under a footprint."""
    (east, north), *_ = np.linalg.lstsq(footprint, ground - ground.mean(), rcond=None)
    normal = np.array([-east, -north, 1.0])
    return turn_onto((0.0, 0.0, 1.0), normal / np.linalg.norm(normal))
