"""Values of a parameter in a sweep: a list, a range, or random draws.

A draw depends only on the plan's seed, the parameter's name, and the numbers of combination and sample: their SHA-256
gives a fraction u in (0, 1), and the inverse distribution the value. Adding parameters therefore changes no draw, and
no draw depends on the generator of a library.
"""
import bisect
import hashlib
import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, TypeGuard

from mitsonar.device.spelling import meant

BESIDE = "stratified", "weights"   # keys beside a distribution
MOST_VALUES = 1_000_000
LONGEST_TEXT = 1000
MOST_LISTED = 1000                 # integers that are listed as choices
LARGEST_WHOLE = 1 << 53            # exact in every reader of JSON
DIGITS = 12                        # of computed values: ample for a sonar, and avoids 0.30000000000000004


@dataclass(frozen=True, kw_only=True)
class Draw:
    """Distribution of a parameter."""

    what: str  # its name in the plan
    at: Callable[[int], Any]  # value for an integer of 256 random bits
    quantile: Callable[[float], Any]  # value below which a fraction between 0 and 1 of the draws lies
    choices: tuple = ()  # all possible values; empty for continuous distributions and many integers
    stratified: bool = False  # its bits are those of `strata.stratified_bits`


def value(given: object, where: str) -> Any:
    """Return a checked value: a number, true or false, a text, or a list of numbers as a tuple."""
    if isinstance(given, bool):
        return given
    if isinstance(given, (int, float)):
        return _finite(given, where)
    if isinstance(given, str):
        if len(given) > LONGEST_TEXT or any(ord(letter) < 32 for letter in given):
            raise ValueError(f"{where} is a text of {len(given)} characters; give up to {LONGEST_TEXT} in one line")
        return given
    if isinstance(given, list) and 0 < len(given) <= LONGEST_TEXT and all(map(_is_number, given)):
        return tuple(_finite(item, where) for item in given)
    raise ValueError(f"{where} is {shortened(given)}; give a number, true or false, a text, or a list of numbers")


def axis(given: object, where: str) -> tuple:
    """Return the values of a list or of a range ``{from, to, count or step, scale}``."""
    if isinstance(given, dict):
        return _range(given, where)
    if not isinstance(given, list) or not given:
        raise ValueError(f"{where} is {shortened(given)}; give a list of values, or {{ from, to, count }}")
    if len(given) > MOST_VALUES:
        raise ValueError(f"{where} has {len(given)} values; give at most {MOST_VALUES:,}")
    return tuple(value(item, where) for item in given)


def draw(given: object, where: str) -> Draw:
    """Return the distribution of a parameter from ``{ uniform = [low, high] }`` and the like."""
    kinds = [name for name in given if name in DISTRIBUTIONS] if isinstance(given, dict) else []
    if not isinstance(given, dict) or len(kinds) != 1:
        raise ValueError(f"{where} is {shortened(given)}; give one of {', '.join(DISTRIBUTIONS)}, "
                         "of and when, such as { uniform = [1, 2] }")
    kind, rest = kinds[0], {name: item for name, item in given.items() if name != kinds[0]}
    unknown = [name for name in rest if (kind, name) != ("choice", "weights")]
    if unknown:
        perhaps = meant(unknown[0], [name for name in BESIDE if name not in unknown])
        raise ValueError(f"{where} has the unknown key {shortened(unknown[0])}{perhaps} beside {kind}; leave it out")
    return DISTRIBUTIONS[kind](given[kind], f"{where}: {kind}", **rest)


def fraction(bits: int) -> float:
    """Return a number above 0 and below 1 for 256 random bits."""
    return ((bits >> 204) + 0.5) / (1 << 52)           # one bit more would round the largest to 1


def random_bits(*parts: object) -> int:
    """Return 256 pseudo-random bits that depend only on the parts."""
    return int.from_bytes(hashlib.sha256("/".join(map(str, parts)).encode()).digest(), "big")


def number(given: object, where: str) -> int | float:
    """Return a finite number; `ValueError` for other values."""
    if not _is_number(given):
        raise ValueError(f"{where} is {shortened(given)}; give a number")
    return _finite(given, where)


def whole(given: object, where: str, low: int, high: int) -> int:
    """Return a whole number from low to high; `ValueError` for other values."""
    if isinstance(given, bool) or not isinstance(given, int) or not low <= given <= high:
        raise ValueError(f"{where} is {shortened(given)}; give a whole number from {low} to {high}")
    return given


def shortened(given: object) -> str:
    """Return a value as text for an error message, shortened if long."""
    if isinstance(given, (dict, list)) and len(given) > 20:
        return f"a {'table' if isinstance(given, dict) else 'list'} of {len(given)}"
    if isinstance(given, int) and not isinstance(given, bool) and abs(given) >= 1 << 200:
        return f"a number of {given.bit_length()} bits"            # Python cannot print the longest integers
    try:
        written = repr(given)
    except ValueError:
        written = "a value with a number too long to print"
    return written if len(written) <= 100 else written[:97] + "..."


