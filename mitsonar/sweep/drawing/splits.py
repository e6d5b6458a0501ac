"""Subsets of a plan's renders for training, validation and test, known before anything is rendered.

A group is all renders with the same values of the parameters of ``group``, such as the seed of a seabed. It belongs to
one subset: by its turn if all groups are listed in the plan, else by a hash of its values. Renders take subsets by
turns, and where a group is drawn at random, it is drawn again until it belongs to the subset of the render. Shares are
therefore exact, no group is in two subsets, and more renders or scenes move none.
"""
import bisect
import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from mitsonar.device.spelling import meant

from ..manifest import SUBSETS
from ..recipe import Recipe, RecipePlace
from ..values import fraction, number, random_bits, shortened
from .rules import case_of, number_text
from .shares import SharedTurns

TRIES, MOST_TRIES = 20, 2000       # draws of a group, over the smallest share; a subset is missed once in e^20
MOST_LISTED = 100_000              # groups that have turns


def check_shares(shares: Mapping[str, Any], where: str) -> dict[str, float]:
    """Return the shares of subsets; raises `ValueError` if they do not add up to 1."""
    for name, share in shares.items():
        if name not in SUBSETS:
            raise ValueError(f"{where}.{name} is unknown{meant(name, SUBSETS)}; give shares of {', '.join(SUBSETS)}, "
                             "and group")
        if not 0 < number(share, f"{where}.{name}") <= 1:
            raise ValueError(f"{where}.{name} is {share}; give a share above 0, and at most 1")
    if abs(sum(shares.values()) - 1) > 1e-6:
        raise ValueError(f"the shares of [{where}] add up to {sum(shares.values()):g}; they must add up to 1")
    return {name: float(share) for name, share in shares.items()}


class Split:
    """Subsets of the renders of a plan."""

    def __init__(self, given: Mapping[str, Any], recipes: Sequence[Recipe], seed: int):
        shares, group = dict(given), given.get("group", [])
        shares.pop("group", None)
        self.shares = check_shares(shares, "split")
        self.group, self._seed, self._names = _group(group, recipes), seed, list(self.shares)
        self._ends = list(itertools.accumulate(self.shares.values()))
        self._turns = {recipe.name: SharedTurns(list(self.shares.values()), recipe.seed, "split") for recipe in recipes}
        self._drawn = {recipe.name: self._drawn_again(recipe) for recipe in recipes}
        self._defaults = {recipe.name: self._left_to(recipe) for recipe in recipes}
        self._homes: dict[str, str] = {}
        self._tries = min(math.ceil(TRIES / min(self.shares.values())), MOST_TRIES)
        listed = list(dict.fromkeys(key for recipe in recipes for key in self._listed(recipe)))
        turns = SharedTurns(list(self.shares.values()), seed, "split", "groups", all_first=True)
        for turn, key in enumerate(listed):
            self._homes[key] = self._names[turns[turn][0]]
        self._check_listed(recipes)

    def parameters(self, recipe: Recipe, place: RecipePlace, redrawn: int) -> tuple[str, dict[str, Any]]:
        """Return the subset and the parameters of a render."""
        wanted, drawn = self._wanted(recipe, place), self._drawn[recipe.name]
        subset, parameters, own = wanted, {}, self._own(recipe)
        for attempt in range(self._tries if drawn else 1):
            parameters = recipe.parameters(place, redrawn, attempt, drawn)
            group = {**self._defaults[recipe.name], **{name: parameters[name] for name in own}}
            subset = self.home(_key(group)) if own else wanted
            if subset == wanted:
                break
        return subset, parameters

    def home(self, key: str) -> str:
        """Return the subset of a group."""
        if key in self._homes:
            return self._homes[key]
        place = bisect.bisect_right(self._ends, fraction(random_bits(self._seed, "split", key)))
        return self._names[min(place, len(self._names) - 1)]

    def check(self, renders: Iterable[tuple[Recipe, RecipePlace, str | None]]) -> None:
        """Raise `ValueError` if a scene draws its groups, and none of them is in a subset that renders should have."""
        wanted, found = {}, set()
        for recipe, place, subset in renders:
            if self._drawn[recipe.name] and not {*self._own(recipe)} & {*recipe.table, *recipe.lists, *recipe.grid}:
                wanted.setdefault((recipe.name, self._wanted(recipe, place)))
                found.add((recipe.name, subset))
        for name, subset in wanted:
            if (name, subset) not in found:
                raise ValueError(f"split.group has so few different values of {', '.join(self.group)} in the scene "
                                 f"{name} that none is for {subset}; give more values, or fewer subsets")

    def _wanted(self, recipe, place):
        """Return the subset whose turn it is."""
        turn = place.sample * recipe.combinations() + place.combination
        return self._names[self._turns[recipe.name][turn][0]]

    def _left_to(self, recipe):
        """Return the parameters of the group that a scene is not given, by its defaults."""
        defaults = recipe.inputs.defaults() if self.group else {}
        return {name: defaults[name] for name in self.group if name not in recipe.names and name in defaults}

    def _listed(self, recipe):
        return _listed(recipe, self._own(recipe), self._defaults[recipe.name])

    def _own(self, recipe):
        """Return the parameters of the group that a scene is given."""
        return [name for name in self.group if name in recipe.names]

    def _drawn_again(self, recipe):
        """Return what is drawn again to change a group: parameters, and tables of rows."""
        found, waiting = set(), list(self._own(recipe))
        while waiting:
            name = waiting.pop()
            if name in recipe.rules and name not in found:
                waiting += recipe.rules[name].needs
            found.add(name)
            found |= {rows.name for rows in recipe.rows if name in rows.columns}
        if crossing := found & set(recipe.redraw):
            raise ValueError(f"redraw names {min(crossing)}, which decides on the subset by split.group; leave one out")
        files = {rows.name for rows in recipe.rows}
        return frozenset(name for name in found if name in files
                         or name in recipe.rules and recipe.rules[name].is_drawn)

    def _check_listed(self, recipes):
        """Raise `ValueError` if a scene has too few groups, all listed, for all subsets."""
        for recipe in recipes:
            keys = self._listed(recipe)
            lacking = [name for name in self.shares if name not in {self._homes[key] for key in keys}]
            if keys and lacking and (self._drawn[recipe.name] or len(self._homes) < len(self.shares)):
                raise ValueError(f"split.group has {len(keys)} different value{'s' * (len(keys) != 1)} of "
                                 f"{', '.join(self._own(recipe))} in the scene {recipe.name}, of which none is for "
                                 f"{lacking[0]}; give more values, or fewer subsets")


