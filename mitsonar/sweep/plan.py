"""Plan of a sweep: scenes, values of their parameters and names of their renders, from a TOML file.

A plan of one scene makes all renders of its `recipe`. A plan of several makes ``renders``, which the scenes take in
turns by their shares. More samples, more renders, or more rows of a table with one sample and one seed, therefore
follow the existing renders.
"""
import hashlib
import os
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from importlib.resources import files
from typing import Any

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scenes
from mitsonar.labels.samples import key_of

from . import recipe as recipes
from .balance import balance_of
from .drawing.mixture import parts_of, recipes_of
from .drawing.rules import Rule
from .drawing.shares import SharedTurns
from .drawing.splits import Split
from .drawing.tables import check_file
from .inputs import Inputs
from .manifest import sha256
from .names import Pattern
from .products import labels_of, options_digest, soundings_of
from .recipe import MOST_SEEDS, Recipe, names_of, section
from .values import shortened, whole

MOST_RENDERS = 1_000_000
MOST_TRIED = 1000                  # renders whose parameters are computed when a plan is read
LARGEST_PLAN = 10_000_000          # bytes
OF_PLAN = ("output", "seed", "samples", "renders", "previews", "classes", "soundings", "split", "scenes", "balance")
KEYS = ("scene", *OF_PLAN, *(key for key in recipes.KEYS if key != "scene"))


