"""Every attribute is declared once: nothing beside the declarations names, reads or describes it a second time."""
import ast
import re
from pathlib import Path

import pytest

from mitsonar.plugins import BASES, MODULES, PLUGINS

FOLDER = Path(__file__).resolve().parents[2] / "plugins"
NAMES = [name.rpartition(".")[2] for name in PLUGINS]
SOURCES = sorted(path for path in FOLDER.rglob("*.py") if path.parent.name != "attributes")
SONAR = {"medium": {"type": "seawater"}, "film": {"type": "sonar_film"}}
BED = {"type": "seabed", "depth": 10.0, "spacing": 50.0}
# what a plugin needs to be read to its end, but for a file
NEEDED = {"sidescan": SONAR, "array_sonar": SONAR, "forward_looking": SONAR, "sector_scan": SONAR, "seabed": BED,
          "point_target": {"position": [0.0, 0.0, -5.0]},
          "capped_cylinder": {"radius": 1.0, "p0": [0.0, 0.0, -5.0], "p1": [0.0, 1.0, -5.0]},
          "impedance": {"density": 1100.0, "sound_speed": 1600.0}, "moving": {"shape": {"type": "sphere"}},
          "targets": {"meshes": str(FOLDER.parent / "scenes" / "targets"), "count": 1, "bed": BED}}


@pytest.fixture
def reference(variant):
    from mitsonar.plugins import reference

    return reference


@pytest.mark.parametrize("plugin", NAMES)
def test_a_name_is_declared_once_and_says_what_it_means(reference, plugin):
    from mitsonar.plugins.attributes import Attributes

    declared = reference.attributes(plugin)
    names = [one.name for one in declared]
    assert len(names) == len(set(names))
    assert not set(names) & set(dir(Attributes)), "the reader has methods of these names"
    for one in declared:
        assert one.expected and len(one.text) > 3 and not one.text.endswith("."), one.name


@pytest.mark.parametrize("plugin", NAMES)
def test_a_default_is_what_its_attribute_expects(reference, plugin):
    """Written as a string or a number, a default is read as it is taken where nothing is written."""
    import numpy as np

    from mitsonar.plugins.attributes import REQUIRED, FromTable, Nested, SameAs

    for one in reference.attributes(plugin):
        if one.default is None or one.default is REQUIRED or isinstance(one, Nested):
            continue
        if isinstance(one.default, SameAs):
            assert type(one) is type(next(other for other in reference.attributes(plugin)
                                          if other.name == one.default.name))
            continue
        defaults = [values[one.name] for values in one.default.table.values()] if isinstance(
            one.default, FromTable) else [one.default]
        for default in defaults:
            written = ", ".join(map(str, default)) if isinstance(default, (tuple, list)) else default
            read = one.read(written, "String" if isinstance(written, str) else "Float")
            assert np.array_equal(read if read is not None else "", one.taken(default)), one.name


@pytest.mark.parametrize("plugin", NAMES)
def test_an_error_knows_what_is_declared(reference, make, tmp_path, plugin):
    """All of it, but for what does not count with what else is written."""
    from mitsonar.plugins.attributes import REQUIRED, File, Nested
    from mitsonar.scene.errors import plain

    (tmp_path / "a.csv").write_text("angle [deg],strength [dB]\n10,-40\n60,-20\n", encoding="utf-8")
    needed = {name: value for name, value in NEEDED.get(plugin, {}).items() if name != "type"}
    for one in reference.attributes(plugin):
        if type(one) is File and one.default is REQUIRED and one.only is None:
            needed[one.name] = str(tmp_path / "a.csv")
    with pytest.raises(RuntimeError) as caught:
        make(plugin, surely_unknown=1, **needed)
    listed = set(re.search(r"Known: (.+)\.$", plain(caught.value))[1].split(", ")) - {"none"}
    usual = {one.name: needed.get(one.name, one.default) for one in reference.attributes(plugin)}
    assert listed == {one.name for one in reference.attributes(plugin)
                      if not isinstance(one, Nested) and (one.only is None or usual[one.only[0]] in one.only[1])}


