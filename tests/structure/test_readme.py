"""README.md says what the plugins say: its scene renders, and its tables name every attribute and preset, no others.

That its Python and its commands run is the business of `test_documentation`.
"""
import re
from pathlib import Path

import pytest

import mitsonar
from mitsonar.sonar import presets

README = Path(__file__).resolve().parents[2] / "README.md"
SCENES = README.parent / "scenes"
NEEDED = {
    "sidescan": {"medium": {"type": "seawater"}, "film": {"type": "sonar_film"}},
    "seabed": {"depth": 10.0},
    "array_sonar": {"medium": {"type": "seawater"}, "film": {"type": "sonar_film"}},
    "point_target": {"position": [0.0, 0.0, -5.0]},
    "capped_cylinder": {"radius": 1.0, "p0": [0.0, 0.0, -5.0], "p1": [0.0, 1.0, -5.0]},
    "impedance": {"density": 1100.0, "sound_speed": 1600.0},
    "empirical": {"filename": str(SCENES / "casts" / "summer.csv")},
    "bathymetry": {"filename": str(SCENES / "bathymetry" / "sandwaves.tif")},
    "targets": {"meshes": "targets", "count": 1},
}
NAMED_BY_MITSUBA = {"to_world"}        # every shape has it, whether it reads it by itself or not


def tables():
    """The tables of attributes: (plugins of the heading, names in the first column)."""
    for section in re.split(r"\n(?=\*\*`<)", README.read_text(encoding="utf-8"))[1:]:
        heading, table = section.partition("\n")[0], section.partition("| attribute |")[2].partition("\n\n")[0]
        cells = re.findall(r"^\| (`.+?) \|", table, re.M)
        yield re.findall(r'type="(\w+)"', heading), {name for cell in cells for name in re.findall(r"`(\w+)`", cell)}


def known(plugin):
    """The attributes a plugin knows, as its error about an unknown one lists them."""
    import mitsuba as mi

    from mitsonar.plugins.errors import plain

    with pytest.raises(RuntimeError) as caught:
        mi.load_dict({"type": plugin, "surely_unknown": 1, **NEEDED.get(plugin, {})})
    return set(plain(caught.value).partition("Known: ")[2].rstrip(".").split(", "))


@pytest.mark.parametrize("plugins, names", [pytest.param(*table, id=" ".join(table[0])) for table in tables()])
def test_tables_name_every_attribute_and_no_other(variant, plugins, names):
    assert names | NAMED_BY_MITSUBA == set().union(*map(known, plugins)) | NAMED_BY_MITSUBA


def test_presets_are_those_of_the_table():
    rows = re.findall(r"^\| `(\w+)` \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+), ([\d.]+) \| ([\d.]+) \|$",
                      README.read_text(encoding="utf-8"), re.M)
    columns = ("frequency_khz", "source_level_db", "pulse_ms", "beam_width_deg", "vertical_beam_width_deg",
               "depression_deg")
    assert {name: dict(zip(columns, map(float, numbers))) for name, *numbers in rows} == presets()


def test_its_scene_renders(tmp_path):
    text = re.search(r"^```xml\n(.*?)^```$", README.read_text(encoding="utf-8"), re.M | re.S)[1]
    (tmp_path / "pipe.xml").write_text(text, encoding="utf-8")
    image = mitsonar.render(mitsonar.load_file(tmp_path / "pipe.xml", pings=2))
    assert set(image.attrs["labels"].values()) == {"seabed", "pipe"}
