"""How much later echoes come when elements, the platform or point targets move: levers of each pair.

An arrival is stationary in the way of its ray (Fermat), so that its time changes by the slowness at the ends alone. An
echo is sent at r_t from a platform at rest, is met, and is heard at r_e of a platform that moves at v:

    dτ = ρ [-u_t·dr_t - u_e·dr_e + (h_t + h_e)·dx] / c + f dt_t,     ρ = 1 / (1 + u_e·v / c)

u_t, u_e -> unit vectors at the elements towards the echo, c -> sound speed there, dx -> move of what is met, dt_t ->
delay of the transmitter, f -> the pulse's own time scale. In layered water a ray keeps its horizontal slowness, so that
at what is met, where sound runs at c_x,

    h = (u_x, u_y, ± √((c/c_x)² - u_x² - u_y²))

u_e is u at the array's centre turned by the curvature of the wavefront, as elements' patterns have it. Left out: what
spreading, absorption, patterns and strengths of scattering change by, 1/(k R) of what the phase does.

What moves of a ping's echoes at elements, and what of it each parameter moves: scene coordinates, one ping.

The platform at x with the attitude R carries element e at x + R r_e. With offsets of place and attitude p and θ

    d(x + R r_e) = dp + Σ_k dθ_k (∂R/∂θ_k) r_e + R dr_e

The first is the same for all elements and does not turn with the array on the way; the others do.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, picked
from mitsonar.device.types import Float, UInt32
from mitsonar.echoes.record import Echoes
from mitsonar.propagation.returns.travel import rotated
from mitsonar.signal.accumulation import ImpulseResponses
from mitsonar.survey.pressure.delays import ALL_ROWS
from mitsonar.survey.pressure.doppler import time_scale
from mitsonar.survey.pressure.echo_classes import SortedEchoes
from mitsonar.survey.pressure.eigenrays import EigenrayDelays
from mitsonar.survey.pressure.pairs import CURVATURE, seen_from
from mitsonar.survey.pressure.ping_source import View, opaque
from mitsonar.survey.pressure.vectors import GuardedDelays, VectorDelays


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """A direction in which a ping's echoes may change, or the gradient of a number by each part of it."""

    place: np.ndarray  # (3,) [m]: of the platform
    rx: np.ndarray  # (E, 3) [m]: of elements, besides, as the platform stands at the transmission
    tx: np.ndarray  # (E, 3) [m]: of elements, besides, as the platform stands at the transmission
    tx_delay: np.ndarray  # (T,) [s]
    tx_strength: np.ndarray  # (T,) [-]: relative change of what an element sends
    target: np.ndarray  # (K, 3) [m]: of point targets
    target_strength: np.ndarray  # (K,) [-]: relative change of their pressures

    @classmethod
    def none(cls, *, receivers: int, senders: int, targets: int) -> Motion:
        """Nothing moves; arrays that may be added to."""
        return cls(place=np.zeros(3), rx=np.zeros((receivers, 3)), tx=np.zeros((senders, 3)),
                   tx_delay=np.zeros(senders), tx_strength=np.zeros(senders), target=np.zeros((targets, 3)),
                   target_strength=np.zeros(targets))

    @property
    def delays(self) -> bool:
        """Return whether echoes come later or earlier by it."""
        return any(np.any(part) for part in (self.place, self.rx, self.tx, self.tx_delay, self.target))

    @property
    def strengths(self) -> bool:
        """Return whether echoes get stronger or weaker by it."""
        return bool(np.any(self.tx_strength) or np.any(self.target_strength))


MOST_OF_TARGETS = 64               # echoes of a target in a block, with taps
SAME_PLACE = 1e-6                  # [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ends:
    """Which of a block's echoes came from which point target, on the host."""

    target: np.ndarray  # (H,)
    out: np.ndarray  # (H,) [-]: (c/c_x)² of the legs, negative where the ray has turned up or down on its way
    back: np.ndarray  # (H,) [-]: (c/c_x)² of the legs, negative where the ray has turned up or down on its way

    def chosen(self, index: np.ndarray) -> Ends:
        """Those of some echoes."""
        return Ends(target=self.target[index], out=self.out[index], back=self.back[index])


