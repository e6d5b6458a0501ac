"""The manual as a site: hooks of MkDocs that collect its pages where they stand and make the reference.

Pages keep their paths in the repository, so that their links lead to the same places here and there. Tutorials become
pages of their words and code. A link to any other text file leads to a page that shows the file. The reference has a
page per public room of the package, made of `__all__` and docstrings, and one of all commands.
"""
import importlib
import os
import pkgutil
import posixpath
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import ModuleType, UnionType
from typing import Any, TypeVar

import jupytext
from latex2mathml.converter import convert as mathml
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files, InclusionLevel

import mitsonar
from mitsonar.cli.main import _parser

ROOT = Path(__file__).resolve().parents[2]
INDEX, TUTORIALS = "scenes/README.md", "scenes/tutorials/README.md"
BEHIND = ["tests/README.md", "mitsonar/README.md", "mitsonar/CONTRIBUTING.md", "mitsonar/CHANGELOG.md"]
WIDE = ".md-grid {max-width: 82rem}\n"         # lines of code have 120 characters
PICTURES = ".gif", ".png"
LINK = re.compile(r"(?<=\]\()(?!https?://|mailto:|#)([^)\s#]+)")
FENCE = re.compile(r"^```.*?^```$", re.M | re.S)
FILE = re.compile(r"(?<![\[`])`((?:README|(?:mitsonar|plugins|scenes|tests)/[\w/]+)\.md)`(?!\])")
NAME = re.compile(r"(?<![\[`])`((?:mitsonar\.)[\w.]+)(\([^`]*\))?`(?!\])")


def listed(page: str) -> Iterator[tuple[str, list[str]]]:
    """Yield the sections of a page and the pages that its links lead to, each once."""
    text, seen = (ROOT / page).read_text(encoding="utf-8"), set()
    for title, part in re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", text, re.M | re.S):
        found = [posixpath.normpath(posixpath.join(posixpath.dirname(page), name)) for name in LINK.findall(part)]
        pages = [name for name in dict.fromkeys(found) if "/manual/" in name and name not in seen]
        seen.update(pages)
        if pages:
            yield title, pages


def rooms() -> dict[str, ModuleType]:
    """Return the public rooms of the package by their names."""
    named = {name: getattr(mitsonar, name) for name in mitsonar.__all__ if name not in ("plugins", "scenes")}
    return {name: room for name, room in named.items() if isinstance(room, ModuleType)}


def public(module: ModuleType) -> list[str]:
    """Return the public names of a module: `__all__`, else the modules of a package, or what a module defines."""
    if hasattr(module, "__all__"):
        return sorted(module.__all__, key=str.lower)
    if hasattr(module, "__path__"):
        return sorted(part.name for part in pkgutil.iter_modules(module.__path__) if not part.name.startswith("_"))
    return [name for name, value in vars(module).items()
            if not name.startswith("_") and getattr(value, "__module__", None) == module.__name__]


def member(module: ModuleType, name: str) -> Any:
    """Return a public name of a module, or the module of that name in it."""
    try:
        return getattr(module, name)
    except AttributeError:
        return importlib.import_module(f"{module.__name__}.{name}")


def documented(module: ModuleType, path: str, level: int = 2) -> Iterator[tuple[str, str]]:
    """Yield the public paths of a module's names and the blocks that mkdocstrings replaces."""
    for name in public(module):
        value, here = member(module, name), f"{path}.{name}"
        if isinstance(value, (TypeVar, UnionType)):
            continue
        if isinstance(value, ModuleType):
            yield here, f"{titled(here, level)}\n\n{value.__doc__}\n"
            yield from documented(value, here, level + 1) if level < 3 else ()
        elif callable(value):
            yield here, f"::: {here}\n    options: {{heading_level: {level}}}\n"
        else:
            yield here, f"{titled(here, level)}\n\n{data(value)}\n"


def titled(path: str, level: int) -> str:
    """Return the heading of a module or constant, by whose path other pages link to it."""
    return f"{'#' * level} `{path}` {{#{path} data-toc-label='{path.rpartition('.')[2]}'}}"


def data(value: Any) -> str:
    """Return what a constant holds: records as a table, other entries by their names."""
    if not isinstance(value, Mapping):
        return f"`{value!r}`"
    records = list(value.values())
    if not all(is_dataclass(record) and type(record) is type(records[0]) for record in records):
        return ", ".join(f"`{name}`" for name in value)
    rows = {name: [cell(getattr(record, field.name)) for field in fields(record)] for name, record in value.items()}
    columns = [number for number, field in enumerate(fields(records[0]))
               if field.name != "name" and any(row[number] for row in rows.values())]
    names = [fields(records[0])[number].name for number in columns]
    lines = [["name", *names], ["---"] * (1 + len(names)),
             *([f"`{name}`", *(row[number] for number in columns)] for name, row in rows.items())]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def cell(value: Any) -> str:
    """Return a value as a table shows it; functions and what is not there as nothing."""
    if value is None or callable(value):
        return ""
    return ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)


def reference() -> dict[str, str]:
    """Return the pages of the reference by their paths."""
    own = [name for name in mitsonar.__all__ if name not in rooms() and name != "plugins"]
    blocks = [f"::: mitsonar.{name}\n" for name in own]
    pages = {"reference/mitsonar.md": "\n".join(["# mitsonar\n", "The verbs, and what they raise.\n", *blocks])}
    for name, room in rooms().items():
        blocks = [block for _, block in documented(room, f"mitsonar.{name}")]
        pages[f"reference/{name}.md"] = "\n".join([
            f"# mitsonar.{name} {{#mitsonar.{name}}}\n", room.__doc__ or "", *blocks])
    os.environ["COLUMNS"] = "100"
    commands = next(action for action in _parser()._actions if action.dest == "command").choices
    pages["reference/commands.md"] = "# Commands\n\n`python3 -m mitsonar COMMAND` in a checkout, `mitsonar COMMAND` "\
        "where it is installed.\n\n" + "\n".join(f"## {name}\n\n```text\n{parser.format_help().rstrip()}\n```\n"
                                                 for name, parser in commands.items())
    return pages


