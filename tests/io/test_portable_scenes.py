"""A scene is copied with all its files into a folder, from which it loads and renders anywhere, byte for byte."""
import os
from pathlib import Path

import pytest

from mitsonar.io.scene_files import scenes
from mitsonar.io.scene_files.portable import beside, bring, copy_scene

ROOT = Path(__file__).resolve().parents[2]
COARSE = {"sidescan_wreck": {"bed_spacing": 0.5, "ripple_wavelength": 2.4, "stone_scour": 0}}  # of 2.6 million faces
CAST = "depth,sound speed\n0,1500\n30,1490\n"
SCENE = """<scene version="3.0.0"><default name="cast" value="{cast}"/> <!-- of the water -->
    <integrator type="sonar_path"/>
    <sensor type="sidescan" id="sonar"><integer name="pings" value="2"/>
        <medium type="seawater"><string name="{attribute}" value="{value}"/></medium>
        <film type="sonar_film"><float name="range" value="30"/></film></sensor>
    <shape type="seabed" id="bed"><float name="depth" value="20"/></shape>
</scene>"""


@pytest.fixture
def files_of(variant):
    from mitsonar.plugins import reference

    return reference.input_files


@pytest.fixture
def survey(tmp_path, monkeypatch):
    """A folder of a scene and one beside it, and the function that writes the scene; the current folder is another."""
    for name in ("survey", "data", "elsewhere"):
        (tmp_path / name).mkdir()
    (tmp_path / "data/cast.csv").write_text(CAST)
    monkeypatch.chdir(tmp_path / "elsewhere")

    def write(cast, attribute="cast", value="$cast", text=SCENE):
        (tmp_path / "survey/scene.xml").write_text(text.format(cast=cast, attribute=attribute, value=value))
        return tmp_path / "survey/scene.xml"

    return write


def test_shipped_scenes_and_their_files_are_copied_as_they_are(files_of, tmp_path):
    for name in scenes.shipped():
        names = copy_scene(name, tmp_path / name, files_of)
        assert names[0] == f"{name}.xml"
        for file in names:
            assert (tmp_path / name / file).read_bytes() == (ROOT / "scenes" / file).read_bytes()
        assert len(names) == sum(len(files) for _, _, files in os.walk(tmp_path / name))


@pytest.mark.slow
def test_a_copy_renders_the_same_bytes_in_another_folder(files_of, tmp_path, monkeypatch):
    import mitsonar
    from mitsonar.io.records import exr

    names = "sidescan_drift", "sidescan_harbour"                       # a list of casts, and a texture
    (tmp_path / "copies").mkdir()
    for name in names:
        copy_scene(name, tmp_path / "copies" / name, files_of)
    (tmp_path / "copies").rename(tmp_path / "moved")
    for out, path in (("first", "{0}"), ("second", f"{tmp_path}/moved/{{0}}/{{0}}.xml")):
        (tmp_path / out).mkdir()
        monkeypatch.chdir(tmp_path / out)
        for name in names:
            exr.write(mitsonar.render(path.format(name), pings=2, rays=2000), f"{name}.exr")
    for name in names:
        assert (tmp_path / "first" / f"{name}.exr").read_bytes() == (tmp_path / "second" / f"{name}.exr").read_bytes()


@pytest.mark.slow
def test_every_copy_loads_from_another_working_folder(files_of, tmp_path, monkeypatch):
    import mitsonar

    monkeypatch.chdir("/")
    for name in scenes.shipped():
        copy_scene(name, tmp_path / name, files_of)
        mitsonar.load_file(str(tmp_path / name / f"{name}.xml"), **COARSE.get(name, {}))


@pytest.mark.parametrize("cast, value", [("../data/cast.csv", "$cast"), ("unused", "../data/cast.csv"),
                                         ("{absolute}", "$cast"), ("unused", "{absolute}")])
def test_names_that_climb_or_are_absolute_are_replaced(files_of, survey, tmp_path, cast, value):
    import mitsonar

    absolute = str(tmp_path / "data/cast.csv")
    scene = survey(cast.replace("{absolute}", absolute), value=value.replace("{absolute}", absolute))
    with pytest.raises(ValueError, match="cast.csv, which lies outside its folder .*--outside"):
        copy_scene(scene, "copy", files_of)
    assert os.listdir(".") == []
    assert copy_scene(scene, "copy", files_of, outside=True) == ("scene.xml", "files/cast.csv")
    text = Path("copy/scene.xml").read_text()
    assert 'value="files/cast.csv"' in text and "data" not in text and "<!-- of the water -->" in text
    (tmp_path / "data/cast.csv").unlink()
    mitsonar.load_file("copy/scene.xml")


def test_a_list_of_casts_brings_its_casts_and_names_them_anew(files_of, survey, tmp_path):
    (tmp_path / "survey/casts").mkdir()
    (tmp_path / "survey/casts/one.csv").write_text(CAST)
    (tmp_path / "survey/casts/list.csv").write_text("# two\nfile,x,y\none.csv,0,0\n../../data/cast.csv,0,99\n")
    names = copy_scene(survey("casts/list.csv", "casts"), "copy", files_of, outside=True)
    assert names == ("scene.xml", "casts/list.csv", "casts/one.csv", "files/cast.csv")
    assert Path("copy/casts/list.csv").read_text() == "# two\nfile,x,y\none.csv,0,0\n../files/cast.csv,0,99\n"
    assert Path("copy/scene.xml").read_bytes() == (tmp_path / "survey/scene.xml").read_bytes()