@dataclass(frozen=True, kw_only=True, eq=False)
class Levers:
    """Of a block of echoes from one transmit element."""

    sender: int
    out: View  # of the platform, by the legs there and back
    back: View  # of the platform, by the legs there and back
    towards: list[Float]  # (H,): unit vectors from the source towards echoes, as the array was at the transmission
    curvature: Float  # (H,) [1/m]
    shift: list[Float]  # (H,): what these vectors lack to be those in scene coordinates at the reception
    sent: list[Float]  # (H,): unit vectors from the transmit element
    scale: Float  # (H,) [s/m]: -ρ / c
    late: Float  # (H,) [-]: f
    offsets: np.ndarray  # (E, 3) [m]: of receive elements
    ends: Ends | None  # of echoes of point targets

    def chosen(self, index: UInt32) -> Levers:
        """Those of some echoes."""
        def of(vector: list[Float]) -> list[Float]:
            return [picked(part, index) for part in vector]

        return Levers(sender=self.sender, out=self.out, back=self.back, towards=of(self.towards),
                      curvature=picked(self.curvature, index), shift=of(self.shift), sent=of(self.sent),
                      scale=picked(self.scale, index), late=picked(self.late, index), offsets=self.offsets,
                      ends=None if self.ends is None else self.ends.chosen(index.numpy()))


def mirrored(view: View, vector: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) of the scene as a view sees them."""
    return vector * np.sign([1.0, 1.0, view.depth]) if view.depth < 0 else vector


class TargetEnds:
    """Tell which echoes are those of point targets."""
    # position (K, 3) [m]

    def __init__(self, position: np.ndarray):
        self.position = position

    def of(self, echoes: Echoes, out: View, back: View, origin: np.ndarray) -> Ends | None:
        """Return the ends of a block of echoes; None where it is not one of targets."""
        if not len(self.position) or echoes.count > MOST_OF_TARGETS * len(self.position):
            return None
        start = mirrored(out, origin)
        point = np.stack([np.broadcast_to(part.numpy(), echoes.count) for part in echoes.out.offset], 1) + start
        away = np.linalg.norm(point[:, None] - self.position, axis=2)
        which = away.argmin(1)
        if not np.all(away[np.arange(len(which)), which] < SAME_PLACE):
            return None
        return Ends(target=which, out=self._ratio(echoes.out, out, which), back=self._ratio(echoes.back, back, which))

    def _ratio(self, leg: Any, view: View, which: np.ndarray) -> np.ndarray:
        """(c/c_x)² of a leg, signed."""
        here, there = view.profile.at(view.depth), view.profile.at(-self.position[which, 2])
        turned = np.sign(leg.launch_direction.z.numpy()) * np.sign(leg.offset.z.numpy()) < 0
        return (here / there) ** 2 * np.where(turned, -1, 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class LeveredDelays(GuardedDelays):
    """Delays as the record's, whose sums know how far each echo moves with what."""

    targets: TargetEnds = field(default_factory=lambda: TargetEnds(np.zeros((0, 3))))

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS) -> None:
        """Sum the echoes of one transmit element; `responses` bind levers. See `ElementDelays.add`."""
        vector, sums = self.changed_to(VectorDelays), cast(Any, responses)
        doubtful = vector.doubtful(some.echoes) if self._extended else None
        levers = self.levers(some.echoes, element)
        vector.add(sums.bound(levers), some, element, weight=weight, rows=rows, without=doubtful)
        if doubtful is not None:
            exact = compressed(doubtful)
            if dr.width(exact):
                self.changed_to(EigenrayDelays).add(sums.bound(levers.chosen(exact)), some.chosen(exact), element,
                                                    weight=weight, rows=rows)

    def levers(self, echoes: Echoes, element: int) -> Levers:
        """Make the levers of echoes from one transmit element."""
        source, lib = self.source, arrays_of(mi.Float)
        out, view, off = source.view(echoes.out), source.view(echoes.back), self.stands_off(element)
        sent, met = [lib.Float(part) for part in echoes.out.launch_direction], echoes.arrival
        if off:
            way_out = source.way_out(echoes)
            offset = opaque(mi.Float, out.offsets(self.transmit)[element])
            sent = seen_from(cast(Any, sent), cast(Any, offset), way_out.hit_fields[CURVATURE])
        back = source.way_back(echoes)
        total, speed = met + back.return_time, dr.opaque(lib.Float64, source.speed)
        scene = [-lib.Float64(part) for part in back.direction]
        towards = [lib.Float(part) for part in rotated(cast(Any, scene), view.travel.turned(total), back=True)]
        closing = sum(part * lib.Float64(v) for part, v in zip(scene, view.travel.velocity(total)))
        scale = -lib.Float(1 / (speed + closing))
        late = 1 / time_scale(source, echoes, sender=self.transmit.position[element],
                              receiver=self.source.position)[0]
        levers = Levers(sender=element, out=out, back=view, towards=towards, curvature=back.hit_fields[CURVATURE],
                        shift=[lib.Float(part) - seen for part, seen in zip(scene, towards)], sent=sent, scale=scale,
                        late=lib.Float(late), offsets=view.offsets(self.receive),
                        ends=self.targets.of(echoes, out, view, source.origin))
        dr.eval(levers.towards, levers.curvature, levers.shift, levers.sent, levers.scale, levers.late)
        return levers
