"""Draws that are correlated, by a Gaussian copula: every draw keeps its own distribution.

    z_i = Phi^-1(u_i)           of the draw's own random number u_i
    v_i = Phi(sum_j L_ij z_j)   with L L^T = R, which replaces u_i

A rank correlation r (Spearman) of the plan is the element 2 sin(pi r / 6) of R, exactly so for continuous draws.

References
----------
Kruskal (1958), Ordinal measures of association, J. Am. Stat. Assoc. 53, 814.
Nelsen (2006), An Introduction to Copulas.
"""
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any

from mitsonar.device.spelling import meant

from ..values import number, shortened
from .rules import Rule

MOST = 50                          # parameters
EDGE = 2.0 ** -52                  # least distance of a fraction from 0 and 1
NORMAL = NormalDist()


@dataclass(frozen=True, kw_only=True)
class Together:
    """Parameters that are drawn together."""

    names: tuple[str, ...] = ()
    rows: tuple[tuple[float, ...], ...] = ()  # L, a triangle

    def shares(self, fractions: Sequence[float]) -> dict[str, float]:
        """Return the fractions of the parameters' distributions for independent ones."""
        normal = [NORMAL.inv_cdf(fraction) for fraction in fractions]
        return {name: min(max(NORMAL.cdf(math.fsum(part * z for part, z in zip(row, normal))), EDGE), 1 - EDGE)
                for name, row in zip(self.names, self.rows, strict=True)}


def together(given: Mapping[str, Any], rules: Mapping[str, Rule]) -> Together:
    """Return the correlations that a plan gives its draws, as ``depth.sand_db = 0.7`` under ``[together]``."""
    pairs: dict[tuple[str, str], float] = {}
    names: dict[str, None] = {}
    for first, others in given.items():
        if not isinstance(others, dict):
            raise ValueError(f"together.{first} is {shortened(others)}; give rank correlations of pairs, such as "
                             f"{first}.OTHER = 0.7")
        for second, correlation in others.items():
            where = f"together.{first}.{second}"
            correlation = number(correlation, where)
            if not -1 < correlation < 1:
                raise ValueError(f"{where} is {correlation}; give a rank correlation between -1 and 1")
            for name in (first, second):
                if name not in rules or not rules[name].is_drawn:
                    raise ValueError(f"{where} names {shortened(name)}{meant(name, rules)}, which is not drawn; give "
                                     "parameters of [draw]")
                names[name] = None
            if first == second or (second, first) in pairs:
                raise ValueError(f"{where} is given for {'one parameter' if first == second else 'a pair given before'}"
                                 "; leave it out")
            pairs[first, second] = 2 * math.sin(math.pi * correlation / 6)
    if len(names) > MOST:
        raise ValueError(f"[together] names {len(names)} parameters; give at most {MOST}")
    rows = _triangle(tuple(names), pairs)
    for name, row in zip(names, rows, strict=True):
        followed = next((other for other, part in zip(names, row[:-1]) if part), None)
        if rules[name].is_stratified and followed is not None:
            raise ValueError(f"{name} is stratified, and [together] makes it follow {followed}, so that its "
                             "values would no longer be even; leave stratified out, or name it first in [together]")
    return Together(names=tuple(names), rows=rows)


def _triangle(names, pairs):
    """Return Cholesky's factor of the correlations."""
    rows: list[tuple[float, ...]] = []
    for k, name in enumerate(names):
        row: list[float] = []
        for other, known in zip(names, rows):
            wanted = pairs.get((name, other), pairs.get((other, name), 0.0))
            row.append((wanted - math.fsum(a * b for a, b in zip(row, known))) / known[-1])
        rest = 1 - math.fsum(a * a for a in row)
        if rest < 1e-9:
            raise ValueError(f"the correlations of [together] contradict each other at {name}: no {k + 1} draws have "
                             "them all, with 0 for pairs that are not named; move some closer to 0, or name more pairs")
        rows.append((*row, math.sqrt(rest)))
    return tuple(rows)
