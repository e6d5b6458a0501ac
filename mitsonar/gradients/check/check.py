"""Whether gradients are what they say: forward, backward and differences of a record must be one.

    w·(J v) = (Jᵀ w)·v                                  forward and backward               (asymmetry)
    w·(J v) = [w·F(x + h v) - ...] / h                  derivative and difference          (error)
    J (v_1 + v_2 + ...) = J v_1 + J v_2 + ...           together and alone

F -> `ForwardModel.value`, whose chance stands still; v -> smooth directions of one parameter alone, w -> slow weights
of the record (`check_directions`). The error is the rms over both of derivative less difference, over the larger rms
of the two: 0 is right, 1 a gradient of zero, 2 a wrong sign. The difference is good to how far two steps agree;
where they do not, shadows or edges cross bins, and nothing is decided.

Of few rays the derivative itself is grainy: it jumps with every ray that passes from bin to bin or from facet to facet,
while differences over a step are its mean there. So an error is held against how derivatives scatter within the step.

Records that swing about zero, as the signals of elements do, are also looked at under a weight that swings as their
derivative does: a slow weight would see little of them.
"""
from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from mitsonar.device.spelling import meant

from ..model import ForwardModel
from .differences import Difference, Line, difference_at, first_step, settled_step
from .directions import Part, generator, parts, slow_weights
from .table import DISCONNECTED, OFF, RIGHT, UNDECIDED, UNSEEN, GradientCheck, PartCheck

ZERO = 1e-6                        # a derivative is zero that is this share of the difference
STILL = 1e-7                       # change of a weighted record, as a share, that is rounding
NOISE = 1e-5                       # the same, where differences do not agree either, or forward and backward do not
SCATTERED = 3.0                    # errors up to so many times the scatter of derivatives within a step are chance
WANDERED, WIDER = 0.5, 4           # of an error that larger steps, so many, differ by, from which edges may be why
SWINGS = 0.2                       # share of a record's size that is below zero


def check_gradients(model: ForwardModel, keys: Sequence[str] | None = None, *, directions: int = 3,
                    tolerance: float = 0.01, seed: int = 0,
                    progress: Callable[[int, int], object] | None = None) -> GradientCheck:
    """Compare a model's derivatives forward, backward, and with differences, each parameter alone."""
    keys = _keys(model, keys)
    if directions < 1:
        raise ValueError(f"directions is {directions}; give 1 or more")
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance is {tolerance:g}; give a share between 0 and 1, such as 0.01")
    empty = [PartCheck(key=key, unit=model.units.get(key, ""), size=0, verdict=UNSEEN, notes=("it is empty",))
             for key in keys if np.size(model.start[key]) == 0]
    todo = [(key, part) for key in keys
            for part in parts(np.asarray(model.start[key], float), directions, generator(seed, key))]
    checker = _Checker(model, tolerance, seed)
    products = [checker.products(key, part) for key, part in todo]         # before the model is anywhere else
    extra, rows = checker.together(todo), []
    for number, ((key, part), derivatives) in enumerate(zip(todo, products, strict=True)):
        rows.append(checker.row(key, part, derivatives))
        if progress is not None:
            progress(number + 1, len(todo))
    rows += empty + extra + checker.afterwards(todo, products)
    return GradientCheck(rows=tuple(rows), directions=directions, tolerance=tolerance, told=checker.told)


@dataclass(frozen=True, kw_only=True)
class _Products:
    """Derivatives of weighted sums of a record: weights (W, N), forward and backward (direction, W)."""

    weights: np.ndarray
    forward: np.ndarray
    backward: np.ndarray


