"""Inputs of a scene: its parameters, and the files it reads, identified by their content.

Every string of a scene that names an existing file counts as an input. Files are searched beside the scene, then beside
the plan, where the renders run. A folder stands for the files in it.
"""
import hashlib
import os
import re
from collections.abc import Callable, Iterable, Mapping

from mitsonar.device.spelling import meant
from mitsonar.io.scene_files import mesh_lists, meshes, scenes
from mitsonar.plugins import attributes, reference

from .manifest import sha256
from .parts import manifests
from .values import shortened

KINDS = {"float": "a number", "integer": "a whole number", "boolean": "true or false"}
NAME = re.compile(r"(?<!\\)\$([A-Za-z_]\w*)")
LARGEST_SCENE = 100_000_000        # bytes
MOST_FILES = 10_000                # in a folder


class Inputs:
    """Parameters and files of a scene."""

    def __init__(self, scene: str, place: str):
        self.scene, self.folders = scene, (os.path.dirname(scene), place)
        self._trees, self._digests, self._kinds, self.known, self._in_texts = {}, {}, {}, set(), (0, [])
        for path in self._walk({}):
            self.known |= set(self._tree(path)[0])

    def check_names(self, names: Iterable[str]) -> None:
        """Raise `ValueError` for parameters that the scene lacks."""
        for name in names:
            if name not in self.known:
                raise ValueError(f"the scene {os.path.basename(self.scene)} has no parameter {shortened(name)}"
                                 f"{meant(name, self.known)}; it has {', '.join(sorted(self.known)) or 'none'}")

    def defaults(self) -> dict[str, str]:
        """Return the scene's own values of its parameters, without those that contain others."""
        return {name: text for name, text in self._tree(self.scene)[1].items() if name and not NAME.search(text)}

    def check_files(self, columns: Mapping[str, tuple]) -> None:
        """Raise `FileNotFoundError` for values that name missing files."""
        defaults = self._tree(self.scene)[1]
        for path in self._walk({}):
            for kind, attribute, template in self._tree(path)[2]:
                used = [name for name in NAME.findall(template) if name in columns]
                file = self._files(kind).get(attribute)
                if file is None or len(used) > 1:
                    continue
                for item in dict.fromkeys(columns[used[0]]) if used else (None,):
                    values = {**defaults, **({used[0]: scenes.text(used[0], item)} if used else {})}
                    for name in file.names_of_files(scenes.filled(template, values)):
                        if not NAME.search(name) and self._find(name) is None:
                            raise FileNotFoundError(f"the scene {os.path.basename(self.scene)} reads the file {name}, "
                                                    "which is not there; it is looked for beside the scene, then "
                                                    "beside the plan")

    def paths(self) -> set[str]:
        """Return the names of the parameters that name files."""
        return {name for path in self._walk({}) for kind, attribute, template in self._tree(path)[2]
                if type(self._files(kind).get(attribute)) is attributes.File for name in NAME.findall(template)}

    def check_kinds(self, columns: Mapping[str, tuple]) -> None:
        """Raise `ValueError` for values that do not fit the scene's numbers, whole numbers and booleans."""
        for path in self._walk({}):
            for element in scenes.root(path).iter():
                sign, name = (element.get("value") or "")[:1], (element.get("value") or "")[1:]
                if element.tag not in KINDS or sign != "$" or name not in columns:
                    continue
                for item in columns[name]:
                    if not _is_kind(item, element.tag):
                        raise ValueError(f"the parameter {name} is {shortened(item)}; the scene "
                                         f"{os.path.basename(path)} takes {KINDS[element.tag]}")

    def digest(self, values: Mapping[str, str]) -> str:
        """Return a SHA-256 of all inputs of a render, in hexadecimal."""
        inputs = hashlib.sha256()
        for path in self._walk(values):
            inputs.update(f"scene {self._content(path)}\n".encode())
            _, defaults, templates = self._tree(path)
            filled = {scenes.filled(template, {**defaults, **values}) for *_, template in templates}
            for name in sorted({part for text in filled for part in (text, *map(str.strip, text.split(",")))}):
                path_found = self._find(name) if name else None
                if path_found is not None:
                    inputs.update(f"{name} {self._content(path_found)}\n".encode())
                    stated = os.path.join(os.path.dirname(path_found), mesh_lists.NAME)
                    if path_found.lower().endswith(meshes.KINDS) and os.path.isfile(stated):
                        inputs.update(f"{name} {mesh_lists.NAME} {self._content(stated)}\n".encode())
        return inputs.hexdigest()

    def digests(self) -> Callable[[Mapping[str, str]], str]:
        """Return `digest` for many renders, of files that do not change in the meantime."""
        known: dict[tuple[object, ...], str] = {}

        def digest(values: Mapping[str, str]) -> str:
            for _ in range(len(self._trees) + 2):      # an included file may name parameters, too
                trees = len(self._trees)
                names = self._names_in_texts(trees)
                key = trees, *(values.get(name) for name in names)
                if key not in known:
                    known[key] = self.digest(values)
                if len(self._trees) == trees:
                    break
            return known[key]

        return digest

    def _names_in_texts(self, trees):
        """Return the parameters that occur in strings of the files read so far, ``trees`` of them."""
        if self._in_texts[0] != trees:
            self._in_texts = trees, sorted({name for _, _, templates in self._trees.values()
                                            for *_, template in templates for name in NAME.findall(template)})
        return self._in_texts[1]

    def _walk(self, values):
        """Return the paths of the scene and of the files it includes, each once."""
        paths = [self.scene]
        for path in paths:
            _, defaults, templates = self._tree(path)
            for _, attribute, template in templates:
                if attribute == "include":
                    included = self._find(scenes.filled(template, {**defaults, **values}))
                    if included is not None and os.path.isfile(included) and included not in paths:
                        paths.append(included)
        return paths

    def _tree(self, path):
        """Return parameter names, defaults, and (object type, attribute, text) of every string of an XML file."""
        if path not in self._trees:
            if os.path.getsize(path) > LARGEST_SCENE:
                raise ValueError(f"the scene {path} has {os.path.getsize(path):,} bytes; give at most "
                                 f"{LARGEST_SCENE:,}")
            names, defaults, templates = set(), {}, []
            root = scenes.root(path)
            kinds = {child: parent.get("type", "") for parent in root.iter() for child in parent}
            for element in root.iter():
                if element.tag == "default":
                    names.add(element.get("name"))
                    defaults.setdefault(element.get("name"), element.get("value") or "")
                for text in element.attrib.values():
                    names |= set(NAME.findall(text))
                if element.tag == "path":
                    self.folders += (os.path.join(self.folders[0], element.get("value") or ""),)
                if element.tag == "include":
                    templates.append(("", "include", element.get("filename") or ""))
                elif element.tag == "string":
                    templates.append((kinds.get(element, ""), element.get("name"), element.get("value") or ""))
                elif "filename" in element.attrib:
                    templates.append(("", "filename", element.get("filename")))
            self._trees[path] = names - {None}, defaults, templates
        return self._trees[path]

    def _files(self, kind):
        """Return the attributes of an object type that name files."""
        if kind not in self._kinds:
            self._kinds[kind] = reference.input_files(kind)
        return self._kinds[kind]

    def _find(self, name):
        if "\0" in name or len(os.fsencode(name)) > 4000:
            return None
        # a sweep's own folder is no input, since its content changes during the run
        return next((path for path in (os.path.join(folder, name) for folder in self.folders) if os.path.isfile(path)
                     or os.path.isdir(path) and not manifests(path)), None)

    def _content(self, path):
        """Return the SHA-256 of a file, or of all files in a folder; read again when time or size change."""
        if os.path.isdir(path):
            names = sorted(name for name in os.listdir(path) if os.path.isfile(os.path.join(path, name)))
            if len(names) > MOST_FILES:
                return f"a folder of {len(names)} files"
            return " ".join(f"{name} {self._content(os.path.join(path, name))}" for name in names)
        stat = os.stat(path)
        known = self._digests.get(path)
        if known is None or known[0] != (stat.st_mtime_ns, stat.st_size):
            known = self._digests[path] = (stat.st_mtime_ns, stat.st_size), sha256(path)
        return known[1]


def _is_kind(item, kind):
    """Return True if a value, as written into a scene, reads as a kind."""
    written = scenes.text("", item)
    if kind == "boolean":
        return written.lower() in ("true", "false")
    if kind == "float" and not written:
        return True                                    # Mitsuba accepts it
    try:
        (int if kind == "integer" else float)(written)
    except ValueError:
        return False
    return True