def _range(given, where):
    unknown = set(given) - {"from", "to", "count", "step", "scale"}
    if unknown or not {"from", "to"} <= set(given) or ("count" in given) == ("step" in given):
        raise ValueError(f"{where} is {shortened(given)}; give {{ from, to, count }} or {{ from, to, step }}, and "
                         "scale = \"log\" if wanted")
    first, last = number(given["from"], f"{where}: from"), number(given["to"], f"{where}: to")
    scale = given.get("scale", "linear")
    if scale not in ("linear", "log") or (scale == "log" and "step" in given):
        raise ValueError(f"{where} has the scale {shortened(scale)}; give \"linear\", or \"log\" with a count")
    if scale == "log" and not (first > 0 and last > 0):
        raise ValueError(f"{where} runs from {first} to {last} on a log scale; give numbers above 0")
    if "count" in given:
        count = whole(given["count"], f"{where}: count", 1, MOST_VALUES)
        if count == 1 and first != last:
            raise ValueError(f"{where} has the count 1 from {first} to {last}; give 2 or more")
        shares = [k / max(count - 1, 1) for k in range(count)]
        if scale == "log":
            low, high = math.log(first), math.log(last)
            return (first, *(rounded(math.exp(low + (high - low) * share)) for share in shares[1:-1]), last)[:count]
        return (first, *(_tidy(first + (last - first) * share, first, last) for share in shares[1:-1]), last)[:count]
    step = number(given["step"], f"{where}: step")
    if step == 0 or not 0 <= (last - first) / step < MOST_VALUES:
        raise ValueError(f"{where} goes from {first} to {last} by {step}; give a step that gets there, in at most "
                         f"{MOST_VALUES:,}")
    count = math.floor((last - first) / step + 1e-9) + 1
    return tuple(_tidy(first + step * k, first, step) for k in range(count))


def _tidy(computed, *given):
    """Return a rounded number, as an integer if it and all given numbers are integers."""
    computed = rounded(computed)
    return int(computed) if computed.is_integer() and all(isinstance(item, int) for item in given) else computed


def rounded(computed: float) -> float:
    """Return a computed number to the digits that values of a plan have."""
    return float(f"{computed:.{DIGITS}g}")


def _uniform(given, where):
    low, high = _pair(given, where, "the lowest and the highest number")
    return _continuous("uniform", lambda share: low + (high - low) * share)


def _log_uniform(given, where):
    low, high = _pair(given, where, "the lowest and the highest number")
    if low <= 0:
        raise ValueError(f"{where} is from {low}; give numbers above 0")
    low, high = math.log(low), math.log(high)
    return _continuous("log_uniform", lambda share: math.exp(low + (high - low) * share))


def _normal(given, where):
    mean, deviation = _pair(given, where, "mean and standard deviation", ordered=False)
    if deviation <= 0:
        raise ValueError(f"{where} has the standard deviation {deviation}; give one above 0")
    return _continuous("normal", NormalDist(mean, deviation).inv_cdf)


def _integer(given, where):
    low, high = _pair(given, where, "the lowest and the highest whole number")
    if not (isinstance(low, int) and isinstance(high, int)):
        raise ValueError(f"{where} is {shortened(given)}; give whole numbers")
    count = high - low + 1
    return Draw(what="integer", at=lambda bits: low + bits % count,
                quantile=lambda share: low + math.floor(count * share),
                choices=tuple(range(low, high + 1)) if count <= MOST_LISTED else ())


def _choice(given, where, weights=None):
    choices = axis(given, where)
    if weights is None:
        return Draw(what="choice", at=lambda bits: choices[bits % len(choices)], choices=choices,
                    quantile=lambda share: choices[math.floor(len(choices) * share)])
    chosen = weighted(choices, weights, where)
    return Draw(what="choice", at=lambda bits: chosen(fraction(bits)), quantile=chosen, choices=choices)


def weighted(choices: Sequence[Any], weights: object, where: str) -> Callable[[float], Any]:
    """Return a function from a fraction between 0 and 1 to one of the choices, in proportion to their weights."""
    if not isinstance(weights, list) or len(weights) != len(choices):
        raise ValueError(f"{where} has {len(choices)} values and the weights {shortened(weights)}; give a weight each")
    weights = [number(weight, f"{where}: weights") for weight in weights]
    total = math.fsum(weights)
    if min(weights) < 0 or not 0 < total < math.inf:
        raise ValueError(f"{where} has the weights {shortened(weights)}; give numbers of at least 0, not all 0")
    ends = [end / total for end in itertools.accumulate(weights)]
    last = max(k for k, weight in enumerate(weights) if weight > 0)     # if rounding keeps the ends below 1

    def chosen(share: float) -> Any:
        return choices[min(bisect.bisect_right(ends, share), last)]

    return chosen


def _continuous(what, quantile):
    return Draw(what=what, at=lambda bits: rounded(quantile(fraction(bits))),
                quantile=lambda share: rounded(quantile(share)))


DISTRIBUTIONS = {"uniform": _uniform, "log_uniform": _log_uniform, "normal": _normal, "choice": _choice,
                 "integer": _integer}


def _pair(given, where, meaning, ordered=True):
    if not (isinstance(given, list) and len(given) == 2 and all(map(_is_number, given))):
        raise ValueError(f"{where} is {shortened(given)}; give two numbers, {meaning}")
    first, second = (_finite(item, where) for item in given)
    if ordered and not first < second:
        raise ValueError(f"{where} is from {first} to {second}; give {meaning}, in this order")
    return first, second


def _is_number(given: object) -> TypeGuard[int | float]:
    return isinstance(given, (int, float)) and not isinstance(given, bool)


def _finite(given, where):
    if isinstance(given, int) and abs(given) > LARGEST_WHOLE:
        raise ValueError(f"{where} is {shortened(given)}; give a whole number of at most {LARGEST_WHOLE}")
    if not math.isfinite(given) or abs(given) > 1e150:
        raise ValueError(f"{where} is {given}; give a finite number")
    return given
