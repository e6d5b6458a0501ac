"""Compute changes of delay and strength of echoes when elements, the platform or point targets move, for each pair.

An arrival is stationary in the path of its ray (Fermat): its time changes by the slowness at the ends alone. An echo is
sent at r_t from a platform at rest, scattered, and received at r_e by a platform that moves at v:

    dτ = ρ [-u_t·dr_t - u_e·dr_e + (h_t + h_e)·dx] / c + f dt_t,     ρ = 1 / (1 + u_e·v / c)

u_t, u_e -> unit vectors at the elements towards the echo, c -> sound speed there, dx -> displacement of the scatterer,
dt_t -> delay of the transmitter, f -> the pulse's own time scale. In layered water a ray keeps its horizontal slowness,
so that at the scatterer, where the sound speed is c_x,

    h = (u_x, u_y, ± √((c/c_x)² - u_x² - u_y²))

u_e is u at the array's centre turned by the curvature of the wavefront, as in the patterns of elements. Left out are
changes of spreading, absorption, patterns and scattering strength, 1/(k R) of the change of phase. Over the echoes,

    J v     Σ_h a_h (dα_h - 2πi (f₀ + f) dτ_he) exp(-2πi f₀ τ_he) k       fast sums, each echo weighted by its change
    Jᵀ w    the same dτ and dα, differentiated by Dr.Jit pair by pair                            `signal.gathering`

The factor -2πi (f₀ + f) is that of the spectrum, see `signal.impulses.Later`.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeAlias, cast

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, compressed, picked, upload
from mitsonar.device.rotations import rotated
from mitsonar.device.types import Float, UInt32
from mitsonar.echoes.record import Echoes, EchoLeg
from mitsonar.propagation.returns.return_paths import ReturnPaths
from mitsonar.propagation.returns.straight_vectors import dot
from mitsonar.signal.accumulation import ImpulseResponses, OfPair
from mitsonar.signal.gathering import DelayChange, EchoPairs, GatheredWeights
from mitsonar.survey.pressure.delays import ALL_ROWS
from mitsonar.survey.pressure.doppler import time_scale
from mitsonar.survey.pressure.echo_classes import SortedEchoes
from mitsonar.survey.pressure.eigenrays import EigenrayDelays
from mitsonar.survey.pressure.pairs import CURVATURE, seen_from
from mitsonar.survey.pressure.ping_source import View, opaque
from mitsonar.survey.pressure.vectors import GuardedDelays, VectorDelays

MOST_OF_TARGETS = 64               # echoes of a target in a block, with taps
SAME_PLACE = 1e-6                  # [m]

Motion: TypeAlias = dict[str, Any]     # of a ping, by `ElementParameters.motion`


@dataclass(frozen=True, kw_only=True, eq=False)
class LeverEnds:
    """Hold numbers (H,) of the point targets of a block's echoes, and (c/c_x)² (H,) of the legs out and back.

    The ratio is negative where the ray has turned up or down on its way.
    """

    target: UInt32
    out: Float
    back: Float

    def chosen(self, index: UInt32) -> LeverEnds:
        """Return the rows of some echoes."""
        return LeverEnds(target=picked(self.target, index), out=picked(self.out, index), back=picked(self.back, index))


@dataclass(frozen=True, kw_only=True, eq=False)
class Levers:
    """Hold levers of a block of echoes from one transmit element."""

    sender: int
    out: View  # of the platform on the legs out and back
    back: View
    hits: list[Float]  # (H,)
    offsets: np.ndarray  # (E, 3) [m]: of receive elements
    ends: LeverEnds | None  # of echoes of point targets

    def chosen(self, index: UInt32) -> Levers:
        """Return the rows of some echoes."""
        return Levers(sender=self.sender, out=self.out, back=self.back, hits=[picked(hit, index) for hit in self.hits],
                      offsets=self.offsets, ends=None if self.ends is None else self.ends.chosen(index))


class LeverTargetEnds:
    """Find the echoes of point targets at positions (K, 3) [m]."""

    def __init__(self, position: np.ndarray):
        self.position = position

    def of(self, echoes: Echoes, out: View, back: View, origin: np.ndarray) -> LeverEnds | None:
        """Return the ends of a block of echoes, or None if they are not those of targets."""
        if not len(self.position) or echoes.count > MOST_OF_TARGETS * len(self.position):
            return None
        start = origin * [1, 1, -1] if out.depth < 0 else origin
        point = np.stack([np.broadcast_to(part.numpy(), echoes.count) for part in echoes.out.offset], 1) + start
        away = np.linalg.norm(point[:, None] - self.position, axis=2)
        which = away.argmin(1)
        if not np.all(away[np.arange(len(which)), which] < SAME_PLACE):
            return None
        return LeverEnds(target=upload(mi.UInt32, which.astype(np.uint32)), out=self._ratio(echoes.out, out, which),
                    back=self._ratio(echoes.back, back, which))

    def _ratio(self, leg: EchoLeg, view: View, which: np.ndarray) -> Float:
        """Return (c/c_x)² of a leg, negative where the ray has turned."""
        here, there = view.profile.at(view.depth), view.profile.at(-self.position[which, 2])
        turned = np.sign(leg.launch_direction.z.numpy()) * np.sign(leg.offset.z.numpy()) < 0
        ratio = (here / there) ** 2 * np.where(turned, -1, 1)
        return upload(arrays_of(mi.Float).Float, ratio.astype(np.float32))


@dataclass(frozen=True, kw_only=True, eq=False)
class LeveredDelays(GuardedDelays):
    """Compute the delays of the record, with the levers of each echo."""

    targets: LeverTargetEnds = field(default_factory=lambda: LeverTargetEnds(np.zeros((0, 3))))

    def add(self, responses: ImpulseResponses, some: SortedEchoes, element: int, *, weight: float,
            rows: slice = ALL_ROWS) -> None:
        """Sum the echoes of one transmit element; `responses` bind levers. See `ElementDelays.add`."""
        vector, sums = self.changed_to(VectorDelays), cast(Any, responses)
        some, back = some.with_way_back(self.source)
        doubtful = vector.doubtful(some.echoes, back) if self._extended else None
        levers = self.levers(some.echoes, element, back)
        vector.add(sums.bound(levers), some, element, weight=weight, rows=rows, without=doubtful)
        if doubtful is not None:
            exact = compressed(doubtful)
            if dr.width(exact):
                self.changed_to(EigenrayDelays).add(sums.bound(levers.chosen(exact)), some.chosen(exact), element,
                                                    weight=weight, rows=rows)

    def levers(self, echoes: Echoes, element: int, back: ReturnPaths) -> Levers:
        """Return the levers of echoes from one transmit element, which come back along given paths."""
        source, lib = self.source, arrays_of(mi.Float)
        out, view, off = source.view(echoes.out), source.view(echoes.back), self.stands_off(element)
        sent, met = [lib.Float(part) for part in echoes.out.launch_direction], echoes.arrival
        if off:
            way_out = source.way_out(echoes)
            offset = opaque(mi.Float, out.offsets(self.transmit)[element])
            sent = seen_from(cast(Any, sent), cast(Any, offset), way_out.hit_fields[CURVATURE])
        total, speed = met + back.return_time, dr.opaque(lib.Float64, source.speed)
        scene = [-lib.Float64(part) for part in back.direction]
        towards = [lib.Float(part) for part in rotated(cast(Any, scene), view.travel.turned(total), back=True)]
        closing = sum(part * lib.Float64(v) for part, v in zip(scene, view.travel.velocity(total)))
        late = 1 / time_scale(source, echoes, back, sender=self.transmit.position[element],
                              receiver=self.source.position)[0]
        hits = [*towards, back.hit_fields[CURVATURE], -lib.Float(1 / (speed + closing)),
                *(lib.Float(part) - seen for part, seen in zip(scene, towards)), *sent, lib.Float(late)]
        dr.eval(hits)
        return Levers(sender=element, out=out, back=view, hits=hits, offsets=view.offsets(self.receive),
                      ends=self.targets.of(echoes, out, view, source.origin))


# ---- what a motion does to echoes: linear functions, of which Dr.Jit makes the transposes


class Quantity(NamedTuple):
    """Hold a changing property of echoes: the numbers (own, shared) from a motion, and a function of them."""

    given: Callable[[Levers, Motion], tuple[list, list]]
    factor: Callable[[Sequence[Float], Sequence[Float], Sequence[Float], Sequence[Float]], Float]

    def hits(self, levers: Levers) -> list[Float]:
        """Return the fields of hits that the function reads."""
        ends = levers.ends
        return [*levers.hits, *([] if ends is None else [ends.out, ends.back])]


def _moves(levers: Levers, motion: Motion) -> tuple[list, list]:
    """Return displacements of receive elements [m]; those of platform, transmit element and targets, and its delay."""
    sender = mi.UInt32(levers.sender)
    place, back = _mirrored(levers.back, motion["place"]), _mirrored(levers.back, motion["rx"])
    sent = _mirrored(levers.out, motion["place"] + picked(motion["tx"], sender))
    shared = [*place, *sent, picked(motion["tx_delay"], sender)]
    return [*(back + place)], shared if levers.ends is None else [
        *shared, *dr.gather(type(place), motion["target"], levers.ends.target)]


def _strengthens(levers: Levers, motion: Motion) -> tuple[list, list]:
    """Return the relative change of the sent amplitude and of the target's echo."""
    stronger = picked(motion["tx_strength"], mi.UInt32(levers.sender))
    if levers.ends is not None:
        stronger = stronger + picked(motion["target_strength"], levers.ends.target)
    return [], [stronger]


