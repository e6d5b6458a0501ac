"""Recipe of a scene in a sweep: which values its parameters take, in which order, and how they are drawn.

    renders = samples x seeds x rows of the table x length of the lists x grid

in this order, with the last parameter of the grid running fastest. Samples have no end here: the plan says how many
renders of a recipe it makes.
"""
import itertools
import math
import os
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scenes

from .drawing import rules as drawing_rules
from .drawing.rules import Chance, Rule
from .drawing.tables import DrawnRows, columns_of, drawn_rows
from .drawing.together import Together, together
from .inputs import Inputs
from .strata import stratified_bits
from .values import axis, fraction, random_bits, shortened, value, whole

MOST_SEEDS = 1 << 32               # limit of `mitsonar.render`
MOST_REPEATS = 1_000_000           # seeds of a combination
# of the plan, or of one of its scenes
KEYS = ("scene", "seeds", "redraw", "table", "rows", "set", "list", "grid", "draw", "together", "labels")


class RecipePlace(NamedTuple):
    """Place of a render in a recipe."""

    sample: int
    repeat: int  # number of its seed
    row: int  # of the table
    item: int  # of the lists
    crossed: tuple[int, ...]  # of every parameter of the grid
    combination: int  # all but sample and repeat, in one number


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Recipe of a scene.

    Attributes
    ----------
    name : str
        Name in the plan: that of the scene's file unless the plan gives another.
    scene : str
        Absolute path of the scene.
    seed : int or str
        First part of what draws are hashed from: the plan's seed, with the name if the plan has several scenes.
    seeds : int or tuple of int
        Number of renders of every combination, or their seeds.
    fixed : dict
        Parameters with a single value.
    table, lists, grid : dict of str to tuple
        Parameters with several values: columns of equal length (table and lists), and crossed ones (grid).
    rules : dict of str to Rule
        Parameters that are drawn or follow from others, each after those that it needs.
    rows : tuple of DrawnRows
        Tables of which every draw takes a row.
    together : Together
        Correlations of draws.
    redraw : tuple of str
        Parameters that are drawn again if the scene refuses them, for example if its targets do not fit.
    known : dict of str to str
        Defaults of the scene that rules need.
    inputs : Inputs
        Files of the scene.
    labels : dict or None
        Rules of labels, if renders are samples; None for others.
    share : float
        Part of the plan's renders, in proportion to those of other scenes.
    """

    name: str
    scene: str
    seed: int | str
    seeds: int | tuple[int, ...]
    fixed: dict[str, Any]
    table: dict[str, tuple]
    lists: dict[str, tuple]
    grid: dict[str, tuple]
    rules: dict[str, Rule]
    rows: tuple[DrawnRows, ...]
    together: Together
    redraw: tuple[str, ...]
    known: dict[str, str]
    inputs: Inputs = field(repr=False)
    labels: dict[str, Any] | None = None
    share: float = 1.0

    @property
    def is_drawn(self) -> bool:
        """Return True if samples differ in more than their seeds."""
        return bool(self.rows) or any(rule.is_drawn for rule in self.rules.values())

    @property
    def names(self) -> list[str]:
        """Return the names of all parameters."""
        return list(itertools.chain(self.fixed, self.table, self.lists, self.grid,
                                    *(rows.columns for rows in self.rows), self.rules))

    def sizes(self) -> list[int]:
        """Return the numbers of seeds, rows of the table, items of the lists, and values of every grid parameter."""
        first = [len(next(iter(columns.values()), (None,))) for columns in (self.table, self.lists)]
        return [self.seeds if isinstance(self.seeds, int) else len(self.seeds), *first, *map(len, self.grid.values())]

    def place(self, index: int) -> RecipePlace:
        """Return the place of its render ``index``."""
        sizes, rest, places = self.sizes(), index, []
        for size in reversed(sizes):
            rest, place = divmod(rest, size)
            places.insert(0, place)
        repeat, row, item, *crossed = places
        return RecipePlace(sample=rest, repeat=repeat, row=row, item=item, crossed=tuple(crossed),
                           combination=index % math.prod(sizes[1:]))

    def combinations(self) -> int:
        """Return the number of combinations of the table, the lists and the grid."""
        return math.prod(self.sizes()[1:])

    def parameters(self, place: RecipePlace, redrawn: int = 0, attempt: int = 0,
                   attempted: Collection[str] = ()) -> dict[str, Any]:
        """Return the values of the scene's parameters, with some of them drawn again.

        Parameters
        ----------
        place : RecipePlace
            Place of the render.
        redrawn : int
            Number of repeated draws of `redraw`, since the scene refused them.
        attempt : int
            Number of repeated draws of `attempted`, since they belong to another subset.
        attempted : collection of str
            Names of parameters and of tables of rows.

        Raises
        ------
        ValueError
            If an expression has no value there, or a case is missing.
        """
        parameters = {**self.fixed, **{name: column[place.row] for name, column in self.table.items()},
                      **{name: column[place.item] for name, column in self.lists.items()},
                      **{name: column[item] for (name, column), item in zip(self.grid.items(), place.crossed)}}
        for rows in self.rows:
            again = ["split", attempt] if attempt and rows.name in attempted else []
            parameters |= rows.row(random_bits(self.seed, "rows", rows.name, place.combination, place.sample, *again))

        def bits(name: str) -> int:
            again = ["again", redrawn] if redrawn and name in self.redraw else []
            if attempt and name in attempted:
                return random_bits(self.seed, name, place.combination, place.sample, *again, "split", attempt)
            if self.rules[name].is_stratified:
                return stratified_bits(self.seed, name, place.sample * self.combinations() + place.combination, *again)
            return random_bits(self.seed, name, place.combination, place.sample, *again)

        shares = self.together.shares([fraction(bits(name)) for name in self.together.names])
        scope = {**self.known, **parameters}
        for name, rule in self.rules.items():
            chance = Chance(bits(name) if rule.is_drawn else 0, shares.get(name))
            scope[name] = parameters[name] = rule.value(chance, scope)
        return parameters

    def render_seed(self, place: RecipePlace) -> int:
        """Return the seed of rays, speckle and noise."""
        if isinstance(self.seeds, int):
            return random_bits(self.seed, "", place.combination, place.sample, place.repeat) % MOST_SEEDS
        return self.seeds[place.repeat]

    def columns(self) -> dict[str, tuple]:
        """Return the values of parameters by name, as far as they are known before they are drawn."""
        return {**{name: (item,) for name, item in self.fixed.items()}, **self.table, **self.lists, **self.grid,
                **{name: column for rows in self.rows for name, column in rows.columns.items()},
                **{name: rule.choices for name, rule in self.rules.items()}}


def recipe_of(given: Mapping[str, Any], place: str, seed: int | str, name: str | None = None) -> Recipe:
    """Return the checked recipe that a plan gives a scene.

    Parameters
    ----------
    given : mapping
        Keys of the scene, from `KEYS`.
    place : str
        Folder of the plan.
    seed : int or str
        First part of what draws are hashed from.
    name : str or None
        Name in the plan.

    Raises
    ------
    FileNotFoundError, ValueError
        If a file is missing, or a key is wrong.
    """
    beside = os.path.join(place, file := text_of(given, "scene"))
    scene = os.path.abspath(beside if os.path.isfile(beside) else scenes.find(file))
    inputs = Inputs(scene, place)
    fixed = dict(section(given, "set"))
    derived = {key: drawing_rules.rule(fixed.pop(key), f"set.{key}") for key, item in list(fixed.items())
               if drawing_rules.is_derived(item)}
    fixed = {key: value(item, f"set.{key}") for key, item in fixed.items()}
    table = columns_of(os.path.join(place, text_of(given, "table")), inputs.known) if "table" in given else {}
    rows = tuple(drawn_rows(item, "rows", place, inputs.known) for item in _tables(given, "rows"))
    lists = {key: axis(item, f"list.{key}") for key, item in section(given, "list")}
    grid = {key: axis(item, f"grid.{key}") for key, item in section(given, "grid")}
    rules = {key: drawing_rules.rule(item, f"draw.{key}") for key, item in section(given, "draw")}
    _check_names(inputs, [fixed, derived, table, lists, grid, rules, *(item.columns for item in rows)], lists)
    defaults, rules = inputs.defaults(), {**derived, **rules}
    columns = {**{key: (item,) for key, item in fixed.items()}, **table, **lists, **grid,
               **{key: column for item in rows for key, column in item.columns.items()}}
    rules = drawing_rules.ordered(rules, {**defaults, **columns})
    needs = {other for rule in rules.values() for other in rule.needs}
    recipe = Recipe(name=name or os.path.splitext(os.path.basename(scene))[0], scene=scene, seed=seed,
                    seeds=_seeds(given.get("seeds", 1)), fixed=fixed, table=table, lists=lists, grid=grid,
                    rules=rules, rows=rows, together=together(dict(section(given, "together")), rules),
                    redraw=names_of(given, "redraw"), inputs=inputs,
                    known={key: text for key, text in defaults.items() if key in needs and key not in columns})
    drawing_rules.check_cases(rules, {**{key: (text,) for key, text in recipe.known.items()}, **recipe.columns()})
    for key in recipe.redraw:
        if key not in rules or not rules[key].is_drawn:
            drawn = [other for other, rule in rules.items() if rule.is_drawn]
            raise ValueError(f"redraw names {shortened(key)}{meant(key, drawn)}, which is not drawn; give "
                             f"parameters of [draw]: {', '.join(drawn) or 'it has none'}")
    inputs.check_files(recipe.columns())
    return recipe


def files_of(given: Mapping[str, Any], place: str) -> list[str]:
    """Return the paths of the tables of a scene, whose content decides what is rendered."""
    names = [*([given["table"]] if "table" in given else []), *(item["table"] for item in _tables(given, "rows"))]
    return [os.path.join(place, name) for name in names]


def text_of(given: Mapping[str, Any], key: str) -> str:
    """Return the name of a file in a plan."""
    text = given[key]
    if not isinstance(text, str) or not text or not text.isprintable():
        raise ValueError(f"{key} is {shortened(text)}; give the name of a file")
    return text


def section(given: Mapping[str, Any], key: str) -> list[tuple[str, Any]]:
    """Return the names and values of a table in a plan; none without it."""
    entries = given.get(key, {})
    if not isinstance(entries, dict):
        raise ValueError(f"{key} is {shortened(entries)}; write parameters under [{key}]")
    return list(entries.items())


def names_of(given: Mapping[str, Any], key: str) -> tuple[str, ...]:
    """Return the names in a list of a plan; none without it."""
    names = given.get(key, [])
    if not (isinstance(names, list) and all(isinstance(name, str) and name for name in names)
            and len(set(names)) == len(names)):
        raise ValueError(f"{key} is {shortened(names)}; give a list of different names")
    return tuple(names)


def _tables(given, key):
    """Return one or several tables of a plan."""
    entries = given.get(key, [])
    entries = [entries] if isinstance(entries, dict) else entries
    if not isinstance(entries, list) or not all(isinstance(item, dict) for item in entries):
        raise ValueError(f"{key} is {shortened(entries)}; write [{key}], or [[{key}]] for several")
    return entries


def _check_names(inputs, sources, lists):
    named = [name for source in sources for name in source]
    twice = next((name for name in named if named.count(name) > 1), None) if len(set(named)) < len(named) else None
    if twice is not None:
        raise ValueError(f"the parameter {twice} is given twice; leave one out")
    lengths = {name: len(column) for name, column in lists.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"the lists of [list] run side by side, and have the lengths {shortened(lengths)}; make them "
                         "equal, or move them to [grid], which crosses them")
    inputs.check_names(named)


def _seeds(given):
    if not isinstance(given, list):
        return whole(given, "seeds", 1, MOST_REPEATS)
    seeds = tuple(whole(item, "seeds", 0, MOST_SEEDS - 1) for item in given)
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds is {shortened(given)}; give different whole numbers, at least one")
    return seeds