class _Checker:
    """Makes the rows of one model."""

    def __init__(self, model: ForwardModel, tolerance: float, seed: int):
        self._model, self._tolerance = model, tolerance
        self._base = model.value(model.start)
        self._about = about = model.linearised(model.start)
        self.told: dict[str, float] = dict(getattr(about, "told", {}))
        if not np.isfinite(self._base).any() or not np.any(self._base[np.isfinite(self._base)]):
            raise ValueError("the record is empty: nothing in it has a gradient; let the sonar hear something")
        shape = getattr(model, "shape", self._base.shape)
        self._size = np.abs(np.nan_to_num(self._base, posinf=0.0, neginf=0.0))
        self._slow = slow_weights(self._base, shape, generator(seed, ""))
        finite = self._base[np.isfinite(self._base)]
        self._swings = -finite[finite < 0].sum() > SWINGS * np.abs(finite).sum()
        self._notes = self._of_records(about)

    def products(self, key: str, part: Part) -> _Products | PartCheck:
        """Return the derivatives of a part, or what is wrong with them."""
        moves = [self._about.forward({key: direction}) for direction in part.directions]
        broken = sum(int(np.count_nonzero(~np.isfinite(move) & np.isfinite(self._base))) for move in moves)
        if broken:
            return self._failed(key, part, OFF, f"forward derivatives are not finite in {broken} places")
        weights = self._weights(moves)
        used = np.any(weights != 0, axis=0)
        forward = np.stack([weights @ np.where(used, move, 0.0) for move in moves])
        back = [self._about.backward(weight)[key] for weight in weights]
        broken = sum(int(np.count_nonzero(~np.isfinite(gradient))) for gradient in back)
        if broken:
            return self._failed(key, part, OFF, f"gradients are not finite in {broken} places")
        backward = np.array([[np.sum(gradient * direction) for gradient in back] for direction in part.directions])
        return _Products(weights=weights, forward=forward, backward=backward)

    def row(self, key: str, part: Part, products: _Products | PartCheck) -> PartCheck:
        """Return what is found of a part."""
        if isinstance(products, PartCheck):
            return products
        start = np.asarray(self._model.start[key], float)
        lines = [self._line(key, start, direction, products.weights) for direction in part.directions]
        try:
            step = settled_step(lines[0], first_step(start, self._model.units.get(key, "")))
            differences = [difference_at(line, step) for line in lines]
        except ValueError as error:
            return self._failed(key, part, UNDECIDED, str(error))
        return self._judged(key, part, products, differences, step)

    def _line(self, key, start, direction, weights):
        return Line(lambda distance: self._model.value({key: start + distance * direction}), self._base, weights)

    def _failed(self, key, part, verdict, note):
        return PartCheck(**self._named(key, part), verdict=verdict, notes=(note,))

    def _named(self, key, part):
        return {"key": key, "part": part.name, "unit": self._model.units.get(key, ""),
                "size": np.size(self._model.start[key])}

    def together(self, todo: Sequence[tuple[str, Part]]) -> list[PartCheck]:
        """Say if all parameters that move at once do not move the record by the sum of what each does."""
        first: dict[str, np.ndarray] = {}
        for key, part in todo:
            first.setdefault(key, part.directions[0])
        if len(first) < 2:
            return []
        alone = np.sum([self._about.forward({key: direction}) for key, direction in first.items()], axis=0)
        return self._same("all together", self._about.forward(first), alone,
                          "their derivatives are not the sum of each one's")

    def afterwards(self, todo: Sequence[tuple[str, Part]],
                   products: Sequence[_Products | PartCheck]) -> list[PartCheck]:
        """Say if a linearisation is another after the model was asked for other values."""
        for (key, part), before in zip(todo, products, strict=True):
            if isinstance(before, _Products) and np.any(before.forward[0]):
                used = np.any(before.weights != 0, axis=0)
                after = before.weights @ np.where(used, self._about.forward({key: part.directions[0]}), 0.0)
                return self._same("the same again", after, before.forward[0],
                                  "a linearisation does not stay the same once the model is asked for other values")
        return []

    def _same(self, name, found, expected, note):
        there = np.isfinite(expected)
        error = _share((found - expected)[there], expected[there])
        return [] if error <= self._tolerance else [
            PartCheck(key=name, unit="", size=0, verdict=OFF, error=error, notes=(note,))]

    def _of_records(self, about):
        """What is wrong with the records themselves."""
        notes = []
        empty = int(np.count_nonzero(~np.isfinite(self._base)))
        if empty:
            notes.append(f"{empty} of {self._base.size} values of the record are not finite, and have no weight")
        finite = np.isfinite(self._base)
        error = _share((about.value - self._base)[finite], self._base[finite])
        if not error <= self._tolerance:
            notes.append(f"the record with derivatives differs from that without by {error:.1e}")
        return tuple(notes)

    def _weights(self, moves):
        if not self._swings or not np.any(moves[0]):
            return self._slow
        like = np.where(np.isfinite(self._base), moves[0], 0.0) * np.abs(self._slow[0])
        return np.vstack([self._slow, like / (np.abs(like) @ self._size)])

    def _judged(self, key, part, products, differences: list[Difference], step):
        weights, forward, backward = products.weights, products.forward, products.backward
        best = np.stack([one.best for one in differences])
        size = max(_rms(best), _rms(forward))
        moved = max(one.moved for one in differences)
        numbers = {"step": step, "moved": moved}
        if size > 0:
            apart = np.stack([one.coarse - one.fine for one in differences])
            numbers |= {"error": _rms(best - forward) / size, "asymmetry": _rms(forward - backward) / size,
                        "disagreement": _rms(apart) / size}
        if np.any(forward):
            numbers["slope"] = float(np.sum(best * forward) / np.sum(forward ** 2))
        zero = max(_rms(forward), _rms(backward)) <= ZERO * size
        expected = 4 * step * float((np.abs(forward) / (np.abs(weights) @ self._size)).max(initial=0.0))
        first = first_step(np.asarray(self._model.start[key], float), self._model.units.get(key, ""))
        apart = np.abs(forward - backward) * first / (np.abs(weights) @ self._size)
        verdict, notes = self._verdict(numbers, zero, max(moved, expected), bool(apart.max(initial=0.0) > NOISE))
        if verdict == OFF and numbers["error"] > self._tolerance:
            scatter = self._scatter(key, part, products, step) / size
            if numbers["error"] < SCATTERED * scatter:
                verdict, notes = UNDECIDED, (*notes, "derivatives scatter within a step: more rays or smaller bins of "
                                                     "the record, or smoother shapes, tell more")
        if verdict == OFF and numbers["error"] > self._tolerance:
            spread = max((_rms(np.stack([one.best for one in wider]) - best) / size for wider in self._wider(
                key, part, products.weights, step)), default=0.0)
            if spread > WANDERED * numbers["error"]:
                verdict, notes = UNDECIDED, (*notes, "differences are others at larger steps: too few rays cross "
                                                     "shadows or edges at this one; more rays tell more")
        if verdict == UNSEEN:                                          # nothing but rounding to compare
            numbers = {"step": step, "moved": moved}
        return PartCheck(**self._named(key, part), **numbers, verdict=verdict, notes=(*self._notes, *notes))

    def _wider(self, key, part, weights, step):
        """Differences of all directions at the larger steps that are tried."""
        start = np.asarray(self._model.start[key], float)
        largest = first_step(start, self._model.units.get(key, ""))
        lines = [self._line(key, start, direction, weights) for direction in part.directions]
        for wider in [step * 4.0 ** power for power in range(1, WIDER + 1) if step * 4.0 ** power <= largest]:
            try:
                yield [difference_at(line, wider) for line in lines]
            except ValueError:                                         # moved to where no record can be made
                return

    def _scatter(self, key, part, products, step):
        """Rms over directions and weights of how far derivatives within a step lie from a parabola."""
        start, places = np.asarray(self._model.start[key], float), np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
        used = np.any(products.weights != 0, axis=0)
        left = []
        for direction, here in zip(part.directions, products.forward, strict=True):
            found = np.array([here if place == 0 else products.weights @ np.where(used, self._model.linearised(
                {key: start + place * step * direction}).forward({key: direction}), 0.0) for place in places])
            bends = np.stack([places ** power for power in range(3)], 1)
            fit = bends @ np.linalg.lstsq(bends, found, rcond=None)[0]
            left.append((found - fit) * np.sqrt(len(places) / (len(places) - bends.shape[1])))
        return _rms(np.concatenate(left))

    def _verdict(self, numbers, zero, moves, two_ways):
        error, apart, tolerance = numbers.get("error", 0.0), numbers.get("disagreement", 0.0), self._tolerance
        shaken = apart > tolerance
        words = ("differences do not converge: shadows or edges",) if shaken else ()
        if moves < STILL or (zero and moves < NOISE and apart > 0.5):
            return UNSEEN, ()
        if zero:
            return DISCONNECTED, (*words, f"the record moves by {numbers['moved']:.1e}, and its gradient is zero")
        if numbers["asymmetry"] > tolerance and two_ways:
            return OFF, (*words, f"forward and backward derivatives differ by {numbers['asymmetry']:.1e}")
        if any("differs from" in note for note in self._notes):
            return OFF, words
        if shaken and apart > 0.5 * error:
            return UNDECIDED, words
        return (RIGHT if error <= tolerance else OFF), words


def _keys(model, keys):
    if keys is None:
        return list(model.start)
    for key in keys:
        if key not in model.start:
            raise ValueError(f"there is no parameter {key!r}{meant(key, model.start)}; there are "
                             f"{', '.join(model.start)}")
    return list(dict.fromkeys(keys))


def _rms(values):
    """Over directions and weights: these are scaled alike, and one that nearly cancels shall not count for more."""
    return float(np.sqrt(np.mean(np.square(values))))


def _share(wrong, right):
    size = float(np.linalg.norm(right))
    return float(np.linalg.norm(wrong)) / size if size > 0 else 0.0 if not np.any(wrong) else np.inf
