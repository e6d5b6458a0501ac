"""Description of a scene file: its heading, its parameters with their defaults, and where these are used.

The heading is the comment before ``<scene>``. A comment behind a ``<default>``, on its line, says what the parameter
means.
"""
import re
from dataclasses import dataclass
from xml.etree import ElementTree

from mitsonar.device.files import FilePath

from .scenes import root


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A parameter of a scene."""

    name: str
    default: str
    comment: str  # of the file's author
    uses: tuple[tuple[str, str, str], ...]  # type and id of the object, and the attribute that the value becomes


def described(path: FilePath) -> tuple[str, list[Parameter]]:
    """Read the heading and the parameters of a scene file, in the order of the file."""
    root(path)                                     # raises a clear error for a bad file
    with open(path, encoding="utf-8", errors="replace") as stream:
        heading = re.search(r"^[^<]*(?:<\?[^>]*\?>)?\s*<!--(.*?)-->", stream.read(), re.DOTALL)
    top = ElementTree.parse(path, ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))).getroot()
    found, uses = {}, {}
    for element in top.iter():
        children = list(element)
        for child, behind in zip(children, [*children[1:], None]):
            if child.tag == "default":
                comment = ""
                if behind is not None and behind.tag is ElementTree.Comment and "\n" not in (child.tail or ""):
                    comment = _line(behind.text)
                found.setdefault(child.get("name"), (child.get("value", ""), comment))
            elif isinstance(child.tag, str) and element.get("type"):
                for value in child.attrib.values():
                    for name in re.findall(r"(?<!\\)\$(\w+)", value):
                        uses.setdefault(name, []).append((element.get("type"), element.get("id", ""),
                                                          child.get("name", "")))
    return _heading(heading[1]) if heading else "", [
        Parameter(name=name, default=value, comment=comment, uses=tuple(uses.get(name, ())))
        for name, (value, comment) in found.items()]


def _heading(text):
    """Return a heading's paragraphs, one line each; a command is a line of its own."""
    paragraphs = [""]
    for line in map(str.strip, text.splitlines()):
        if line.startswith("mitsonar "):
            paragraphs += [line, ""]
        else:
            paragraphs[-1] = f"{paragraphs[-1]} {line}".strip()
    return "\n".join(filter(None, paragraphs))


def _line(text):
    return " ".join((text or "").split())
