"""Scenes through `mitsonar.load_file` and `mitsonar.render`, and the same files through Mitsuba's own functions.

Everything is exact: levels do not depend on who loads a scene, on Mitsuba's merging of shapes, or on the variant.
"""
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from exhaustive import thinned

import mitsonar

ROOT = Path(__file__).resolve().parents[2]
SCENES = ROOT / "scenes"
SMALL = {"pings": 2, "rays": 2000, "bins": 40}
COARSE = {"sidescan_wreck": {"bed_spacing": 0.5, "ripple_wavelength": 2.4, "stone_scour": 0}}  # of 2.6 million faces
TEXT = """<scene version="3.0.0">
    <default name="rays" value="2000"/>
    <default name="range" value="60"/>
    <default name="range_min" value="0"/>
    <default name="speckle" value="true"/>
    <default name="start" value="0, 0, -10"/>
    <default name="cast" value=""/>
    <default name="name" value="bed"/>
    <integrator type="sonar_path"><integer name="rays" value="$rays"/></integrator>
    <sensor type="sidescan">
        <integer name="pings" value="2"/>
        <boolean name="speckle" value="$speckle"/>
        <point name="start" value="$start"/>
        <medium type="seawater"><string name="cast" value="$cast"/></medium>
        <film type="sonar_film">
            <float name="range" value="$range"/>
            <float name="range_min" value="$range_min"/>
            <integer name="bins" value="40"/>
        </film>
    </sensor>
    <shape type="seabed" id="$name">
        <float name="depth" value="30"/> <float name="length" value="200"/> <float name="width" value="200"/>
        <float name="spacing" value="20"/>
    </shape>
</scene>
"""


@pytest.fixture
def scene_file(tmp_path, variant):
    path = tmp_path / "scene.xml"
    path.write_text(TEXT, encoding="utf-8")
    return path


# ---- parameters

@pytest.mark.parametrize("name, value, written", [
    ("speckle", False, "false"), ("speckle", np.True_, "true"), ("speckle", "TRUE", "TRUE"),
    ("rays", 2500, "2500"), ("rays", np.int64(2500), "2500"), ("rays", "2500", "2500"),
    ("range", 45.5, "45.5"), ("range", np.float32(0.1), "0.1"), ("range", np.float64(1e2), "100.0"),
    ("range_min", 1e-7, "1e-07"),
    ("start", (1, 2.5, -3), "1, 2.5, -3"), ("start", np.array([1.0, 2.5, -3.0]), "1.0, 2.5, -3.0"),
])
def test_values_of_any_plain_kind(scene_file, name, value, written):
    scene = mitsonar.load_file(scene_file, **{name: value})
    image = mitsonar.render(scene)
    assert image.attrs["parameters"] == {name: written}
    found = {"speckle": image.attrs["speckle"], "rays": scene.integrator().settings.rays,
             "range": scene.sensors()[0].film().range, "range_min": scene.sensors()[0].film().range_min,
             "start": scene.sensors()[0].route.start.tolist()}[name]
    wanted = {"TRUE": True, "2500": 2500}.get(value if isinstance(value, str) else None, value)
    assert found == pytest.approx(np.asarray(wanted).tolist() if name == "start" else wanted, rel=1e-6)


def test_paths_keep_their_case(scene_file):
    cast = scene_file.parent / "Cast OF Today.csv"
    cast.write_text("depth,speed\n0,1500\n")
    scene = mitsonar.load_file(scene_file, cast=cast)
    assert scene.sensors()[0].water.profile.sound_speed == [1500]
    assert scene.sensors()[0].provenance["parameters"] == {"cast": str(cast)}


@pytest.mark.parametrize("value", [None, {"a": 1}, print])
def test_values_of_other_kinds(scene_file, value):
    with pytest.raises(TypeError, match="the parameter rays is .*; give a number, a string, true or false, a path"):
        mitsonar.load_file(scene_file, rays=value)


def test_unknown_parameter_lists_the_known(scene_file):
    with pytest.raises(ValueError, match=r"no parameter ray \(did you mean .rays.\?\); .* Known: cast, name, range"):
        mitsonar.load_file(scene_file, ray=3)


@pytest.mark.parametrize("name", ["path", "parallel", "optimize"])
def test_names_that_mitsubas_loader_takes(scene_file, name):
    with pytest.raises(ValueError, match=f"a scene's parameter cannot be called {name}"):
        mitsonar.load_file(scene_file, **{name: 1})


# ---- the resolved text