def _later(hit: Sequence[Float], at: Sequence[Float], own: Sequence[Float], shared: Sequence[Float]) -> Float:
    """Return dτ [s] of a hit at an element with an offset."""
    seen = seen_from(cast(Any, hit[:3]), cast(Any, at[:3]), hit[3])
    common = dot(hit[5:8], shared[:3]) + dot(hit[8:11], shared[3:6])
    if len(shared) > 7:
        heard = [a + b for a, b in zip(seen, hit[5:8])]
        common -= dot(_at_target(hit[8:11], hit[12]), shared[7:]) + dot(_at_target(heard, hit[13]), shared[7:])
    return dr.fma(hit[4], dot(seen, own) + common, hit[11] * shared[6])


def _at_target(seen: Sequence[Float], ratio: Float) -> list[Float]:
    """Return h for vectors towards the target and (c/c_x)²."""
    steep = dr.sqrt(dr.maximum(abs(ratio) - dr.fma(seen[0], seen[0], seen[1] * seen[1]), 0))
    return [seen[0], seen[1], dr.mulsign(steep, seen[2] * ratio)]


def _mirrored(view: View, vector: Any) -> Any:
    """Return vectors of the scene in the frame of a view."""
    return type(vector)(vector.x, vector.y, -vector.z) if view.depth < 0 else vector