def tutorial(path: Path) -> str:
    """Return a tutorial as a page: its words, its code, and formulas as MathML."""
    cells = []
    for cell in jupytext.read(path).cells:
        if cell.cell_type == "code":
            cells.append(f"```python\n{cell.source}\n```")
            continue
        text = re.sub(r"\$\$(.+?)\$\$", lambda found: mathml(found[1], display="block"), cell.source, flags=re.S)
        cells.append(re.sub(r"(`[^`]*`)|\$([^$]+)\$", lambda found: found[1] or mathml(found[2]), text))
    return "\n\n".join(cells) + "\n"


def shown(path: Path) -> str:
    """Return the page that shows a file."""
    language = {".py": "python", ".xml": "xml", ".toml": "toml", ".yml": "yaml"}.get(path.suffix, "text")
    text = path.read_text(encoding="utf-8")
    return f"---\nsearch: {{exclude: true}}\n---\n# {path.relative_to(ROOT)}\n\n````{language}\n{text}````\n"


class Site:
    """Pages of the site: those of the repository, and what their links lead to."""

    def __init__(self) -> None:
        self.sections = list(listed(INDEX))
        order = (ROOT / TUTORIALS).read_text(encoding="utf-8")
        scripts = sorted((ROOT / TUTORIALS).parent.glob("*.py"), key=lambda path: order.find(path.name))
        self.tutorials = {path.with_suffix(".md").relative_to(ROOT).as_posix(): path for path in scripts}
        self.reference = reference()
        manual = [page.relative_to(ROOT).as_posix() for page in sorted((ROOT / "scenes" / "manual").glob("*.md"))]
        self.pages = ["README.md", INDEX, *manual, TUTORIALS, "plugins/README.md", *BEHIND]
        self.others: set[str] = set()              # files that pages link to

    def navigation(self) -> list[Any]:
        names = [name for name in self.reference if name not in ("reference/mitsonar.md", "reference/commands.md")]
        return [{"Overview": "README.md"}, {"Manual": [INDEX, *({title: pages} for title, pages in self.sections)]},
                {"Tutorials": [TUTORIALS, *self.tutorials]},
                {"Reference": [{"Plugins": "plugins/README.md"}, "reference/commands.md", "reference/mitsonar.md",
                               *sorted(names)]}, {"Inside": BEHIND}]

    def target(self, page: str, link: str) -> str:
        """Return where a link of a page leads to on the site."""
        path = posixpath.normpath(posixpath.join(posixpath.dirname(page), link))
        suffix = posixpath.splitext(path)[1]
        if path.removesuffix(suffix) + ".md" in self.tutorials:
            return link.removesuffix(suffix) + ".md"
        if suffix == ".md" or not (ROOT / path).is_file():
            return link                            # MkDocs says if it leads nowhere
        self.others.add(path)
        return link if suffix in PICTURES else f"{link}.md"

    def text(self, page: str) -> str:
        """Return the text of a page: links as the site needs them, and names in code as links to what they name."""
        def prose(part: str) -> str:
            up = "../" * page.count("/")
            part = LINK.sub(lambda link: self.target(page, link[1]), part)
            part = FILE.sub(lambda found: f"[`{found[1]}`]({up}{found[1]})", part)
            return NAME.sub(lambda found: f"[{found[0]}][{found[1]}]" if found[1] in self.names else found[0], part)

        text = tutorial(self.tutorials[page]) if page in self.tutorials else (ROOT / page).read_text(encoding="utf-8")
        fences = FENCE.findall(text)
        return "".join(prose(part) + fence for part, fence in zip(FENCE.split(text), [*fences, ""]))

    @property
    def names(self) -> set[str]:
        """Names that the reference has."""
        heading = re.compile(r"^(?:::: |#+ .+ \{#)([\w.]+)", re.M)
        return {name for page in self.reference.values() for name in heading.findall(page)}


def anchor(heading: str, _: str) -> str:
    """Return the name that links use for a heading, as hosts of repositories make it."""
    return re.sub(r"[^\w\- ]", "", heading).strip().lower().replace(" ", "-")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Set the navigation."""
    config.extra["pages"] = site = Site()
    config.nav = site.navigation()
    config.mdx_configs["toc"]["slugify"] = anchor
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Replace the files of the folder by those of the site; keep what plugins have added."""
    site = config.extra["pages"]
    pages = {page: site.text(page) for page in (*site.pages, *site.tutorials)} | site.reference
    folder = Path(config.docs_dir)
    kept = [file for file in files if file.abs_src_path is None or not Path(file.abs_src_path).is_relative_to(folder)]
    made = [File.generated(config, path, content=text) for path, text in pages.items()]
    for path in sorted(site.others):
        made.append(File.generated(config, path, abs_src_path=str(ROOT / path)) if path.endswith(PICTURES) else
                    File.generated(config, f"{path}.md", content=shown(ROOT / path),
                                   inclusion=InclusionLevel.NOT_IN_NAV))
    made.append(File.generated(config, "reference/wide.css", content=WIDE))
    return Files([*kept, *made])
