"""Pings that find out for their neighbours where rays are needed.

The first pass of a ping tells which cells of its table lead into time bins that few rays reach (`ray_need`). Pings of a
group ask one of them, the scout. Its table is carried to their own roll and height (`side_launch.SideLaunch.carried`):
far off, a degree of roll is worth the range over the height. It decides where rays go, never what they weigh.

    |x_i - x_s| + R |e_i - e_s| < w R

x -> position, e -> forward axis of the body, R -> ``farthest``, w -> ``width``: a ping asks its scout s where both see
ground in common at the end of the record, else it is a scout itself. Nearer by, the scout's answer is that of ground
beside the ping's. Groups are numbered in the whole survey: blocks do not matter.
"""
import numpy as np

from ..sonar.track import Track

__all__ = ["GROUP", "scouts"]

GROUP = 4                          # pings that may have a scout in common


def scouts(track: Track, farthest: float, width: float) -> np.ndarray:
    """Give the number of the ping that each ping asks, (P,) int.

    Parameters
    ----------
    track : Track
    farthest : float [m]
        Slant range where the record ends.
    width : float [rad]
        Of the beam along the track.
    """
    ping = np.arange(track.pings)
    scout = np.minimum(ping // GROUP * GROUP + GROUP // 2, track.pings - 1)
    position, forward = track.position, track.rotation()[..., 0]
    apart = np.linalg.norm(position - position[scout], axis=-1)
    apart += farthest * np.linalg.norm(forward - forward[scout], axis=-1)
    return np.where(apart < width * farthest, scout, ping)
