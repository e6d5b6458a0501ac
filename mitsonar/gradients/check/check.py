"""Check gradients: forward and backward derivatives and differences of a record must agree.

    w·(J v) = (Jᵀ w)·v                                  forward and backward               (asymmetry)
    w·(J v) = [w·F(x + h v) - ...] / h                  derivative and difference          (error)
    J (v_1 + v_2 + ...) = J v_1 + J v_2 + ...           together and alone
    D(h) = [f(-2h) - 8 f(-h) + 8 f(h) - f(2h)] / 12h = f' - h⁴ f⁽⁵⁾ / 30 + ...

F -> `ForwardModel.value`, with fixed random numbers; v -> smooth directions of one parameter alone, w -> slow weights
of the record, f -> w·F, h -> the step. The error is the rms over v and w of derivative less difference, over the larger
rms of the two: 0 is right, 1 a gradient of zero, 2 a wrong sign.

Large steps have errors of curvature, small ones of rounding, and shadows or edges leave no good step. The step is
halved from a large one on until D(h) and D(h/2) agree best, without use of gradients. Where they do not agree, the
check is undecided. Derivatives of few rays are grainy: they jump with every ray that passes from bin to bin or from
facet to facet. Errors are therefore compared with the scatter of derivatives within the step. Records that swing about
zero, such as signals, are also checked under a weight that swings as their derivative does.
"""
from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from mitsonar.device.progress import counted, each_of, shares
from mitsonar.device.spelling import meant

from ..model import ForwardModel, left_out, shape_of
from .directions import generator, parts, slow_weights

if TYPE_CHECKING:
    import xarray as xr

RIGHT, OFF, NOT_DIFFERENTIATED = "right", "off", "not differentiated"
DISCONNECTED = "disconnected"      # the gradient is zero, the difference is not
UNSEEN = "unseen"                  # the record does not depend on it, by either
UNDECIDED = "undecided"            # differences at two steps disagree by more than what is asked
NUMBERS = {"error": "of derivatives, as a share of what they are: rms over directions and weights",
           "slope": "of differences over derivatives",
           "asymmetry": "of forward and backward derivatives, as a share",
           "disagreement": "of differences at two steps, as a share",
           "step": "of the differences, in the unit of the parameter",
           "moved": "change of the weighted record between the outermost steps, as a share"}
ZERO = 1e-6                        # a derivative is zero that is this share of the difference
STILL = 1e-7                       # change of a weighted record, as a share, that is rounding
NOISE = 1e-5                       # the same, where differences do not agree either, or forward and backward do not
SCATTERED = 3.0                    # times the scatter of derivatives within a step, up to which errors are chance
WANDERED, WIDER = 0.5, 4           # of an error that larger steps, so many, differ by, from which edges may be why
SWINGS = 0.2                       # share of a record's size that is below zero
HALVINGS = 14
AGREED = 1e-5                      # that no smaller step is tried for
BENT = 0.3                         # change of a record, as a share of its size, of which the step is too large
NEXT_TO_STILL = 1e-6               # change of weighted sums, as a share, of which the step is small enough
FIRST = {"1 and m": 0.05, "dB/m": 0.01, "m": 0.05, "m/s": 2.0, "rad": 0.02, "dB": 1.0, "s": 1e-4, "degC": 0.5}
SHARE = 0.1                        # of a parameter's size: the first step where its unit tells none