def resolved(tmp_path, body, **parameters):
    """The body of a scene, resolved."""
    path = tmp_path / "text.xml"
    path.write_text(f'<scene version="3.0.0">{body}</scene>', encoding="utf-8")
    from mitsonar.scene.loading import resolved

    return resolved(path, parameters).removeprefix('<scene version="3.0.0">').removesuffix("</scene>")


@pytest.mark.parametrize("body, parameters, wanted", [
    ('<default name="a" value="1"/><x v="$a"/>', {}, '<x v="1" />'),
    ('<default name="a" value="1"/><x v="$a"/>', {"a": "2"}, '<x v="2" />'),
    ('<default name="a" value="1"/><default name="ab" value="2"/><x v="$a $ab $abc"/>', {}, '<x v="1 2 2c" />'),
    ('<default name="a" value="1"/><default name="b" value="$a$a"/><x v="$b"/>', {"a": "3"}, '<x v="33" />'),
    ('<default name="a" value="1"/><default name="a" value="2"/><x v="$a"/>', {}, '<x v="1" />'),
    ('<default name="a" value="1"/><x v="\\$a $a"/>', {}, '<x v="\\$a 1" />'),
    ('<default name="a" value="&lt;&amp;&quot;"/><x v="$a"/>', {}, '<x v="&lt;&amp;&quot;" />'),
    ('<y><default name="a" value="1"/><x v="$a"/></y>', {}, '<y><x v="1" /></y>'),
    ('<default name="a" value="1"/><include filename="$a.xml"/>', {"b": "2"},
     '<default name="b" value="2" /><default name="a" value="1" /><include filename="1.xml" />'),
], ids=["default", "given", "prefix", "default in default", "first default wins", "escaped", "special", "nested",
        "include"])
def test_resolved_text(tmp_path, body, parameters, wanted):
    assert resolved(tmp_path, body, **parameters) == wanted


@pytest.mark.parametrize("body, parameters", [
    ('<default name="a" value="1"/><default name="ab" value="2"/>%s"$a $ab $abc"/></integrator>', {}),
    ('<default name="a" value="1"/><default name="b" value="$a$a"/>%s"$b\\$b"/></integrator>', {"a": "3"}),
    ('<default name="a" value="1"/><default name="a" value="2"/>%s"$a&lt;"/></integrator>', {}),
], ids=["prefix", "default in default", "first default wins"])
def test_resolved_text_means_to_mitsuba_what_the_original_does(tmp_path, variant, body, parameters):
    import mitsuba as mi

    def read(text, **parameters):
        config = mi.parser.ParserConfig(variant)
        state = mi.parser.parse_string(config, f'<scene version="3.0.0">{text}</scene>', **parameters)
        return state.nodes[1].props["s"]

    body = body % '<integrator type="x"><string name="s" value='
    assert read(resolved(tmp_path, body, **parameters)) == read(body, **parameters)


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.xml")))
def test_resolved_scene_has_nothing_left_to_fill_in(name):
    from mitsonar.scene.loading import resolved

    parameter = re.search(r'<default name="(\w+)"', (SCENES / f"{name}.xml").read_text())[1]
    text = resolved(SCENES / f"{name}.xml", {parameter: "31.25"})
    assert "$" not in text and "<default" not in text and "31.25" in text


def test_resolved_scene_beside_the_original_renders_the_same(scene_file):
    # with the seabed in a file of its own, which uses a parameter of the whole
    head, tail = TEXT.split("    <shape")
    tail = tail.replace('name="depth" value="30"', 'name="depth" value="$depth"')
    (scene_file.parent / "bed.xml").write_text(
        f'<scene version="3.0.0"><default name="depth" value="30"/><shape{tail}', encoding="utf-8")
    scene_file.write_text(f'{head}<include filename="bed.xml"/></scene>', encoding="utf-8")
    first = mitsonar.render(mitsonar.load_file(scene_file, depth=25, range=50, name="sand"), seed=3)
    assert first.attrs["labels"] == {"1": "sand"} and first["altitude"].values == pytest.approx([15, 15])
    again = scene_file.with_name("again.xml")
    again.write_text(first.attrs["scene"], encoding="utf-8")
    second = mitsonar.render(again, seed=3)
    assert second.identical(first.assign_attrs(file="again.xml", parameters={}))


# ---- errors of the two verbs

def test_files_that_are_no_scenes(tmp_path, variant):
    with pytest.raises(FileNotFoundError, match="no.xml does not exist; give the path of a Mitsuba XML file"):
        mitsonar.render(tmp_path / "no.xml")
    with pytest.raises(ValueError, match="is a folder; give the path"):
        mitsonar.load_file(tmp_path)
    (tmp_path / "object.xml").write_text('<bsdf version="3.0.0" type="lambert"/>')
    with pytest.raises(ValueError, match="object.xml holds no scene but a single object"):
        mitsonar.load_file(tmp_path / "object.xml")


