"""Copy a scene with all files that it reads into a folder of its own, which loads on any machine.

A file keeps its name, relative to the scene, if that leads to nothing outside the scene's folder; otherwise it goes
into ``files/``, and the name is changed where it is written: in the attribute, in the ``<default>`` of the parameter,
or in the list of casts. Included scenes, folders of files, lists of casts and the side files of rasters are copied too.
Elements ``<path>`` are left out: their files lie beside the scene then.

A scene may name any file that its user can read. So files that lie outside the scene's folder, by their names or by
links, are copied only if that is asked for; pipes, devices and files of the kernel never are.
"""
from __future__ import annotations

import contextlib
import filecmp
import os
import secrets
import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Protocol
from xml.etree import ElementTree

from mitsonar.device.files import FilePath, check_readable, replacing
from mitsonar.io.casts.series import is_list

from . import scenes, tables

MOST_FILES = 10_000                # of a folder
BESIDE = (".aux.xml", ".prj", ".tfw", ".tifw", ".wld", ".hdr")     # side files of a raster
MOVED = "files"                    # folder of the files that may not keep their names


class NamesFiles(Protocol):
    """Attribute of a plugin that names files."""

    def names_of_files(self, value: str) -> tuple[str, ...]:
        """Return the names of files in a written value."""
        ...


FilesOf = Callable[[str], Mapping[str, NamesFiles]]    # attributes that name files, by a plugin's type


def copy_scene(scene: FilePath, folder: FilePath, files_of: FilesOf, *, outside: bool = False) -> tuple[str, ...]:
    """Copy a scene and its files into a new or empty folder; return their names there, the scene's first.

    Parameters
    ----------
    scene : str or path
        Scene, or the name of one that comes with mitsonar.
    folder : str or path
        Folder to make, completely or not at all.
    files_of : callable
        Returns the attributes that name files, for the type of a plugin.
    outside : bool
        Copy files that lie outside the scene's folder, too.

    Raises
    ------
    FileNotFoundError, PermissionError, ValueError
        If a file is missing, may not be read or copied, or the folder holds files.
    """
    path, target = scenes.find(os.fspath(scene)), Path(os.path.abspath(folder))
    scenes.check(path, {})
    if os.path.lexists(target) and (target.is_symlink() or not target.is_dir() or any(target.iterdir())):
        raise ValueError(f"cannot copy the scene into {folder}: it holds files, or is no folder; give a new or "
                         "empty one.")
    if not target.parent.is_dir():
        raise FileNotFoundError(f"cannot copy the scene into {folder}: the folder {target.parent} does not exist; make "
                                "it first.")
    half = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    half.mkdir()
    try:
        names = _Copy(half, os.path.dirname(os.path.abspath(path)), files_of, outside).scene(path)
        half.replace(target)
    finally:
        shutil.rmtree(half, ignore_errors=True)
    return names


def beside(file: FilePath, folder: FilePath) -> str:
    """Return the name of a file for a scene in a folder: a copy beside the scene, unless it lies in the folder."""
    path, home = os.path.abspath(file), os.path.abspath(folder)
    if Path(os.path.realpath(path)).is_relative_to(os.path.realpath(home)):
        return os.path.relpath(path, home)
    name = os.path.basename(path)
    for source, extra in ((path, name), *((found, os.path.basename(found)) for found in _side_files(path))):
        target = os.path.join(home, extra)
        if os.path.exists(target) and not filecmp.cmp(source, target, shallow=False):
            raise ValueError(f"cannot copy {source} beside the scene: {target} is another file; give the scene another "
                             "folder.")
        with replacing(target) as temporary:
            shutil.copyfile(source, temporary)
    return name


def bring(root: ElementTree.Element, path: FilePath, folder: FilePath, files_of: FilesOf) -> tuple[str, ...]:
    """Copy the files that a scene names into the folder to which it moves, and change their names in it.

    ``root`` is the scene read from ``path``; files outside its folder are copied, too. Returns the names of the copies.
    """
    copy = _Copy(Path(folder), os.path.dirname(os.path.abspath(path)), files_of, True)
    copy.walk(_Tree("", root), os.fspath(path))
    return tuple(copy.placed.values())


