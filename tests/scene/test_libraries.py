"""Libraries of program code that Mitsuba would open for a scene: none but its own, wherever a stranger's may lie."""
import os
import shutil
import sys

import pytest

import mitsonar

SCENE = """<scene version="3.0.0">
    <default name="kind" value="sphere"/>
    <sensor type="sidescan">
        <integer name="pings" value="1"/>
        <medium type="seawater"><float name="sound_speed" value="1500"/></medium>
        <film type="sonar_film"><float name="range" value="60"/><integer name="bins" value="20"/></film>
    </sensor>
    BODY
</scene>
"""
SHAPE = '<shape type="{}"/>'


@pytest.fixture
def place(tmp_path, variant):
    """Put a library at a path below the scene's folder; a real one, which would be found in memory once opened."""
    import mitsuba as mi

    from mitsonar.scene.libraries import SUFFIX

    def place(name):
        path = tmp_path / f"{name}{SUFFIX}"
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(os.path.join(os.path.dirname(mi.__file__), "plugins", f"diffuse{SUFFIX}"), path)
    return place


@pytest.fixture
def refusal(tmp_path, variant):
    """Return the sentence by which a scene is refused, after which no library of its folder is in memory."""
    def refusal(body, **parameters):
        path = tmp_path / "scene.xml"
        path.write_text(SCENE.replace("BODY", body))
        with pytest.raises(ValueError) as error:
            mitsonar.load_file(path, **parameters)
        if sys.platform == "linux":
            with open("/proc/self/maps", encoding="utf-8") as maps:
                assert str(tmp_path) not in maps.read()
        return str(error.value)
    return refusal


@pytest.mark.parametrize("body, parameters", [
    (SHAPE.format("stranger"), {}), (SHAPE.format("$kind"), {"kind": "stranger"}),
    (SHAPE.format("$kind"), {"kind": "stranger", "filename": "folder"}),
    (SHAPE.format("../elsewhere/stranger"), {}), (SHAPE.format("Sphere"), {}), (SHAPE.format("sphere.so"), {}),
    ('<bsdf type="twosided"><bsdf type="stranger"/></bsdf>', {}), ('<bsdf type="stranger" id="never used"/>', {}),
    ('<include filename="part.xml"/>', {}),
], ids=["plain", "parameter", "parser's name", "other folder", "case", "suffix", "nested", "unused", "included"])
def test_plugins_of_others_are_refused(place, refusal, tmp_path, body, parameters):
    for name in ("plugins/stranger", "elsewhere/stranger", "plugins/Sphere"):
        place(name)
    (tmp_path / "part.xml").write_text(f'<scene version="3.0.0">{SHAPE.format("stranger")}</scene>')
    (tmp_path / "folder").mkdir()
    used = '<default name="filename" value="folder"/><path value="$filename"/>'
    said = refusal(used + body, **parameters)
    assert "there is no plugin of type" in said
    assert "may use the plugins of mitsonar and those of the Mitsuba package" in said
    assert "scene.xml, line 8" in said or "filename" in parameters or "part.xml, line 1" in said


@pytest.mark.parametrize("name", ["cylinder", "retarder", "hdrfilm", "windy_sea", "sidescan"])
def test_libraries_in_place_of_known_plugins_are_refused(place, refusal, name):
    place(f"plugins/{name}")           # of Mitsuba, made by others without being named, or looked for by dictionaries
    assert f'plugins/{name}.so would run as program code wherever a scene needs the plugin "{name}"' in refusal(
        SHAPE.format("sphere")).replace(".dylib", ".so").replace(".dll", ".so")


@pytest.mark.parametrize("parameters", [{}, {"filename": "sub"}], ids=["plain", "parser's name"])
def test_libraries_in_the_folders_of_a_path_are_refused(place, refusal, parameters):
    place("sub/plugins/sphere")
    folder = '<path value="{}"/>'.format("$filename" if parameters else "sub")
    assert "would run as program code" in refusal(folder + SHAPE.format("sphere"), **parameters)


def test_links_to_libraries_are_refused(place, refusal, tmp_path):
    place("elsewhere/sphere")
    (tmp_path / "plugins").symlink_to(tmp_path / "elsewhere")
    assert "would run as program code" in refusal(SHAPE.format("sphere"))


def test_libraries_in_the_current_folder_are_refused_before_anything_is_made(place, refusal, tmp_path, monkeypatch):
    import mitsuba as mi

    former = mi.file_resolver()
    here = mi.FileResolver(former)
    here.prepend(str(tmp_path))                        # the folder in which Python was started
    place("plugins/sphere")
    mi.set_file_resolver(here)
    try:
        with pytest.raises(ValueError, match="would run as program code"):
            mitsonar.render("sidescan_flat", seed=1)
    finally:
        mi.set_file_resolver(former)


def test_a_folder_that_cannot_be_listed_is_searched_by_name(place, refusal, tmp_path, monkeypatch):
    place("plugins/sphere")
    listed = os.listdir

    def closed(folder):
        if str(tmp_path) in str(folder):
            raise PermissionError(folder)
        return listed(folder)

    monkeypatch.setattr(os, "listdir", closed)
    assert "plugins/sphere.so would run as program code" in refusal(SHAPE.format("sphere")).replace(".dylib", ".so")


def test_a_link_to_mitsubas_own_library_is_no_strangers(tmp_path, variant):
    import mitsuba as mi

    (tmp_path / "plugins").symlink_to(os.path.join(os.path.dirname(mi.__file__), "plugins"))
    (tmp_path / "scene.xml").write_text(SCENE.replace("BODY", SHAPE.format("sphere")))
    assert len(mitsonar.load_file(tmp_path / "scene.xml").shapes()) == 1


def test_every_plugin_of_mitsuba_and_of_mitsonar_is_known():
    from mitsonar.plugins import PLUGINS
    from mitsonar.scene.libraries import check_type

    for name in ("scene", "sphere", "merge", "srgb", "hdrfilm", *(name.rpartition(".")[2] for name in PLUGINS)):
        check_type(name)