def test_render_refuses_what_it_cannot_render(scene_file):
    import mitsuba as mi

    scene = mitsonar.load_file(scene_file)
    for seed in (-1, 1 << 32):
        with pytest.raises(ValueError, match=f"seed is {seed}; give a whole number from 0 to 4294967295"):
            mitsonar.render(scene, seed)
    for bad in ({"seed": 1.5}, {"seed": "1"}, {"sensor": None}):
        with pytest.raises(TypeError):
            mitsonar.render(scene, **bad)
    with pytest.raises(ValueError, match="sensor 1 was asked for, but the scene has 1, counted from 0"):
        mitsonar.render(scene, sensor=1)
    with pytest.raises(TypeError, match="or the path of a file, got a dict"):
        mitsonar.render({"type": "scene"})
    with pytest.raises(ValueError, match="has no sensor"):
        mitsonar.render(mi.load_dict({"type": "scene"}))


def test_render_sets_parameters_of_a_scene_that_it_loads(scene_file):
    image = mitsonar.render(scene_file, 3, rays=500, range=45)
    assert image.identical(mitsonar.render(mitsonar.load_file(scene_file, rays=500, range=45), 3))
    assert mitsonar.render("sidescan_flat", **SMALL).sizes["ping"] == 2
    with pytest.raises(ValueError, match='no parameter ray .did you mean "rays"'):
        mitsonar.render(scene_file, ray=500)
    with pytest.raises(TypeError, match="rays: no argument has this name.* give them to mitsonar.load_file"):
        mitsonar.render(mitsonar.load_file(scene_file), rays=500)


def test_scene_of_another_variant(scene_file, variant):
    import mitsuba as mi

    scene = mitsonar.load_file(scene_file)
    mi.set_variant("llvm_ad_rgb" if variant != "llvm_ad_rgb" else "llvm_ad_mono")
    with pytest.raises(TypeError, match="got a Scene; load the scene after mi.set_variant"):
        mitsonar.render(scene)


