"""Plan of a sweep: a scene, values of its parameters and names of its renders, from a TOML file.

    renders = samples x seeds x rows of the table x length of the lists x grid

in this order, with the last parameter of the grid running fastest. More samples, or more rows with one sample and one
seed, therefore follow the existing renders.
"""
import hashlib
import itertools
import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from importlib.resources import files
from typing import Any

from mitsonar.device.files import FilePath
from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import scenes, tables
from mitsonar.labels.samples import key_of

from .balance import balance_of
from .inputs import Inputs
from .manifest import sha256
from .names import Pattern
from .products import labels_of, options_digest, soundings_of
from .strata import draw, stratified_bits
from .values import Draw, axis, random_bits, shortened, value, whole

MOST_RENDERS = 1_000_000
LARGEST_PLAN, LARGEST_TABLE = 10_000_000, 200_000_000           # bytes
MOST_SEEDS = 1 << 32                                            # limit of `mitsonar.render`
KEYS = ("scene", "output", "seed", "seeds", "samples", "previews", "redraw", "classes", "table", "set", "list", "grid",
        "draw", "soundings", "labels", "balance")


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
    """

    index: int
    output: str
    parameters: dict[str, Any]
    seed: int
    redrawn: int = 0


@dataclass(frozen=True, kw_only=True)
class Plan:
    """Plan of a sweep with ``len(plan)`` renders; ``plan.render(k)`` returns a render.

    Attributes
    ----------
    path, scene : str
        Absolute paths of plan and scene.
    home : str
        Parent of the default folder: the plan's folder, or for a plan that comes with mitsonar the current one.
    pattern : Pattern
        Pattern of the names of outputs.
    seed : int
        Seed of all draws and of the seeds of renders.
    seeds : int or tuple of int
        Number of renders of every combination, or their seeds.
    samples : int
        Number of draws of every combination.
    previews : bool
        True to write a PNG beside each file.
    fixed : dict
        Parameters with a single value.
    table, lists, grid : dict of str to tuple
        Parameters with several values: columns of equal length (table and lists), and crossed ones (grid).
    draws : dict of str to Draw
        Parameters drawn at random.
    redraw : tuple of str
        Parameters that are drawn again if the scene refuses them, for example if its targets do not fit.
    classes : tuple of str or None
        Classes of objects in the order of their label numbers.
    inputs : Inputs
        Files of the scene.
    stamp : str
        SHA-256 of plan and table: one stamp, the same renders.
    soundings : dict or None
        Options of `mitsonar.soundings` and of its file, if renders are lines of soundings; None for pictures.
    labels : dict or None
        Rules of labels, if renders are samples; None for others.
    balance : dict or None
        Numbers and shares of labelled pictures that are asked for; see `mitsonar.sweep.balance`.
    """

    path: str
    scene: str
    home: str
    pattern: Pattern
    seed: int
    seeds: int | tuple[int, ...]
    samples: int
    previews: bool
    fixed: dict[str, Any]
    table: dict[str, tuple]
    lists: dict[str, tuple]
    grid: dict[str, tuple]
    draws: dict[str, Draw]
    redraw: tuple[str, ...]
    classes: tuple[str, ...] | None
    inputs: Inputs = field(repr=False)
    stamp: str = field(repr=False)
    soundings: dict[str, Any] | None = None
    labels: dict[str, Any] | None = None
    balance: dict[str, Any] | None = None

    def __len__(self):
        return self.samples * self._seeds() * math.prod(self._sizes())

    def render(self, index: int, redrawn: int = 0) -> Render:
        """Return the render ``index`` with its `redraw` parameters drawn again ``redrawn`` times.

        Raises
        ------
        IndexError
            If the plan has no such render.
        ValueError
            If its values do not fit the pattern of names.
        """
        if not 0 <= index < len(self):
            raise IndexError(f"render {index} was asked for, but the plan has {len(self)} renders")
        sizes, rest, places = [self._seeds(), *self._sizes()], index, []
        for size in reversed(sizes):
            rest, place = divmod(rest, size)
            places.insert(0, place)
        sample, (repeat, row, item, *crossed) = rest, places
        combination = index % (combinations := math.prod(sizes[1:]))
        parameters = {**self.fixed, **{name: column[row] for name, column in self.table.items()},
                      **{name: column[item] for name, column in self.lists.items()},
                      **{name: column[place] for (name, column), place in zip(self.grid.items(), crossed)},
                      **{name: drawn.at(stratified_bits(self.seed, name, sample * combinations + combination, *again)
                                        if drawn.stratified else
                                        random_bits(self.seed, name, combination, sample, *again))
                         for name, drawn in self.draws.items()
                         for again in [["again", redrawn] if redrawn and name in self.redraw else []]}}
        seed = (random_bits(self.seed, "", combination, sample, repeat) % MOST_SEEDS if isinstance(self.seeds, int)
                else self.seeds[repeat])
        return Render(index=index, output=self.pattern.name(index, seed, parameters), parameters=parameters, seed=seed,
                      redrawn=redrawn)

    def digest(self, render: Render) -> str:
        """Return a SHA-256 of all inputs of a render, in hexadecimal."""
        return self.digests()(render)

    def digests(self) -> Callable[[Render], str]:
        """Return `digest` for many renders, of files that do not change in the meantime."""
        digest = self.inputs.digests()
        product = self.soundings or ({**self.labels, "classes": self.classes} if self.labels is not None else {})
        if not product:
            return lambda render: digest(texts(render))
        options = options_digest(product)
        return lambda render: hashlib.sha256(f"{digest(texts(render))} {options}".encode()).hexdigest()

    def _seeds(self):
        return self.seeds if isinstance(self.seeds, int) else len(self.seeds)

    def _sizes(self):
        """Return the lengths of the table, the lists and every parameter of the grid."""
        first = [len(next(iter(columns.values()), (None,))) for columns in (self.table, self.lists)]
        return [*first, *map(len, self.grid.values())]


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
    if "scene" not in given:
        raise ValueError('the plan names no scene; write scene = "FILE.xml" at its beginning')
    beside = os.path.join(place, name := _text(given, "scene"))
    scene = os.path.abspath(beside if os.path.isfile(beside) else scenes.find(name))
    seed = whole(given.get("seed", 0), "seed", 0, MOST_SEEDS - 1)
    seeds = _seeds(given.get("seeds", 1))
    samples = whole(given.get("samples", 1), "samples", 1, MOST_RENDERS)
    previews = given.get("previews", False)
    if not isinstance(previews, bool):
        raise ValueError(f"previews is {shortened(previews)}; give true or false")
    fixed = {name: value(item, f"set.{name}") for name, item in _section(given, "set")}
    inputs = Inputs(scene, place)
    table = _table(os.path.join(place, _text(given, "table")), inputs.known) if "table" in given else {}
    lists = {name: axis(item, f"list.{name}") for name, item in _section(given, "list")}
    grid = {name: axis(item, f"grid.{name}") for name, item in _section(given, "grid")}
    draws = {name: draw(item, f"draw.{name}") for name, item in _section(given, "draw")}
    named = list(itertools.chain(fixed, table, lists, grid, draws))
    twice = next((name for name in named if named.count(name) > 1), None) if len(set(named)) < len(named) else None
    if twice is not None:
        raise ValueError(f"the parameter {twice} is given twice; leave one out")
    lengths = {name: len(column) for name, column in lists.items()}
    if len(set(lengths.values())) > 1:
        raise ValueError(f"the lists of [list] run side by side, and have the lengths {shortened(lengths)}; make them "
                         "equal, or move them to [grid], which crosses them")
    inputs.check_names(named)
    columns = {**{name: (item,) for name, item in fixed.items()}, **table, **lists, **grid,
               **{name: drawn.choices for name, drawn in draws.items()}}
    inputs.check_files(columns)
    pattern = Pattern(given.get("output", "{index:06}.exr"), named, inputs.paths())
    soundings = soundings_of(dict(_section(given, "soundings")), pattern.suffix, place, previews)
    classes = _names(given, "classes") or None
    labels = labels_of(dict(_section(given, "labels")), pattern.suffix, previews, classes)
    plan = Plan(path=path, scene=scene, home=home, seed=seed, pattern=pattern, seeds=seeds, soundings=soundings,
                labels=labels, balance=balance_of(given.get("balance"), labels, classes or ()),
                samples=samples, previews=previews, fixed=fixed, table=table, lists=lists, grid=grid, draws=draws,
                redraw=_names(given, "redraw"), classes=classes, inputs=inputs,
                stamp=_stamp(path, *([os.path.join(place, given["table"])] if "table" in given else [])))
    _check_redraw(plan)
    if samples > 1 and not draws:
        raise ValueError(f"samples is {samples}, but no parameter is drawn, so that all would be alike; add [draw], or "
                         "take seeds")
    count = plan.samples * plan._seeds() * math.prod(plan._sizes())        # len() is limited to 63 bits
    if count > MOST_RENDERS:
        many = f"{count:,}" if count < 1e15 else "over 1e15"
        raise ValueError(f"the plan makes {many} renders; make it at most {MOST_RENDERS:,}")
    _check_output(plan)
    inputs.check_kinds({**{name: (item,) for name, item in plan.render(0).parameters.items() if name in draws},
                        **{name: column for name, column in columns.items() if column}})
    return plan


def _stamp(*paths):
    return hashlib.sha256("".join(map(sha256, paths)).encode()).hexdigest()


def _names(given, key):
    """Return the names in a list of the plan; () without the list."""
    names = given.get(key, [])
    if not (isinstance(names, list) and all(isinstance(name, str) and name for name in names)
            and len(set(names)) == len(names)):
        raise ValueError(f"{key} is {shortened(names)}; give a list of different names")
    return tuple(names)


def _check_redraw(plan):
    for name in plan.redraw:
        if name not in plan.draws:
            raise ValueError(f"redraw names {shortened(name)}{meant(name, plan.draws)}, which is not drawn; give "
                             f"parameters of [draw]: {', '.join(plan.draws) or 'it has none'}")
        if name in plan.pattern.parameters:
            raise ValueError(f"output holds the parameter {name}, which redraw may draw again; name files by "
                             "{index}")


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
    _check_file(path, "plan", LARGEST_PLAN, "a TOML file", f" or one of: {', '.join(known)}{hint}")
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


def _check_file(path, role, largest, wanted, otherwise=""):
    if not os.path.exists(path):
        raise FileNotFoundError(f"the {role} {path} does not exist; give the path of {wanted}{otherwise}")
    if not os.path.isfile(path):
        raise ValueError(f"the {role} {path} is no file; give the path of {wanted}")
    if os.path.getsize(path) > largest:
        raise ValueError(f"the {role} {path} has {os.path.getsize(path):,} bytes; give {wanted} of at most {largest:,}")


def _text(given, key):
    text = given[key]
    if not isinstance(text, str) or not text or not text.isprintable():
        raise ValueError(f"{key} is {shortened(text)}; give the name of a file")
    return text


def _section(given, key):
    section = given.get(key, {})
    if not isinstance(section, dict):
        raise ValueError(f"{key} is {shortened(section)}; write parameters under [{key}]")
    return section.items()


def _seeds(given):
    if not isinstance(given, list):
        return whole(given, "seeds", 1, MOST_RENDERS)
    seeds = tuple(whole(item, "seeds", 0, MOST_SEEDS - 1) for item in given)
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"seeds is {shortened(given)}; give different whole numbers, at least one")
    return seeds


def _table(path, known):
    """Return the columns of a CSV file by name, spelt as in the scene, with numbers where values read as such."""
    _check_file(path, "table", LARGEST_TABLE, "a CSV file")
    names, lines, rows = tables.records(path, "table")
    if len(set(names)) < len(names) or not all(names):
        raise ValueError(f"the table {path} has the columns {shortened(names)}; give each a name of its own")
    spelt = {name.lower(): name for name in known}
    for line, row in zip(lines, rows, strict=True):
        if len(row) > len(names):
            raise ValueError(f"{path}, line {line}: {len(row)} fields, but the header names {len(names)}; name the "
                             "rest or remove it")
    return {spelt.get(name, name): tuple(_cell(row[k], f"{path}, line {line}: {name}")
                                         for line, row in zip(lines, rows, strict=True))
            for k, name in enumerate(names)}


def _cell(text, where):
    """Return a number if its usual spelling is the text, so that "007" stays text, or a boolean, or the text."""
    text = text.strip()
    for kind in (int, float):
        try:
            read = kind(text)
        except ValueError:
            continue
        return value(read, where) if str(read) == text else text
    return value({"true": True, "false": False}.get(text, text), where)
