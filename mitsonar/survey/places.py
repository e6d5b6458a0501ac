"""Where the pings of a block stand while they are sent, and how their echoes are heard: look-ups on the device."""
import drjit as dr
import mitsuba as mi
import numpy as np

from ..device.arrays import upload
from ..device.chance import row_keys
from .underway import Reception

__all__ = ["Place"]


class Place:
    """Look-ups by a ping's number within the block.

    Parameters
    ----------
    lib : Dr.Jit namespace
    ping : (B,) int
        Numbers of the pings in the survey.
    position, rotation : (B, 3) [m], (B, 3, 3)
        At transmission.
    source : (B,) int
        Index of each into `sources`.
    sources : trace.Sources
    motion : underway.Motion or None
        How they go on; None: they stand still.
    kind : (B, 2) uint32
        As `underway.Underway.shifts` gives them.
    """

    def __init__(self, lib, ping, position, rotation, source, sources, motion, kind):
        self.lib, self.rows, self.sources = lib, 2 * len(ping), sources
        self.motion, self.still = motion, motion is None
        # a seed per ping and side, from the ping's number in the survey
        number = 2 * np.repeat(ping.astype(np.uint64), 2) + np.tile(np.arange(2, dtype=np.uint64), len(ping))
        self.key = upload(mi.UInt32, row_keys(number))
        self._position = upload(mi.Float64, np.concatenate([position, np.zeros((len(ping), 1))], 1))
        rows = np.concatenate([rotation, np.zeros((len(ping), 3, 1))], 2)
        self._rotation = upload(mi.Float, rows.astype(np.float32))
        self._source = upload(mi.UInt32, source.astype(np.uint32))
        self._kind = upload(mi.UInt32, kind)
        dr.eval(self.key, self._position, self._rotation, self._source, self._kind)

    def origin(self, ping):
        """Position of the sonar, Array3f64 [m]."""
        row = dr.gather(self.lib.Array4f64, self._position, ping)
        return self.lib.Array3f64(row[0], row[1], row[2])

    def kind(self, row):
        """Which table of directions along the body rays are drawn by."""
        return mi.UInt32(0) if self.still else dr.gather(mi.UInt32, self._kind, row)

    def source(self, ping):
        """Index into the fans."""
        return dr.gather(mi.UInt32, self._source, ping)

    def medium(self, ping):
        """Depth [m] and sound speed [m/s] at the sonar, float32."""
        depth, speed, _ = self.sources.state.gather(self.lib, self.source(ping))
        return mi.Float(depth), mi.Float(speed)

    def body(self, ping, direction):
        """Scene directions to body directions."""
        rows = [dr.gather(self.lib.Array4f, self._rotation, 3 * ping + i) for i in range(3)]
        return mi.Vector3f(*(sum(row[k] * part for row, part in zip(rows, direction)) for k in range(3)))

    def receive(self, ping, towards, offset, delay):
        """How echoes from points `offset` [m] off are heard whose two-way time is `delay` if the sonar stands still."""
        if self.still:
            return Reception(delay=delay, towards=towards)
        return self.motion.receive(ping, towards, mi.Float(dr.norm(offset)), delay, self.medium(ping)[1])

    def turn(self, ping, body):
        """Body directions to scene directions."""
        x, y, z = (dr.gather(self.lib.Array4f, self._rotation, 3 * ping + i) for i in range(3))
        return mi.Vector3f(*(r[0] * body.x + r[1] * body.y + r[2] * body.z for r in (x, y, z)))
