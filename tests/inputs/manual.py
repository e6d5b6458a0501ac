"""The pages of the manual as tests read them: their blocks, their links, and a run of pages from top to bottom.

    python tests/inputs/manual.py PAGE ...      in an empty folder

runs the blocks of pages in one process, each page in a folder of its own that has `scenes` in it. Blocks marked
``python`` are executed, each in a namespace of its own; of those marked ``bash`` every line is a command of mitsonar,
and is run but for the one that runs the tests. The demo, plans of sweeps and scenes that take seconds have few pings,
few rays or coarse beds, and a dry run times one render. A block after the line ``<!-- file: NAME -->`` becomes that
file, and one after ``<!-- not run: REASON -->`` is left out.
"""
import os
import re
import shlex
import sys
import xml.etree.ElementTree as xml
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([*ROOT.glob("*.md"), *(page for folder in ("mitsonar", "plugins", "scenes", "tests")
                                      for page in (ROOT / folder).rglob("*.md"))])
BLOCK = re.compile(r"^(?:<!-- (?P<mark>not run|file): (?P<said>.+?) -->\n+)?"
                   r"^```(?P<language>\w*)\n(?P<text>.*?)^```$", re.M | re.S)
DRAWINGS = ("", "text")            # what no program reads
# of scenes that take seconds with the parameters of their pages; a command has these in place of its own
COARSE = {"sidescan_wreck": ["bed_spacing=0.5", "ripple_wavelength=2.4", "stone_scour=0"], "gallery": ["rays=10000"],
          "sector_scan": ["pings=15"], "swimmers": ["pings=2"], "multibeam": ["range=45"], "echo_sounder": ["pings=8"]}
FEW = {"pings": 20, "rays": 5000}  # of a plan or a command: at most


@dataclass(frozen=True, kw_only=True)
class Block:
    """A fenced block of a page.

    Attributes
    ----------
    line : int
        Of its first line in the page.
    language : str
    text : str
    file : str or None
        The name that it is saved under.
    not_run : str or None
        The reason why not.
    """

    line: int
    language: str
    text: str
    file: str | None
    not_run: str | None


def blocks(text: str) -> list[Block]:
    """Return the blocks of a page in order."""
    found = []
    for block in BLOCK.finditer(text):
        said = {block["mark"]: block["said"]}
        found.append(Block(line=text.count("\n", 0, block.start("text")) + 1, language=block["language"],
                           text=block["text"], file=said.get("file"), not_run=said.get("not run")))
    return found


def commands(text: str) -> list[list[str]]:
    """Return what a block of commands has mitsonar do: the words after its name.

    Raises
    ------
    ValueError
        If a line is no command of mitsonar: nobody would run it.
    """
    found = []
    for line in text.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        words = words[2:] if words[:2] == ["python3", "-m"] else words
        if words and words[0] != "mitsonar":
            raise ValueError(f"no command of mitsonar: {line}")
        found += [words[1:]] if words else []
    return found


def anchors(text: str) -> set[str]:
    """Return the names that links within a page may use, as GitHub makes them of its headings."""
    headings = re.findall(r"^#+ +(.+?) *$", re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S), re.M)
    return {re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)).strip().lower().replace(" ", "-")
            for heading in headings}


def links(text: str) -> list[str]:
    """Return the targets of a page's links and pictures."""
    prose = re.sub(r"`[^`\n]*`", "`", re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S))
    return re.findall(r"\]\(([^)\s]+)\)", prose)


def shortened(words: list[str]) -> list[str]:
    """Return the words of a command with few pings and rays, and the coarse parameters of its scene."""
    words = [few(word) for word in words]
    for parameter in COARSE.get(words[1], []) if words[0] in ("render", "soundings") else []:
        name = parameter.partition("=")[0]
        own = next((place for place, word in enumerate(words) if word.startswith(f"{name}=")), None)
        words = [*words, "-D", parameter] if own is None else [*words[:own], parameter, *words[own + 1:]]
    return words


def few(text: str) -> str:
    """Return the text of a plan, or a word of a command, with few pings and rays."""
    return re.sub(r"^((pings|rays) ?= ?)(\d+)", lambda found: f"{found[1]}{min(int(found[3]), FEW[found[2]])}", text,
                  flags=re.M)


def run(page: Path) -> None:
    """Run a page's blocks in order, in a new folder below the current one; print the line of each block first."""
    from kept_processes import kept_processes

    from mitsonar.cli import rendering
    from mitsonar.sweep import estimate

    rendering.DEMO["pings"] = 20       # of 560: the others only take longer
    estimate.LONG_SECONDS = 0.0        # after how long a dry run has enough of its first render
    folder = Path(page.stem)
    folder.mkdir()
    os.chdir(folder)
    Path("scenes").symlink_to(ROOT / "scenes")
    with kept_processes():
        run_blocks(page)


def run_blocks(page: Path) -> None:
    """Run a page's blocks in the current folder."""
    from mitsonar.__main__ import main

    for block in blocks(page.read_text(encoding="utf-8")):
        if block.not_run:
            continue
        print(f"{page.name}, line {block.line}", file=sys.stderr, flush=True)
        if block.file:
            text = few(block.text) if block.language == "toml" else block.text
            Path(block.file).write_text(text, encoding="utf-8")
        elif block.language == "python":
            # the blank lines give tracebacks the page's own line numbers
            exec(compile("\n" * (block.line - 1) + block.text, str(page), "exec"), {"__name__": "__main__"})
        elif block.language == "bash":
            for words in commands(block.text):
                code = words[:1] != ["test"] and main(shortened(words))
                if code:
                    raise SystemExit(f"mitsonar {shlex.join(words)} ended with exit code {code}")
        elif block.language == "xml":
            xml.fromstring(f"<part>{block.text}</part>")
        elif block.language not in DRAWINGS:
            raise SystemExit(f"nothing is known that runs a block of {block.language}")


def take_one_thread() -> None:
    """Render with one thread, as tests do beside other processes of pytest-xdist."""
    import mitsonar.scene.loading

    mitsonar.scene.loading.prepare()
    import drjit as dr

    dr.set_thread_count(1)


if __name__ == "__main__":
    start = Path.cwd()
    if "PYTEST_XDIST_WORKER" in os.environ:
        take_one_thread()
    for name in sys.argv[1:]:
        os.chdir(start)
        run(Path(name))