@dataclass(frozen=True, kw_only=True)
class Render:
    """Render of a sweep.

    Attributes
    ----------
    index : int
        Number in the plan, from 0.
    output : str
        Name of the file in the sweep's folder.
    parameters : dict
        Values of the scene's parameters.
    seed : int
        Seed of rays, speckle and noise.
    redrawn : int
        Number of repeated draws of the plan's `redraw` parameters.
    recipe : Recipe
        Scene, and how its parameters are drawn.
    split : str or None
        Subset of the plan: ``train``, ``val`` or ``test``; None without a split.
    """

    index: int
    output: str
    parameters: dict[str, Any]
    seed: int
    redrawn: int = 0
    recipe: Recipe = field(repr=False, compare=False)
    split: str | None = None


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a sweep with ``len(plan)`` renders; ``plan.render(k)`` returns a render.

    Attributes
    ----------
    path : str
        Absolute path of the plan.
    home : str
        Parent of the default folder: the plan's folder, or for a plan that comes with mitsonar the current one.
    pattern : Pattern
        Pattern of the names of outputs.
    seed : int
        Seed of all draws and of the seeds of renders.
    count : int
        Number of renders. With more of them (``dataclasses.replace(plan, count=...)``), a plan begins with the same.
    previews : bool
        True to write a PNG beside each file.
    recipes : tuple of Recipe
        Scenes, and how their parameters are drawn.
    turns : SharedTurns or None
        Turns of several scenes; None for one.
    split : Split or None
        Subsets for training, validation and test.
    classes : tuple of str or None
        Classes of objects in the order of their label numbers.
    stamp : str
        SHA-256 of plan and tables: one stamp, the same renders.
    soundings : dict or None
        Options of `mitsonar.soundings` and of its file, if renders are lines of soundings; None for pictures.
    balance : dict or None
        Numbers and shares of labelled pictures that are asked for; see `mitsonar.sweep.balance`.
    """

    path: str
    home: str
    pattern: Pattern
    seed: int
    count: int
    previews: bool
    recipes: tuple[Recipe, ...]
    turns: SharedTurns | None = field(repr=False)
    split: Split | None = field(repr=False)
    classes: tuple[str, ...] | None
    stamp: str = field(repr=False)
    soundings: dict[str, Any] | None = None
    balance: dict[str, Any] | None = None

    def __len__(self):
        return self.count

    def __repr__(self):
        return (f"<{type(self).__module__.rpartition('.')[0]}.Plan {self.path!r}: {self.count:,} "
                f"render{'s' * (self.count != 1)} of {', '.join(recipe.name for recipe in self.recipes)}, "
                f"seed {self.seed}>")

    @property
    def scene(self) -> str:
        """Return the path of the first scene, in most plans the only one."""
        return self.recipes[0].scene

    @property
    def fixed(self) -> dict[str, Any]:
        """Return the parameters of the first scene that have a single value."""
        return self.recipes[0].fixed

    @property
    def table(self) -> dict[str, tuple]:
        """Return the columns of the table of the first scene."""
        return self.recipes[0].table

    @property
    def lists(self) -> dict[str, tuple]:
        """Return the lists of the first scene, side by side."""
        return self.recipes[0].lists

    @property
    def grid(self) -> dict[str, tuple]:
        """Return the crossed values of the first scene."""
        return self.recipes[0].grid

    @property
    def draws(self) -> dict[str, Rule]:
        """Return the rules of the parameters of the first scene that are drawn or follow from others."""
        return self.recipes[0].rules

    @property
    def seeds(self) -> int | tuple[int, ...]:
        """Return the number of renders of every combination of the first scene, or their seeds."""
        return self.recipes[0].seeds

    @property
    def inputs(self) -> Inputs:
        """Return the files of the first scene."""
        return self.recipes[0].inputs

    @property
    def labels(self) -> dict[str, Any] | None:
        """Return the rules of labels of the first scene; None if renders are no samples."""
        return self.recipes[0].labels

    @property
    def redraw(self) -> bool:
        """Return True if some parameters are drawn again when a scene is refused."""
        return any(recipe.redraw for recipe in self.recipes)

    def turn(self, index: int) -> tuple[Recipe, int]:
        """Return the recipe of a render, and the render's number among those of that recipe."""
        scene, own = (0, index) if self.turns is None else self.turns[index]
        return self.recipes[scene], own

    def render(self, index: int, redrawn: int = 0) -> Render:
        """Return the render ``index`` with its `redraw` parameters drawn again ``redrawn`` times.

        Raises
        ------
        IndexError
            If the plan has no such render.
        ValueError
            If its values do not fit the pattern of names, or an expression has none.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"render {index} was asked for, but the plan has {len(self)} renders")
        recipe, own = self.turn(index)
        place, subset = recipe.place(own), None
        try:
            if self.split is None:
                parameters = recipe.parameters(place, redrawn)
            else:
                subset, parameters = self.split.parameters(recipe, place, redrawn)
        except ValueError as error:
            raise ValueError(f"render {index}: {error}") from None
        seed = recipe.render_seed(place)
        named = {**parameters, **({"scene": recipe.name} if self.turns is not None else {}),
                 **({"split": subset} if subset else {})}
        return Render(index=index, output=self.pattern.name(index, seed, named), parameters=parameters, seed=seed,
                      redrawn=redrawn, recipe=recipe, split=subset)

    def digest(self, render: Render) -> str:
        """Return a SHA-256 of all inputs of a render, in hexadecimal."""
        return self.digests()(render)

    def digests(self) -> Callable[[Render], str]:
        """Return `digest` for many renders, of files that do not change in the meantime."""
        digests = {recipe.name: recipe.inputs.digests() for recipe in self.recipes}
        options = {recipe.name: options_digest(product)
                   for recipe in self.recipes if (product := self._product(recipe))}

        def digest(render: Render) -> str:
            inputs = digests[render.recipe.name](texts(render))
            if render.recipe.name not in options:
                return inputs
            return hashlib.sha256(f"{inputs} {options[render.recipe.name]}".encode()).hexdigest()

        return digest

    def _product(self, recipe):
        """Return what decides about the file of a render, beside its record."""
        if self.soundings or recipe.labels is None:
            return self.soundings or {}
        return {**recipe.labels, "classes": self.classes}


def texts(render: Render) -> dict[str, str]:
    """Return the parameters of a render as text."""
    return {name: scenes.text(name, value) for name, value in render.parameters.items()}


def load_plan(path: FilePath) -> Plan:
    """Read a plan and check it as far as possible without rendering.

    Parameters
    ----------
    path : str or path
        TOML (see scenes/manual/sweeps.md), or the name of a plan that comes with mitsonar, such as ``minefield``.

    Returns
    -------
    Plan
        Checked plan.

    Raises
    ------
    FileNotFoundError
        If plan, scene, table or a file they name is missing.
    ValueError
        If the plan is wrong; the message has the key, its value, and what belongs there.
    """
    shipped = _shipped(path)
    path = os.path.abspath(path if shipped is None else shipped)
    given, place = _toml(path), os.path.dirname(path)
    try:
        return _plan(path, place, place if shipped is None else os.getcwd(), given)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _shipped(name):
    """Return the path of a plan that comes with mitsonar, or None for a file or an unknown name."""
    if os.path.isfile(name) or os.path.dirname(name):
        return None
    name = os.fspath(name)
    shipped = files("mitsonar.scenes") / (name if name.endswith(".toml") else f"{name}.toml")
    return str(shipped) if shipped.is_file() else None


def _plan(path, place, home, given):
    unknown = [key for key in given if key not in KEYS]
    if unknown:
        raise ValueError(f"the plan has the unknown key {shortened(unknown[0])}"
                         f"{meant(unknown[0], KEYS)}; known: {', '.join(KEYS)}")
    seed = whole(given.get("seed", 0), "seed", 0, MOST_SEEDS - 1)
    previews = given.get("previews", False)
    if not isinstance(previews, bool):
        raise ValueError(f"previews is {shortened(previews)}; give true or false")
    parts = parts_of(given)
    made = tuple(recipes_of(parts, place, seed, "scenes" in given))
    count, turns = _count(given, made, seed)
    split = Split(dict(section(given, "split")), made, seed) if "split" in given else None
    own = {**({"scene": tuple(recipe.name for recipe in made)} if turns is not None else {}),
           **({"split": tuple(split.shares)} if split is not None else {})}
    pattern = Pattern(given.get("output", "{index:06}.exr"), set.intersection(*(set(recipe.names) for recipe in made)),
                      set().union(*(recipe.inputs.paths() for recipe in made)), own)
    _check_redraw(made, pattern)
    classes = names_of(given, "classes") or None
    soundings = soundings_of(dict(section(given, "soundings")), pattern.suffix, place, previews)
    labelled = [labels_of(dict(section(part, "labels")), pattern.suffix, previews, classes) for part in parts]
    made = tuple(replace(recipe, labels=labels) for recipe, labels in zip(made, labelled, strict=True))
    tables = dict.fromkeys(file for part in parts for file in recipes.files_of(part, place))
    plan = Plan(path=path, home=home, seed=seed, pattern=pattern, count=count, recipes=made, turns=turns, split=split,
                soundings=soundings, previews=previews, classes=classes, stamp=_stamp(path, *tables),
                balance=balance_of(given.get("balance"), _all_labels(labelled), classes or ()))
    _check_renders(plan)
    return plan


def _all_labels(labelled):
    """Return the rules of labels of all scenes, with the negatives of each; None if renders are no samples."""
    if labelled[0] is None:
        return None
    return {**labelled[0], "negatives": list(dict.fromkeys(
        name for labels in labelled for name in (*labels.get("negatives", ()), *filter(None, [labels.get(
            "negative_class")]))))}


def _count(given, made, seed):
    """Return the number of renders, and the turns of several scenes."""
    if "scenes" in given:
        if "renders" not in given:
            raise ValueError("the plan of several scenes says not how many renders it makes; give renders = 1000")
        return (whole(given["renders"], "renders", 1, MOST_RENDERS),
                SharedTurns([recipe.share for recipe in made], seed, "scenes"))
    if "renders" in given:
        raise ValueError("renders is the number of all renders of several [[scenes]]; give samples, the draws of every "
                         "combination")
    samples, recipe = whole(given.get("samples", 1), "samples", 1, MOST_RENDERS), made[0]
    if samples > 1 and not recipe.is_drawn:
        raise ValueError(f"samples is {samples}, but no parameter is drawn, so that all would be alike; add [draw], or "
                         "take seeds")
    count = samples * recipe.sizes()[0] * recipe.combinations()
    if count > MOST_RENDERS:
        many = f"{count:,}" if count < 1e15 else "over 1e15"
        raise ValueError(f"the plan makes {many} renders; make it at most {MOST_RENDERS:,}")
    return count, None


def _stamp(*paths):
    return hashlib.sha256("".join(map(sha256, paths)).encode()).hexdigest()


def _check_redraw(made, pattern):
    again = next((name for recipe in made for name in recipe.redraw if name in pattern.parameters), None)
    if again is not None:
        raise ValueError(f"output holds the parameter {again}, which redraw may draw again; name files by {{index}}")


def _check_renders(plan):
    """Raise `ValueError` if names are not different, or values do not fit the scenes."""
    _check_output(plan)
    needing = any(rule.needs for recipe in plan.recipes for rule in recipe.rules.values())
    if plan.split is not None or plan.turns is not None or needing:
        tried = min(len(plan), MOST_TRIED)
        renders = [plan.render(number * len(plan) // tried) for number in range(tried)]
        if plan.split is not None:
            plan.split.check((recipe, recipe.place(own), render.split) for render in renders
                             for recipe, own in [plan.turn(render.index)])
    for recipe in plan.recipes:
        columns = {name: column for name, column in recipe.columns().items() if column}
        first = recipe.parameters(recipe.place(0))
        recipe.inputs.check_kinds({**{name: (first[name],) for name in recipe.rules}, **columns})


def _check_output(plan):
    """Raise `ValueError` if two renders have one name, also for file systems that ignore case, and keys of samples."""
    if plan.pattern.numbered() and not plan.pattern.parameters:
        return
    seen = {}
    for index in range(len(plan)):
        name = plan.render(index).output
        known = hash((name if plan.labels is None else key_of(name)).casefold())
        if seen.setdefault(known, index) != index:
            other = seen[known]
            raise ValueError(f"output names both render {other} and render {index} {shortened(name)}; put {{index}} or "
                             "all that varies into it")


def _toml(path):
    try:
        import tomllib
    except ModuleNotFoundError:                        # before Python 3.11
        import tomli as tomllib  # pyright: ignore[reportMissingImports]  Python 3.10 needs it

    known = sorted(entry.name[:-5] for entry in files("mitsonar.scenes").iterdir() if entry.name.endswith(".toml"))
    hint = meant(os.path.basename(path).removesuffix(".toml"), known)
    check_file(path, "plan", LARGEST_PLAN, "a TOML file", f" or one of: {', '.join(known)}{hint}")
    try:
        with open(path, "rb") as file:
            return tomllib.load(file)
    except UnicodeDecodeError:
        raise ValueError(f"the plan {path} is not a text file; give a TOML file") from None
    except (ValueError, RecursionError) as error:      # TOMLDecodeError, or impossible numbers and dates
        with open(path, "rb") as file:
            start = file.read(1000).lstrip(b"\xef\xbb\xbf \t\r\n")
        if start.startswith(b"<"):
            raise ValueError(f"{path} is XML, a scene perhaps; a plan is a TOML file that names its scene: "
                             'scene = "FILE.xml"') from None
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else " ".join(str(error).split())
        raise ValueError(f"cannot read the plan {path}: {reason[:300]}") from None