class _Copy:
    """One copy of a scene."""

    def __init__(self, folder: Path, home: str, files_of: FilesOf, outside: bool):
        self.folder, self.home, self.files_of, self.outside = folder, os.path.realpath(home), files_of, outside
        self.placed: dict[str, str] = {}               # names in the folder by real path
        self.trees: list[_Tree] = []
        self.defaults: dict[str, tuple[_Tree, ElementTree.Element]] = {}
        self.values: dict[str, str] = {}
        self.folders = [home]

    def scene(self, path: str) -> tuple[str, ...]:
        self._xml(path, os.path.basename(path))
        for tree in self.trees:
            if tree.changed:
                ElementTree.ElementTree(tree.root).write(self.folder / tree.name, encoding="utf-8")
        return tuple(self.placed.values())

    def _xml(self, path: str, written: str) -> str:
        """Copy a scene file and what it names; return its name."""
        real = os.path.realpath(path)
        if real in self.placed:
            return self.placed[real]
        name = self._copied(path, written)
        parser = ElementTree.XMLParser(target=ElementTree.TreeBuilder(insert_comments=True))
        self.walk(_Tree(name, ElementTree.parse(path, parser).getroot()), path)
        return name

    def walk(self, tree: _Tree, path: str) -> None:
        """Copy what a scene file names."""
        self.trees.append(tree)
        above = {child: parent for parent in tree.root.iter() for child in parent}
        for element in list(tree.root.iter()):
            if element.tag == "default":
                key = element.get("name", "")
                self.defaults.setdefault(key, (tree, element))
                self.values.setdefault(key, scenes.filled(element.get("value", ""), self.values))
            elif element.tag == "path":
                value = scenes.filled(element.get("value", ""), self.values)
                self.folders.insert(0, self._found(value, [os.path.dirname(path)]) or value)
                above[element].remove(element)
                tree.changed = True
            elif isinstance(element.tag, str):
                self._element(tree, path, element, above.get(element))

    def _element(self, tree: _Tree, path: str, element: ElementTree.Element,
                 parent: ElementTree.Element | None) -> None:
        """Copy the files that an element names, and change their names there if they had to be."""
        include, key = element.tag == "include", "filename"
        if "filename" in element.attrib:
            names = (scenes.filled(element.attrib[key], self.values),)
        elif element.tag == "string" and parent is not None:
            kind = self.files_of(scenes.filled(parent.get("type", ""), self.values))
            attribute, key = kind.get(element.get("name", "")), "value"
            names = () if attribute is None else attribute.names_of_files(
                scenes.filled(element.get(key, ""), self.values))
        else:
            return
        new = []
        for name in names:
            found = self._found(name, [os.path.dirname(path)] if include else [])
            if found is None:
                raise FileNotFoundError(f"{path}: <{element.tag}> names {name!r}, which is not there; it is looked for "
                                        "beside the scene, then where you are.")
            new.append(self._xml(found, name) if include else self._file(found, name))
        if tuple(new) == names:
            return
        template, text = element.get(key, ""), ", ".join(new)
        if "$" not in template.replace(r"\$", ""):
            element.set(key, text)
            tree.changed = True
        elif template[1:] in self.defaults:
            owner, default = self.defaults[template[1:]]
            default.set("value", text)
            owner.changed = True
        else:
            raise ValueError(f"{path}: \"{template}\" names {', '.join(names)}, which must be renamed in the copy; "
                             "write the whole name into the attribute, or into the <default> of one parameter.")

    def _found(self, name: str, first: Sequence[str]) -> str | None:
        if "\0" in name:
            return None
        return next((path for folder in (*first, *self.folders, "")
                     if os.path.exists(path := os.path.join(folder, name))), None)

    def _file(self, path: str, name: str) -> str:
        """Copy a file with those that belong to it, or a folder of files; return its name."""
        if os.path.isdir(path):
            inside = sorted(one for one in os.listdir(path) if os.path.isfile(os.path.join(path, one)))
            if len(inside) > MOST_FILES:
                raise ValueError(f"the folder {path} has {len(inside)} files; give one of at most {MOST_FILES}.")
            home = _kept(name)
            for one in inside:
                self._copied(os.path.join(path, one), f"{home.rstrip('/')}/{one}")
            return home
        known = self.placed.get(os.path.realpath(path))
        if known is not None:
            return known
        new = self._copied(path, name)
        for side in _side_files(path):
            self._copied(side, os.path.join(os.path.dirname(new), os.path.basename(side)))
        if path.lower().endswith((".csv", ".txt")) and is_list(Path(path)):
            self._listed(path, new)
        return new

    def _listed(self, path: str, new: str) -> None:
        """Copy the files of a list, and write their names into the copy of the list where they have others."""
        names, lines, rows = tables.records(path, "list of files")
        column, here = names.index("file"), os.path.dirname(new)
        text = Path(path).read_text(encoding="utf-8-sig").splitlines()
        changed = False
        for line, row in zip(lines, rows, strict=True):
            name = row[column].strip()
            source = os.path.join(os.path.dirname(path), name)
            check_readable(source, f"what {path} names,")
            copied = os.path.relpath(self._copied(source, os.path.join(here, name)), here or ".")
            if copied != name:
                text[line - 1], changed = text[line - 1].replace(name, copied, 1), True
        if changed:
            (self.folder / new).write_text("\n".join(text) + "\n", encoding="utf-8")

    def _copied(self, path: str, written: str) -> str:
        """Copy one file and return its name, the one that is written if that stays in the folder."""
        real = os.path.realpath(path)
        if real in self.placed:
            return self.placed[real]
        check_readable(path, "what the scene names,")
        if not (self.outside or Path(real).is_relative_to(self.home)):
            raise ValueError(f"the scene names {path}, which lies outside its folder {self.home}; if you trust the "
                             "scene, copy such files too, by --outside.")
        stem, suffix = os.path.splitext(_kept(written))
        name = next(name for name in _numbered(stem, suffix) if name not in self.placed.values())
        size, free = os.path.getsize(path), shutil.disk_usage(self.folder).free
        if size > free:
            raise OSError(f"cannot copy {path}: it has {size / 1e9:.3g} GB, and the disk has {free / 1e9:.3g} GB left; "
                          "free some space or choose another disk.")
        target = self.folder / name
        if target.exists() and not filecmp.cmp(path, target, shallow=False):
            raise ValueError(f"cannot copy {path} beside the scene: {target} is another file; give the scene another "
                             "folder.")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, target)
        self.placed[real] = name
        return name


class _Tree:
    """Scene file of a copy."""

    def __init__(self, name: str, root: ElementTree.Element):
        self.name, self.root, self.changed = name, root, False


def _kept(name: str) -> str:
    """Return a written name that stays within the folder, or a name in the folder of moved files."""
    plain = os.path.normpath(name)
    if os.path.isabs(plain) or plain.split(os.sep)[0] in ("..", ".") or "\\" in plain or ":" in plain:
        return f"{MOVED}/{os.path.basename(plain.replace(chr(92), '/'))}"
    return name if os.path.normpath(name) == name.rstrip("/") else plain


def _numbered(stem: str, suffix: str) -> Iterator[str]:
    yield f"{stem}{suffix}"
    for number in range(2, MOST_FILES + 2):
        yield f"{stem}_{number}{suffix}"


def _side_files(path: str) -> list[str]:
    """Return the files beside a raster that its readers read with it."""
    stem = os.path.splitext(path)[0]
    sides = [f"{path}.aux.xml", *(stem + suffix for suffix in BESIDE)]
    with contextlib.suppress(ValueError):
        sides.remove(path)
    return [side for side in sides if os.path.isfile(side)]