@dataclass(frozen=True, kw_only=True)
class PartCheck:
    """Verdict on a component or an index of a parameter of `size` numbers; figures are those of `NUMBERS`, or NaN."""

    key: str
    unit: str
    size: int
    verdict: str
    part: str = ""
    error: float = np.nan
    slope: float = np.nan
    asymmetry: float = np.nan
    disagreement: float = np.nan
    step: float = np.nan
    moved: float = np.nan
    notes: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Parameter and part."""
        return f"{self.key} {self.part}".rstrip()


@dataclass(frozen=True, kw_only=True)
class GradientCheck:
    """Verdicts on the parameters of a model."""

    rows: tuple[PartCheck, ...]
    directions: int  # directions of each part, at most
    tolerance: float  # error up to which a derivative is right
    told: Mapping[str, float] = field(default_factory=dict)

    @property
    def wrong(self) -> tuple[PartCheck, ...]:
        """Parts that are off or disconnected."""
        return tuple(row for row in self.rows if row.verdict in (OFF, DISCONNECTED))

    @property
    def undecided(self) -> tuple[PartCheck, ...]:
        """Parts on which differences could not decide."""
        return tuple(row for row in self.rows if row.verdict == UNDECIDED)

    def text(self) -> str:
        """Return the table as text; notes on several parts are written once."""
        def cells(row: PartCheck) -> tuple[str, ...]:
            error, asymmetry, disagreement = ("-" if np.isnan(share) else f"{share:.1e}"
                                              for share in (row.error, row.asymmetry, row.disagreement))
            unit = "" if row.unit in ("", "1") else f" {row.unit}"
            return (row.name, row.verdict, error, "-" if np.isnan(row.slope) else f"{row.slope:.4f}", asymmetry,
                    disagreement, "-" if np.isnan(row.step) else f"{row.step:.2g}{unit}")

        lines = [("parameter", "verdict", "error", "slope", "forward/backward", "two steps", "step"),
                 *map(cells, self.rows)]
        widths = [max(map(len, column)) for column in zip(*lines)]
        shown = ["  ".join(cell.ljust(width) for cell, width in zip(line, widths)).rstrip() for line in lines]
        said: dict[str, list[str]] = {}
        for row in self.rows:
            for note in row.notes:
                said.setdefault(note, []).append(row.name)
        return "\n".join([*shown, *(f"{', '.join(names)}: {note}" for note, names in said.items()),
                          *(f"{name}: {share:.1%}" for name, share in self.told.items())])

    def to_dataset(self) -> xr.Dataset:
        """Return the table as a dataset with one dimension, `row`."""
        import xarray as xr

        columns: dict = {name: ("row", [getattr(row, name) for row in self.rows])
                         for name in ("key", "part", "unit", "verdict")}
        columns["size"] = ("row", np.array([row.size for row in self.rows], np.int64))
        columns |= {name: ("row", np.array([getattr(row, name) for row in self.rows], float), {"long_name": text})
                    for name, text in NUMBERS.items()}
        columns["notes"] = ("row", ["; ".join(row.notes) for row in self.rows])
        return xr.Dataset(columns, attrs={
            "title": "Gradients against differences", "directions": self.directions, "tolerance": self.tolerance,
            **{f"share_{name.replace(' ', '_')}": float(share) for name, share in self.told.items()}})


def check_parameters(model_of: Callable[[str], ForwardModel], keys: Sequence[str], *, refuse: bool = False,
                     progress: Callable[[float, float], object] | None = None, **options: Any) -> GradientCheck:
    """Check parameters by models that `model_of` makes for one each; `options` are those of `check_gradients`.

    A parameter without a model is reported as not differentiated; with `refuse` the error is raised.
    """
    rows, told, whole = [], {}, shares(progress, len(keys))
    for number, key in enumerate(keys):
        try:
            model = model_of(key)
        except ValueError as error:
            if refuse:
                raise
            rows.append(PartCheck(key=key, unit="", size=0, verdict=NOT_DIFFERENTIATED, notes=(str(error),)))
            continue
        found = check_gradients(model, [key], **options, progress=counted(each_of(whole, number, len(keys))))
        rows += found.rows
        told |= {name: max(share, told.get(name, share)) for name, share in found.told.items()}
    return GradientCheck(rows=tuple(rows), directions=options.get("directions", 3),
                         tolerance=options.get("tolerance", 0.01), told=told)


def check_gradients(model: ForwardModel, keys: Sequence[str] | None = None, *, directions: int = 3,
                    tolerance: float = 0.01, seed: int = 0,
                    progress: Callable[[int, int], object] | None = None) -> GradientCheck:
    """Compare a model's derivatives forward, backward, and with differences, each parameter alone."""
    for key in keys or ():
        if key not in model.start:
            raise ValueError(f"there is no parameter {key!r}{meant(key, model.start)}; there are "
                             f"{', '.join(model.start)}")
    if directions < 1:
        raise ValueError(f"directions is {directions}; give 1 or more")
    if not 0 < tolerance < 1:
        raise ValueError(f"tolerance is {tolerance:g}; give a share between 0 and 1, such as 0.01")
    chosen = list(model.start if keys is None else dict.fromkeys(keys))
    empty = [PartCheck(key=key, unit=model.units.get(key, ""), size=0, verdict=UNSEEN, notes=("it is empty",))
             for key in chosen if np.size(model.start[key]) == 0]
    checker = _Checker(model, tolerance, seed)
    todo = [_CheckedPart(key, name, moves, np.asarray(model.start[key], float), model.units.get(key,
                                                                                                "")) for key in chosen
            for name, moves in parts(np.asarray(model.start[key], float), directions, generator(seed, key))]
    products = [checker.products(part) for part in todo]                   # before the model is anywhere else
    extra, rows = checker.together(todo), []
    for number, (part, derivatives) in enumerate(zip(todo, products, strict=True)):
        rows.append(derivatives if isinstance(derivatives, PartCheck) else checker.row(part, derivatives))
        if progress is not None:
            progress(number + 1, len(todo))
    return GradientCheck(rows=(*rows, *empty, *extra, *checker.afterwards(todo, products)), directions=directions,
                         tolerance=tolerance, told=checker.told)