def _group(given, recipes):
    if not isinstance(given, list) or not all(isinstance(name, str) for name in given):
        raise ValueError(f"split.group is {shortened(given)}; give a list of parameters, such as [\"bed_seed\"]")
    known = list(dict.fromkeys(name for recipe in recipes for name in recipe.names))
    for name in given:
        if name not in known:
            raise ValueError(f"split.group names {shortened(name)}{meant(name, known)}, which the plan gives no value; "
                             f"give parameters of the plan: {', '.join(known) or 'it has none'}")
    for recipe in recipes if given else ():
        if not set(given) & set(recipe.names):
            raise ValueError(f"split.group names no parameter of the scene {recipe.name}; add one that makes its "
                             "seabeds different")
    return tuple(given)


def _listed(recipe, names, defaults):
    """Return the keys of all groups of a scene if they are listed in the plan, else none."""
    if not names:
        return []
    if len(names) == 1 and names[0] in recipe.rules:
        rule = recipe.rules[names[0]]
        return list(dict.fromkeys(_key({**defaults, names[0]: item}) for item in rule.choices)) if rule.is_closed \
            else []
    axes: list[list[dict[str, Any]]] = []
    for columns in (recipe.table, recipe.lists, *({name: column} for name, column in recipe.grid.items()),
                    {name: (item,) for name, item in recipe.fixed.items()}):
        if own := [name for name in names if name in columns]:
            axes.append([dict(zip(own, items)) for items in dict.fromkeys(zip(*(columns[name] for name in own)))])
    if {name for axis in axes for name in axis[0]} != set(names) or math.prod(map(len, axes)) > MOST_LISTED:
        return []
    return list(dict.fromkeys(_key({**defaults, **{name: item for part in parts for name, item in part.items()}})
                              for parts in itertools.product(*axes)))


def _key(values):
    """Return the text of a group; 30 and 30.0 are one value."""
    return "\n".join(f"{name}={number_text(case_of(values[name]))}" for name in sorted(values))