def test_interrupt_within_a_plugin_stays_one(scene_file, monkeypatch):
    from mitsonar.io import casts

    def interrupted(path, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(casts, "read", interrupted)
    with pytest.raises(KeyboardInterrupt):
        mitsonar.load_file(scene_file, cast=scene_file)


def test_interrupt_during_the_render_stays_one(scene_file):
    def interrupted(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mitsonar.render(scene_file, progress=interrupted)


# ---- Mitsuba's own functions

def waterfall(image):
    """The picture Mitsuba is given of a dataset."""
    level = image["level"].values
    return np.concatenate([level[:, 0, ::-1], level[:, 1]], -1)[..., None]


def test_mitsubas_own_load_and_render_of_an_array(variant):
    import mitsuba as mi

    small = {"elements": "4", "range": "12", "cell": "0.1", "pings": "2"}
    image = mi.render(mi.load_file(str(SCENES / "forward_looking.xml"), optimize=False, **small), seed=3)
    wanted = mitsonar.render(mitsonar.load_file(SCENES / "forward_looking.xml", **small), seed=3)["level"].values
    assert wanted.shape[:2] == (2, 121)
    assert np.array_equal(image, wanted.reshape(-1, wanted.shape[-1], 1))


@pytest.mark.parametrize("name", thinned(sorted(path.stem for path in SCENES.glob("sidescan*.xml")),
                                         "sidescan_dual", "sidescan_flat", "sidescan_survey"))
def test_mitsubas_own_load_and_render(variant, name):
    import mitsuba as mi

    file, small = str(SCENES / f"{name}.xml"), {**SMALL, **COARSE.get(name, {})}
    scene = mi.load_file(file, optimize=False, **{key: str(value) for key, value in small.items()})
    image = mi.render(scene, seed=3)
    assert isinstance(image, mi.TensorXf) and image.shape == (2, 80, 1)
    wanted = mitsonar.render(mitsonar.load_file(file, **small), seed=3)
    assert np.array_equal(image, waterfall(wanted))
    assert np.array_equal(mi.render(scene, seed=3, spp=16), image), "spp is a camera's, rays say it for a sonar"
    assert not np.array_equal(mi.render(scene, seed=4), image)
    assert np.array_equal(mi.render(scene, seed=3, sensor=scene.sensors()[0], integrator=scene.integrator()), image)
    film = scene.sensors()[0].film()
    assert np.array_equal(film.develop(), image) and np.array_equal(np.array(film.bitmap())[..., None], image)
    assert np.array_equal(np.array(mi.Bitmap(image)), image[..., 0])
    assert mitsonar.render(scene, seed=3).attrs["scene"] is None       # its text was not known to us


def test_levels_do_not_depend_on_the_variant(variant):
    import mitsuba as mi

    images = {}
    for name in ("llvm_ad_mono", "llvm_ad_rgb", "llvm_ad_spectral", "llvm_ad_mono"):
        if name not in mi.variants():
            continue
        mi.set_variant(name)
        scene = mi.load_file(str(SCENES / "sidescan_survey.xml"), **{key: str(value) for key, value in SMALL.items()})
        images.setdefault(name, []).append(np.array(mi.render(scene, seed=1)))
    first, *others = [image for several in images.values() for image in several]
    assert len(images["llvm_ad_mono"]) == 2 and others
    assert all(np.array_equal(image, first) for image in others)


@pytest.fixture
def two_meshes(scene_file):
    """The scene with two meshes of one material on its bed."""
    ply = '<shape type="ply" id="{0}"><string name="filename" value="{1}"/><ref id="stone"/></shape>'
    shapes = ('<bsdf type="lambert" id="stone"/>'
              + ply.format("one", SCENES / "meshes/boulder.ply") + ply.format("two", SCENES / "meshes/tyre.ply"))
    scene_file.write_text(TEXT.replace("</scene>", f"{shapes}</scene>"), encoding="utf-8")
    return scene_file


def test_shapes_that_share_a_material_keep_their_labels(two_meshes):
    assert set(mitsonar.render(two_meshes).attrs["labels"].values()) == {"bed", "one", "two"}


@pytest.mark.parametrize("ask", [
    lambda mi, scene: mi.render(scene), lambda mi, scene: mitsonar.render(scene),
    lambda mi, scene: mitsonar.element_signals(scene)], ids=["mi.render", "render", "element_signals"])
def test_meshes_that_mitsuba_merged_are_refused(variant, two_meshes, ask):
    import mitsuba as mi

    from mitsonar.scene.errors import plain

    scene = mi.load_file(str(two_meshes))
    with pytest.raises((ValueError, RuntimeError)) as caught:       # Mitsuba's own verb wraps what a plugin raises
        ask(mi, scene)
    assert "merged meshes of one material in this scene, and their names with them; load it by mitsonar.load_file" in (
        plain(caught.value))


def test_a_surveys_origin_outlives_mitsubas_merging(variant):
    import mitsuba as mi

    scene = mi.load_file(str(SCENES / "sidescan_survey.xml"), **{key: str(value) for key, value in SMALL.items()})
    image = mitsonar.render(scene)
    assert image.attrs["crs"] == "EPSG:32631" and image.attrs["local_origin"] == [512200.0, 5790240.0]


def _finds_libatomic():
    """Tell whether a fresh process has the library that Dr.Jit needs on Linux without our help."""
    if not sys.platform.startswith("linux"):
        return True
    child = subprocess.run([sys.executable, "-c", "import ctypes; ctypes.CDLL('libatomic.so.1')"], check=False,
                           capture_output=True)
    return child.returncode == 0


@pytest.mark.parametrize("lines", [
    "import mitsonar; import mitsuba as mi; mi.set_variant('llvm_ad_mono')",
    "import mitsonar; import mitsuba as mi; mi.set_variant('llvm_ad_rgb')",
    "import mitsuba as mi; mi.set_variant('llvm_ad_mono'); import mitsonar",
], ids=["mono", "rgb", "Mitsuba first"])
def test_three_lines_are_enough(lines):
    if lines.startswith("import mitsuba") and not _finds_libatomic():
        pytest.skip("libatomic is here only through mitsonar: Dr.Jit cannot be imported before it")
    text = f"{lines}; print(mi.render(mi.load_file('scenes/sidescan_flat.xml', pings=2, rays=2000)).shape)"
    child = subprocess.run([sys.executable, "-c", text], cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)},
                           check=False, capture_output=True, text=True, timeout=120)
    assert (child.stdout, child.stderr, child.returncode) == ("(2, 1600, 1)\n", "", 0)


def test_a_scene_of_a_thousand_targets_loads(variant, tmp_path):
    """Made in parallel, one within the other, they ended in a RecursionError now and then."""
    targets = "".join(f'<shape type="point_target"><point name="position" x="{i % 40}" y="{i // 40}" z="-5"/></shape>'
                      for i in range(1000))
    path = tmp_path / "many.xml"
    path.write_text(f'<scene version="3.0.0">{targets}</scene>', encoding="utf-8")
    assert len(mitsonar.load_file(path).shapes()) == 1000