def test_every_module_declares_what_it_registers(reference):
    for name in MODULES:
        assert hasattr(reference._module(name), "ATTRIBUTES") == (name not in BASES), name


def documented(path):
    """All docstrings of a source file, joined."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return "\n".join(ast.get_docstring(node) or "" for node in ast.walk(tree)
                     if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef)))


@pytest.mark.parametrize("path", [pytest.param(path, id=path.stem) for path in SOURCES])
def test_texts_list_no_attributes_with_units_and_defaults(path):
    """Such as "- ``range`` [m, 100]: ..." once did, or a table of them."""
    assert not re.search(r"^- ``\w+``[^:\n]*\[", documented(path), re.M)
    assert not re.search(r"^=+ =+", documented(path), re.M)


@pytest.mark.parametrize("path", [pytest.param(path, id=path.stem) for path in SOURCES])
def test_only_the_reader_reads_properties(path):
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Load):
            assert getattr(node.value, "id", "") != "props", f"line {node.lineno}"
        if isinstance(node, ast.Attribute) and node.attr in ("get", "type", "keys", "get_texture"):
            assert getattr(node.value, "id", "") != "props", f"line {node.lineno}"


def test_files_that_our_plugins_and_those_of_mitsuba_read(reference):
    from mitsonar.plugins.attributes import File

    found = {plugin: set(reference.input_files(plugin)) for plugin in NAMES}
    patterns = {"pattern", "vertical_pattern", "receive_pattern", "receive_vertical_pattern"}
    assert found["sidescan"] == {"track"} | patterns
    assert found["array_sonar"] == {"track", "transmit_file", "receive_file"}
    assert found["bathymetry"] == {"filename", "sediment_map", "sediment_classes"}
    assert found["seawater"] == {"cast", "casts", "field_file", "separation_file", "tide"}
    assert found["targets"] == {"meshes"} and found["lambert"] == set()
    for kind in ("bitmap", "ply", "obj", "gridvolume", ""):
        assert set(reference.input_files(kind)) == {"filename"}
    assert all(isinstance(one, File) for plugin in NAMES for one in reference.input_files(plugin).values())


@pytest.mark.parametrize("kind, value, names", [
    ("File", "a.csv", ("a.csv",)), ("File", "", ()), ("TextOrFile", "1: sand", ()), ("TextOrFile", "c.csv", ("c.csv",)),
    ("Files", "mine.ply, rock.obj", ("mine.ply", "rock.obj")), ("Files", "targets", ("targets",))])
def test_names_of_files_in_a_value(variant, kind, value, names):
    from mitsonar.plugins import attributes

    assert getattr(attributes, kind)("a", text="").names_of_files(value) == names


def test_presets_are_those_of_the_sonar(reference):
    from mitsonar.plugins.attributes import FromTable
    from mitsonar.sonar.preset_tables import TABLES, presets

    for kind in TABLES:
        taken = {one.name for one in reference.attributes(kind)
                 if isinstance(one.default, FromTable) and one.default.by == "preset"}
        assert all(set(values) == taken for values in presets(kind).values())


def test_named_motions_are_those_of_every_sensor(reference):
    from mitsonar.plugins.attributes import FromTable
    from mitsonar.sonar.preset_tables import motions

    for plugin in ("sidescan", "array_sonar", "forward_looking", "sector_scan"):
        taken = {one.name for one in reference.attributes(plugin)
                 if isinstance(one.default, FromTable) and one.default.by == "motion"}
        assert all(set(values) == taken for values in motions().values())


def test_the_page_is_what_the_declarations_make():
    from mitsonar.plugins import page

    assert (FOLDER / "README.md").read_text(encoding="utf-8") == page.markdown(), (
        "plugins/README.md is not what the plugins declare; run python3 -m mitsonar describe --markdown > "
        "plugins/README.md")


def test_the_page_has_a_row_for_every_attribute(reference):
    rows = re.findall(r"^\| (`.+?) \| (?:.+) \| (?:.+) \| (?:.+) \|$", (FOLDER / "README.md").read_text(), re.M)
    named = [name for row in rows for name in re.findall(r"`(\w+)`", row)]
    for plugin in NAMES:
        assert {one.name for one in reference.attributes(plugin)} <= set(named)