def test_included_scenes_folders_of_paths_and_side_files_come_too(files_of, survey, tmp_path):
    (tmp_path / "survey/parts").mkdir()
    (tmp_path / "survey/parts/water.xml").write_text(
        '<scene version="3.0.0"><medium type="seawater" id="sea"><string name="cast" value="cast.csv"/></medium>'
        '</scene>')
    (tmp_path / "survey/bed.asc").write_text("ncols 2\n")
    (tmp_path / "survey/bed.prj").write_text("PROJCS")
    names = copy_scene(survey("", text="""<scene version="3.0.0"><path value="../data"/>
        <include filename="parts/water.xml"/>
        <shape type="bathymetry"><string name="filename" value="bed.asc"/></shape></scene>"""), "copy", files_of,
                       outside=True)
    assert sorted(names) == ["bed.asc", "bed.prj", "cast.csv", "parts/water.xml", "scene.xml"]
    assert "<path" not in Path("copy/scene.xml").read_text()


def test_links_out_devices_pipes_and_missing_files_are_refused(files_of, survey, tmp_path):
    (tmp_path / "survey/link.csv").symlink_to("/etc/passwd")
    os.mkfifo(tmp_path / "survey/pipe.csv")
    for name, outside, error, words in (
            ("link.csv", False, ValueError, "outside its folder"),
            (f"{'../' * 20}etc/passwd", False, ValueError, "outside its folder"),
            ("/dev/zero", True, ValueError, "a device or a pipe"), ("pipe.csv", True, ValueError, "a device or a pipe"),
            ("/proc/self/maps", True, ValueError, "a file of the kernel"),
            ("no.csv", True, FileNotFoundError, "names 'no.csv', which is not there")):
        with pytest.raises(error, match=words):
            copy_scene(survey(name), "copy", files_of, outside=outside)
        assert os.listdir(".") == []
    (tmp_path / "survey/list.csv").write_text(f"file,x,y\n{'../' * 20}etc/passwd,0,0\n")
    with pytest.raises(ValueError, match="outside its folder"):
        copy_scene(survey("list.csv", "casts"), "copy", files_of)
    (tmp_path / "survey/link.csv").unlink()
    with pytest.raises(ValueError, match="write the whole name into the attribute"):
        copy_scene(survey("data", value="../$cast/cast.csv"), "copy", files_of, outside=True)


def test_a_folder_that_holds_files_or_is_a_link_is_refused(files_of, survey, tmp_path):
    Path("there").mkdir()
    Path("there/mine.txt").write_text("mine")
    Path("link").symlink_to(tmp_path / "data")
    for folder in ("there", "link", "there/mine.txt"):
        with pytest.raises(ValueError, match="holds files, or is no folder"):
            copy_scene("sidescan_flat", folder, files_of)
    with pytest.raises(FileNotFoundError, match="make it first"):
        copy_scene("sidescan_flat", "no/where", files_of)
    Path("empty").mkdir()
    assert copy_scene("sidescan_flat", "empty", files_of) == ("sidescan_flat.xml",)


def test_a_file_that_does_not_fit_on_the_disk_is_not_begun(files_of, survey, tmp_path):
    with open(tmp_path / "survey/huge.csv", "wb") as file:
        file.truncate(1 << 42)                         # a hole: no disk is used
    with pytest.raises(OSError, match="the disk has"):
        copy_scene(survey("huge.csv"), "copy", files_of)
    assert os.listdir(".") == []


def test_a_plan_copies_its_files_beside_its_scene(tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "out").mkdir()
    (tmp_path / "data/bed.asc").write_text("1")
    (tmp_path / "data/bed.prj").write_text("2")
    assert beside(tmp_path / "data/bed.asc", tmp_path / "out") == "bed.asc"
    assert sorted(os.listdir(tmp_path / "out")) == ["bed.asc", "bed.prj"]
    assert beside(tmp_path / "out/bed.asc", tmp_path / "out") == "bed.asc"
    assert beside(tmp_path / "data/bed.asc", tmp_path) == os.path.join("data", "bed.asc")
    (tmp_path / "data/bed.asc").write_text("3")
    with pytest.raises(ValueError, match="is another file"):
        beside(tmp_path / "data/bed.asc", tmp_path / "out")


def test_the_command_copies_a_scene_and_says_what_is_missing(variant, tmp_path, monkeypatch, capfd):
    from mitsonar.cli import main as cli

    monkeypatch.chdir(tmp_path)
    assert cli.main(["scenes", "sidescan_harbour", "-o", "copy"]) == 0
    out, err = capfd.readouterr()
    assert out == "copy/sidescan_harbour.xml\n" and err == "mitsonar: 2 files are in copy\n"
    for words, says in ((["scenes", "-o", "other"], "give the scene too"),
                        (["scenes", "sidescan_flat"], "folder by -o"),
                        (["scenes", "sidescan_flat", "-o", "copy"], "holds files")):
        assert cli.main(words) == 2
        assert says in capfd.readouterr().err
    assert os.listdir(".") == ["copy"]


def test_a_scene_that_moves_brings_its_files_and_spares_those_of_others(files_of, survey, tmp_path):
    scene = survey("../data/cast.csv")
    root = scenes.root(scene)
    assert bring(root, scene, tmp_path / "elsewhere", files_of) == ("files/cast.csv",)
    assert root.find("default").get("value") == "files/cast.csv"
    assert (tmp_path / "elsewhere/files/cast.csv").read_text() == CAST
    bring(scenes.root(scene), scene, tmp_path / "elsewhere", files_of)       # the same files once more
    (tmp_path / "elsewhere/files/cast.csv").write_text("mine")
    with pytest.raises(ValueError, match="is another file; give the scene another folder"):
        bring(scenes.root(scene), scene, tmp_path / "elsewhere", files_of)
    assert (tmp_path / "elsewhere/files/cast.csv").read_text() == "mine"
