"""Sums over echoes at elements, of which the levers are known: J v, and Jᵀ w.

    J v     Σ_h a_h (dα_h - 2πi (f₀ + f) dτ_he) exp(-2πi f₀ τ_he) k       the fast sums, each echo as strong as it moves
    Jᵀ w    what the transposed sums give of each echo, times its levers                          `signal.gathering`

dτ and dα -> of `Motion` by `Levers`. The factor -2πi (f₀ + f) is that of the spectrum, see `signal.impulses.Later`.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.device.types import Float, Int32, UInt32
from mitsonar.propagation.returns.straight_vectors import dot
from mitsonar.signal.accumulation import ImpulseResponses, OfPair
from mitsonar.signal.gathering import EchoPairs, GatheredWeights
from mitsonar.survey.pressure.pairs import seen_from
from mitsonar.survey.pressure.ping_source import opaque

from .levers import Levers, Motion, mirrored


class DelayTangents(ImpulseResponses):
    """Sum how responses change as echoes come later. Its kernel is `signal.impulses.Later`."""

    def __init__(self, like: type, motion: Motion, **how: Any):
        super().__init__(like, **how)
        self._motion = motion

    def bound(self, levers: Levers) -> _Bound:
        """Return what echoes of these levers are added to."""
        motion = self._motion
        place = mirrored(levers.back, motion.place)
        sent = mirrored(levers.out, motion.place + motion.tx[levers.sender])
        scene = [a + b for a, b in zip(levers.towards, levers.shift)]
        common = dot(levers.shift, _opaque(place)) + dot(levers.sent, _opaque(sent))
        more: list[Float] = []
        if levers.ends is not None:
            moved = motion.target[levers.ends.target]
            target = [_uploaded(part) for part in moved.T]
            out = at_target(levers.sent, _uploaded(levers.ends.out))
            common -= dot(out, target)
            more = [*levers.shift, _uploaded(levers.ends.back), *target]
        common = common * levers.scale + levers.late * dr.opaque(mi.Float, float(motion.tx_delay[levers.sender]))
        moves = mirrored(levers.back, motion.rx) + place
        hits = [*levers.towards, levers.curvature, levers.scale, common, *more]
        dr.eval(hits, scene)

        def later(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            seen = seen_from((hit[0], hit[1], hit[2]), (at[0], at[1], at[2]), hit[3])
            moved = dot(seen, at[3:6])
            if more:
                seen = [a + b for a, b in zip(seen, hit[6:9])]
                moved -= dot(at_target(seen, hit[9]), hit[10:13])
            return dr.fma(hit[4], moved, hit[5])

        return _Bound(self, hits, [*levers.offsets.T, *moves.T], later)


class StrengthTangents(ImpulseResponses):
    """Sum how responses change as echoes get stronger."""

    def __init__(self, like: type, motion: Motion, **how: Any):
        super().__init__(like, **how)
        self._motion = motion

    def bound(self, levers: Levers) -> _Bound:
        """Return what echoes of these levers are added to."""
        stronger: Any = dr.opaque(mi.Float, float(self._motion.tx_strength[levers.sender]))
        if levers.ends is not None:
            of_target = self._motion.target_strength[levers.ends.target]
            stronger += _uploaded(of_target)
        return _Bound(self, [stronger], [], lambda hit, at: hit[0])


def at_target(seen: Sequence[Float], ratio: Float) -> list[Float]:
    """h of the module `element_levers`, from vectors towards the target and (c/c_x)², negative where rays have turned.
    """
    steep = dr.sqrt(dr.maximum(abs(ratio) - dr.fma(seen[0], seen[0], seen[1] * seen[1]), 0))
    return [seen[0], seen[1], dr.mulsign(steep, seen[2] * ratio)]


def _opaque(vector: np.ndarray) -> list[Float]:
    return opaque(mi.Float, vector)


def _uploaded(values: np.ndarray) -> Float:
    return upload(arrays_of(mi.Float).Float, values.astype(np.float32))


@dataclass(frozen=True, kw_only=False, eq=False)
class _Bound:
    """What echoes are added to, each times a factor of its own at each element."""

    sums: ImpulseResponses
    hits: list[Float]
    elements: list[np.ndarray]
    factor: OfPair

    def add(self, *, hit_fields: Sequence[Float], element_fields: Sequence[Float | np.ndarray], difference: OfPair,
            gain: OfPair | None = None, rows: np.ndarray, **echoes: Any) -> None:
        """Add the echoes of hits at elements; see `ImpulseResponses.add`."""
        n, m = len(hit_fields), len(element_fields)

        def product(hit: Sequence[Float], at: Sequence[Float]) -> Float:
            own = self.factor(hit[n:], at[m:])
            return own if gain is None else own * gain(hit[:n], at[:m])

        rows = np.ravel(rows)
        self.sums.add(hit_fields=[*hit_fields, *self.hits],
                      element_fields=[*element_fields, *(part[rows] for part in self.elements)],
                      difference=lambda hit, at: difference(hit[:n], at[:m]), gain=product, rows=rows, **echoes)


class DelayGradients:
    """Sum the gradient of a number by what makes echoes later."""

    def __init__(self, weights: GatheredWeights, total: Motion):
        self._weights, self._total = weights, total

    def bound(self, levers: Levers) -> _Gathering:
        """Return what echoes of these levers are gathered by."""
        hits = [*levers.towards, levers.curvature, levers.scale, *levers.shift, *levers.sent, levers.late]
        return _Gathering(self._of_targets if levers.ends is not None else self._of_echoes, levers, hits,
                          list(levers.offsets.T))

    def _of_echoes(self, levers: Levers, pairs: EchoPairs, n: int, m: int) -> None:
        def of_echo(real: Float, _: Float, hit: Sequence[Float], at: Sequence[Float]) -> tuple[list, list]:
            hit, at = hit[n:], at[m:]
            moved = real * hit[4]
            seen = seen_from((hit[0], hit[1], hit[2]), (at[0], at[1], at[2]), hit[3])
            return ([moved * part for part in seen], [*(moved * part for part in hit[5:11]), real * hit[11]])

        each, common = self._weights.gather(pairs, of_echo)
        self._add(levers, pairs.rows, each, common[:3], common[3:6], common[6])

    def _add(self, levers: Levers, rows: np.ndarray, each: np.ndarray, shift: np.ndarray, sent: np.ndarray,
             late: float) -> None:
        """Add forces at elements, what they lack to be those on the platform, and those at the transmitter."""
        total, sent = self._total, mirrored(levers.out, sent)
        total.rx[rows] += mirrored(levers.back, each)
        total.place[:] += mirrored(levers.back, each.sum(0) + shift) + sent
        total.tx[levers.sender] += sent
        total.tx_delay[levers.sender] += late

    def _of_targets(self, levers: Levers, pairs: EchoPairs, n: int, m: int) -> None:
        """The same of few echoes, pair by pair on the host, with the forces at the targets."""
        ends = levers.ends
        assert ends is not None
        u = np.real(self._weights.of_pairs(pairs))
        count = len(u)
        vectors = [np.stack([np.broadcast_to(part.numpy(), count) for part in vector], 1).astype(float)
                   for vector in (levers.towards, levers.shift, levers.sent)]
        curvature, scale, late = (np.broadcast_to(part.numpy(), count).astype(float)
                                  for part in (levers.curvature, levers.scale, levers.late))
        towards, shift, sent = vectors
        seen = towards[:, None] - levers.offsets[pairs.rows] * curvature[:, None, None]
        seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
        moved = u * scale[:, None]
        each, by_hit = np.einsum("he,hex->ex", moved, seen), moved.sum(1)
        self._add(levers, pairs.rows, each, by_hit @ shift, by_hit @ sent, float(u.sum(1) @ late))
        ahead = _slowness(seen + shift[:, None], ends.back[:, None])
        force = np.einsum("he,hex->hx", moved, ahead) + by_hit[:, None] * _slowness(sent, ends.out)
        np.subtract.at(self._total.target, ends.target, force)


class StrengthGradients:
    """Sum the gradient of a number by what makes echoes stronger; parameters as of `DelayGradients`."""

    def __init__(self, weights: GatheredWeights, total: Motion):
        self._weights, self._total = weights, total

    def bound(self, levers: Levers) -> _Gathering:
        """Return what echoes of these levers are gathered by."""
        return _Gathering(self._of_echoes, levers, [], [])

    def _of_echoes(self, levers: Levers, pairs: EchoPairs, n: int, m: int) -> None:
        if levers.ends is None:
            _, common = self._weights.gather(pairs, lambda real, imaginary, hit, at: ([], [real]))
            self._total.tx_strength[levers.sender] += common[0]
            return
        by_hit = np.real(self._weights.of_pairs(pairs)).sum(1)
        self._total.tx_strength[levers.sender] += by_hit.sum()
        np.add.at(self._total.target_strength, levers.ends.target, by_hit)


def _slowness(seen: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """`at_target` on the host: (..., 3)."""
    steep = np.sqrt(np.maximum(np.abs(ratio) - seen[..., 0] ** 2 - seen[..., 1] ** 2, 0))
    return np.stack([seen[..., 0], seen[..., 1], steep * np.sign(seen[..., 2]) * np.sign(ratio)], -1)


@dataclass(frozen=True, kw_only=False, eq=False)
class _Gathering:
    """What echoes are gathered by, with fields of their own."""

    gather: Callable[[Levers, EchoPairs, int, int], None]
    levers: Levers
    hits: list[Float]
    elements: list[np.ndarray]

    def add(self, *, amplitude: tuple[Float, Float], phase: Float, sample: Int32, fraction: Float,
            hit_fields: Sequence[Float], element_fields: Sequence[Float | np.ndarray], difference: OfPair,
            gain: OfPair | None = None, rows: np.ndarray, sheet: UInt32 | None = None) -> None:
        """Gather what the echoes of hits are at elements; arguments as of `ImpulseResponses.add`."""
        n, m, rows = len(hit_fields), len(element_fields), np.ravel(rows)
        pairs = EchoPairs(amplitude=amplitude, phase=phase, sample=sample, fraction=fraction,
                          hit_fields=[*hit_fields, *self.hits], rows=rows,
                          element_fields=[*element_fields, *(part[rows] for part in self.elements)],
                          difference=lambda hit, at: difference(hit[:n], at[:m]),
                          gain=None if gain is None else lambda hit, at: gain(hit[:n], at[:m]), sheet=sheet)
        self.gather(self.levers, pairs, n, m)