class _CheckedPart(NamedTuple):
    """The moved part of one parameter, and its directions (D, ...)."""

    key: str
    name: str
    directions: np.ndarray
    start: np.ndarray
    unit: str

    def check(self, verdict: str, *notes: str, **numbers: float) -> PartCheck:
        """Return a row of the table."""
        return PartCheck(key=self.key, part=self.name, unit=self.unit, size=np.size(self.start), verdict=verdict,
                         notes=notes, **numbers)

    @property
    def first_step(self) -> float:
        """The largest step to try."""
        size = float(np.abs(self.start).max(initial=0.0))
        return FIRST.get(self.unit, SHARE * size if size > 0 else SHARE)


class _Products(NamedTuple):
    """Derivatives of weighted sums of a record: weights (W, N), forward and backward (direction, W)."""

    weights: np.ndarray
    forward: np.ndarray
    backward: np.ndarray

    def summed(self, move: np.ndarray) -> np.ndarray:
        """Weighted sums of a record that is not finite where it has no weight."""
        return self.weights @ np.where(np.any(self.weights != 0, axis=0), move, 0.0)


class _SearchLine:
    """Weighted sums of a record along one direction."""

    def __init__(self, record: Callable[[float], np.ndarray], base: np.ndarray, weights: np.ndarray):
        used = np.any(weights != 0, axis=0)
        base = np.where(used, base, 0.0)
        size, whole = np.abs(weights) @ np.abs(base), float(np.linalg.norm(base))

        @cache
        def at(distance: float) -> tuple[np.ndarray, float]:
            there = np.where(used, record(distance), 0.0)
            return weights @ there, float(np.linalg.norm(there - base) / whole) if whole > 0 else 0.0

        self._at, self._size = at, np.where(size > 0, size, 1.0)

    def slopes(self, step: float) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Return D(h) and D(h/2), (W,), and how far sums and record moved, as shares of their size."""
        def central(h: float) -> np.ndarray:
            before2, before, after, after2 = (self._at(k * h)[0] for k in (-2, -1, 1, 2))
            return (before2 - 8 * before + 8 * after - after2) / (12 * h)

        (up, bent_up), (down, bent_down) = self._at(2 * step), self._at(-2 * step)
        return (central(step), central(step / 2), float((np.abs(up - down) / self._size).max(initial=0.0)),
                max(bent_up, bent_down))

    def slope(self, step: float) -> np.ndarray:
        """Return the mean of D(h) and D(h/2): what one of them is off, it halves at least."""
        coarse, fine, *_ = self.slopes(step)
        return 0.5 * (coarse + fine)

    def settled_step(self, first: float) -> float:
        """Return the step whose differences agree best with those of half of it, from the largest on."""
        best, least, refused = None, np.inf, None
        for step in (first * 0.5 ** np.arange(HALVINGS)).tolist():
            try:
                coarse, fine, moved, bent = self.slopes(step)
            except ValueError as error:                                # moved to where no record can be made
                refused = error
                continue
            apart = _share(coarse - fine, fine, 0.0) + (bent > BENT)
            if best is None or apart < least:                          # NaN is never smaller
                best, least = step, apart
            if least < AGREED or moved < NEXT_TO_STILL:
                break
        if best is None:
            raise ValueError(f"no record can be made beside the start: {refused}")
        return best


class _Checker:
    """Make the rows of one model."""

    def __init__(self, model: ForwardModel, tolerance: float, seed: int):
        self._model, self._tolerance = model, tolerance
        self._base = base = model.value(model.start)
        self._about = about = model.linearised(model.start)
        self.told: dict[str, float] = dict(left_out(about))
        self._finite = np.isfinite(base)
        there = base[self._finite]
        if not np.any(there):
            raise ValueError("the record is empty: nothing in it has a gradient; let the sonar hear something")
        self._size = np.abs(np.where(self._finite, base, 0.0))
        self._slow = slow_weights(base, shape_of(model) or base.shape, generator(seed, ""))
        self._swings = -there[there < 0].sum() > SWINGS * np.abs(there).sum()
        self._notes: tuple[str, ...] = ()
        if len(there) < base.size:
            self._notes = (f"{base.size - len(there)} of {base.size} values of the record are not finite, and have no "
                           "weight",)
        error = _share(about.value[self._finite] - there, there)
        self._another = not error <= tolerance
        if self._another:
            self._notes += (f"the record with derivatives differs from that without by {error:.1e}",)

    def products(self, part: _CheckedPart) -> _Products | PartCheck:
        """Return the derivatives of a part, or the error in them."""
        moves = [self._about.forward({part.key: direction}) for direction in part.directions]
        broken = sum(int(np.count_nonzero(~np.isfinite(move) & self._finite)) for move in moves)
        if broken:
            return part.check(OFF, f"forward derivatives are not finite in {broken} places")
        weights = self._slow
        if self._swings and np.any(moves[0]):
            like = np.where(self._finite, moves[0], 0.0) * np.abs(self._slow[0])
            weights = np.vstack([weights, like / (np.abs(like) @ self._size)])
        back = [self._about.backward(weight)[part.key] for weight in weights]
        broken = sum(int(np.count_nonzero(~np.isfinite(gradient))) for gradient in back)
        if broken:
            return part.check(OFF, f"gradients are not finite in {broken} places")
        used = np.any(weights != 0, axis=0)
        return _Products(weights, np.stack([weights @ np.where(used, move, 0.0) for move in moves]), np.array(
            [[np.sum(gradient * direction) for gradient in back] for direction in part.directions]))

    def row(self, part: _CheckedPart, products: _Products) -> PartCheck:
        """Return the verdict on a part."""
        lines = [_SearchLine(lambda distance, direction=direction: self._model.value(
            {part.key: part.start + distance * direction}), self._base, products.weights)
            for direction in part.directions]
        try:
            step = lines[0].settled_step(part.first_step)
            coarse, fine, moved, _ = map(np.array, zip(*(line.slopes(step) for line in lines)))
        except ValueError as error:
            return part.check(UNDECIDED, str(error))
        forward, backward, loud = products.forward, products.backward, np.abs(products.weights) @ self._size
        best = 0.5 * (coarse + fine)
        size, numbers = max(_rms(best), _rms(forward)), {"step": step, "moved": float(moved.max())}
        if size > 0:
            numbers |= {"error": _rms(best - forward) / size, "asymmetry": _rms(forward - backward) / size,
                        "disagreement": _rms(coarse - fine) / size}
        if np.any(forward):
            numbers["slope"] = float(np.sum(best * forward) / np.sum(forward ** 2))
        zero = max(_rms(forward), _rms(backward)) <= ZERO * size
        moves = max(numbers["moved"], 4 * step * float((np.abs(forward) / loud).max(initial=0.0)))
        two_ways = np.abs(forward - backward) * part.first_step / loud
        verdict, *notes = self._verdict(numbers, zero, moves, bool(two_ways.max(initial=0.0) > NOISE))
        if verdict == UNSEEN:                                          # nothing but rounding to compare
            return part.check(verdict, *self._notes, *notes, step=step, moved=numbers["moved"])
        if verdict == OFF and numbers["error"] > self._tolerance:
            if numbers["error"] < SCATTERED * self._scatter(part, products, step) / size:
                verdict, notes = UNDECIDED, [*notes, "derivatives scatter within a step: more rays or smaller bins of "
                                                     "the record, or smoother shapes, tell more"]
            elif max((_rms(wider - best) / size for wider in self._wider(lines, step, part.first_step)),
                     default=0.0) > WANDERED * numbers["error"]:
                verdict, notes = UNDECIDED, [*notes, "differences are others at larger steps: too few rays cross "
                                                     "shadows or edges at this one; more rays tell more"]
        return part.check(verdict, *self._notes, *notes, **numbers)

    def together(self, todo: Sequence[_CheckedPart]) -> list[PartCheck]:
        """Check that all parameters together move the record by the sum of their single changes."""
        first: dict[str, np.ndarray] = {}
        for part in todo:
            first.setdefault(part.key, part.directions[0])
        if len(first) < 2:
            return []
        alone = np.sum([self._about.forward({key: direction}) for key, direction in first.items()], axis=0)
        return self._same("all together", self._about.forward(first), alone,
                          "their derivatives are not the sum of each one's")

    def afterwards(self, todo: Sequence[_CheckedPart], products: Sequence[_Products | PartCheck]) -> list[PartCheck]:
        """Check that a linearisation is the same after the model was asked for other values."""
        for part, before in zip(todo, products, strict=True):
            if isinstance(before, _Products) and np.any(before.forward[0]):
                after = before.summed(self._about.forward({part.key: part.directions[0]}))
                return self._same("the same again", after, before.forward[0],
                                  "a linearisation does not stay the same once the model is asked for other values")
        return []

    def _same(self, name: str, found: np.ndarray, expected: np.ndarray, note: str) -> list[PartCheck]:
        there = np.isfinite(expected)
        error = _share((found - expected)[there], expected[there])
        return [] if error <= self._tolerance else [
            PartCheck(key=name, unit="", size=0, verdict=OFF, error=error, notes=(note,))]

    def _wider(self, lines: Sequence[_SearchLine], step: float, largest: float) -> Iterator[np.ndarray]:
        """Yield differences of all directions at larger steps."""
        for wider in [step * 4.0 ** power for power in range(1, WIDER + 1) if step * 4.0 ** power <= largest]:
            try:
                yield np.stack([line.slope(wider) for line in lines])
            except ValueError:                                         # moved to where no record can be made
                return

    def _scatter(self, part: _CheckedPart, products: _Products, step: float) -> float:
        """Return the rms, over directions and weights, of derivatives within a step about a parabola."""
        places, left = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]), []
        bends = np.stack([places ** power for power in range(3)], 1)
        for direction, here in zip(part.directions, products.forward, strict=True):
            found = np.array([here if place == 0 else products.summed(self._model.linearised(
                {part.key: part.start + place * step * direction}).forward({part.key: direction})) for place in places])
            fit = bends @ np.linalg.lstsq(bends, found, rcond=None)[0]
            left.append((found - fit) * np.sqrt(len(places) / (len(places) - bends.shape[1])))
        return _rms(np.concatenate(left))

    def _verdict(self, numbers: Mapping[str, float], zero: bool, moves: float, two_ways: bool) -> tuple[str, ...]:
        """Return the verdict, and notes."""
        error, apart = numbers.get("error", 0.0), numbers.get("disagreement", 0.0)
        shaken = apart > self._tolerance
        words = ("differences do not converge: shadows or edges",) if shaken else ()
        if moves < STILL or (zero and moves < NOISE and apart > 0.5):
            return UNSEEN,
        if zero:
            return DISCONNECTED, *words, f"the record moves by {numbers['moved']:.1e}, and its gradient is zero"
        if numbers["asymmetry"] > self._tolerance and two_ways:
            return OFF, *words, f"forward and backward derivatives differ by {numbers['asymmetry']:.1e}"
        if shaken and apart > 0.5 * error and not self._another:
            return UNDECIDED, *words
        return RIGHT if error <= self._tolerance and not self._another else OFF, *words


def _rms(values: np.ndarray) -> float:
    """Return the rms over directions and weights; these are scaled alike."""
    return float(np.sqrt(np.mean(np.square(values))))


def _share(wrong: np.ndarray, right: np.ndarray, of_nothing: float = np.inf) -> float:
    size = float(np.linalg.norm(right))
    return float(np.linalg.norm(wrong)) / size if size > 0 else of_nothing if np.any(wrong) else 0.0