DELAYS = Quantity(_moves, _later)
STRENGTHS = Quantity(_strengthens, lambda hit, at, own, shared: shared[0])


class Tangents(ImpulseResponses):
    """Sum the changes of responses when a motion changes a quantity; delays take the kernel `signal.impulses.Later`."""

    def __init__(self, like: type, quantity: Quantity, motion: Motion, **how: Any):
        super().__init__(like, **how)
        self._quantity, self._motion = quantity, motion

    def bound(self, levers: Levers) -> _BoundTangents:
        """Return the sums for echoes with these levers."""
        return _BoundTangents(levers, self._quantity, self._motion, self)


class Gradients(NamedTuple):
    """Gather the gradient by a motion for weights of responses, and add it to the gradients of `motion`."""

    weights: GatheredWeights
    quantity: Quantity
    motion: Motion

    def bound(self, levers: Levers) -> _BoundGradients:
        """Return the gathering for echoes with these levers."""
        return _BoundGradients(levers, self.quantity, self.motion, self.weights)


class _BoundTangents(NamedTuple):
    levers: Levers
    quantity: Quantity
    motion: Motion
    sums: ImpulseResponses

    def add(self, *, hit_fields: Sequence[Float], element_fields: Sequence[Float | np.ndarray], difference: OfPair,
            gain: OfPair | None = None, rows: np.ndarray, **echoes: Any) -> None:
        """Add the echoes of hits, each weighted by its change; see `ImpulseResponses.add`."""
        n, m, hits, rows = len(hit_fields), len(element_fields), self.quantity.hits(self.levers), np.ravel(rows)
        own, shared = ([mi.Float(part) for part in parts] for parts in self.quantity.given(self.levers, self.motion))
        dr.make_opaque(own, shared)
        first, last, index = n + len(hits), m + 3, upload(mi.UInt32, rows.astype(np.uint32))

        def product(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            factor = self.quantity.factor(hit[n:first], at[m:last], at[last:], hit[first:])
            return factor if gain is None else factor * gain(hit[:n], at[:m])

        self.sums.add(hit_fields=[*hit_fields, *hits, *shared], gain=product, rows=rows,
                      element_fields=[*element_fields, *self.levers.offsets[rows].T,
                                      *(picked(part, index) for part in own)],
                      difference=lambda hit, at: difference(hit[:n], at[:m]), **echoes)


class _BoundGradients(NamedTuple):
    levers: Levers
    quantity: Quantity
    motion: Motion
    weights: GatheredWeights

    def add(self, *, hit_fields: Sequence[Float], element_fields: Sequence[Float | np.ndarray], difference: OfPair,
            gain: OfPair | None = None, rows: np.ndarray, **echoes: Any) -> None:
        """Gather the gradients of echoes at elements; arguments are those of `ImpulseResponses.add`."""
        n, m, rows = len(hit_fields), len(element_fields), np.ravel(rows)
        pairs = EchoPairs(hit_fields=[*hit_fields, *self.quantity.hits(self.levers)], rows=rows,
                          element_fields=[*element_fields, *self.levers.offsets[rows].T],
                          difference=lambda hit, at: difference(hit[:n], at[:m]),
                          gain=None if gain is None else lambda hit, at: gain(hit[:n], at[:m]), **echoes)
        index = upload(mi.UInt32, rows.astype(np.uint32))
        with dr.resume_grad():
            own, shared = self.quantity.given(self.levers, self.motion)
            change = DelayChange(lambda hit, at, own, shared: self.quantity.factor(hit[n:], at[m:], own, shared),
                                 len(own),
                            len(shared))
            if self.levers.ends is None:
                each, common = self.weights.gather(pairs, change)
            else:
                found = self.weights.of_pairs(pairs, change)
                each, common = found[:len(own)].sum(1).T, found[len(own):].sum(2)
            numbers = [*(picked(part, index) for part in own), *shared]
            for number, slope in zip(numbers, [*each.T, *common], strict=True):
                slope = np.ravel(slope if dr.width(number) == np.size(slope) else np.sum(slope))
                dr.accum_grad(number, mi.Float64(slope))
                dr.enqueue(dr.ADMode.Backward, number)
            dr.traverse(dr.ADMode.Backward)
