"""What `render` and `plot` do when all is well: files, names on standard output, the bytes, the progress bar."""
import io
import re
import sys
import types

import numpy as np
import pytest

import mitsonar
from mitsonar.cli import main as cli, progress


@pytest.fixture
def accepted(folder, capfd):
    """Run a command that must work without a word on standard error, and give the lines it prints."""
    def run(*arguments):
        capfd.readouterr()
        assert cli.main([str(argument) for argument in arguments]) == 0
        out, err = capfd.readouterr()
        assert err == ""
        return out.splitlines()
    return run


def test_files_and_their_names(folder, accepted):
    assert accepted("render", "scene.xml", "-o", "o.exr", "--preview", "p.png") == ["o.exr", "p.png"]
    assert sorted(path.name for path in folder.iterdir()) == ["o.exr", "p.png", "scene.xml"]
    assert (folder / "p.png").read_bytes().startswith(b"\x89PNG")
    assert accepted("plot", "o.exr", "--what", "mean") == ["o_mean.png"]


def test_a_preview_may_show_counts(folder, accepted, capfd):
    for tvg in ("recorder", "counts"):
        accepted("render", "scene.xml", "-o", "o.exr", "--preview", f"{tvg}.png", "--tvg", tvg)
    assert (folder / "recorder.png").read_bytes() != (folder / "counts.png").read_bytes()
    text = (folder / "scene.xml").read_text()
    (folder / "scene.xml").write_text(text.replace("</sensor>", '<string name="recorder" value="none"/></sensor>'))
    assert cli.main(["render", "scene.xml", "-o", "n.exr", "--preview", "n.png", "--tvg", "counts"]) == 2
    assert "the sonar has no recorder" in capfd.readouterr().err and not [*folder.glob("n.*")]


def test_a_point_target_needs_no_id(folder, accepted):
    text = (folder / "scene.xml").read_text()
    target = '<shape type="point_target"><point name="position" x="20" y="0" z="-20"/></shape></scene>'
    (folder / "scene.xml").write_text(text.replace("</scene>", target))
    assert accepted("render", "scene.xml", "-o", "o.exr") == ["o.exr"]


def test_parameters_and_seed_reach_the_file(folder, accepted):
    from mitsonar.io.records import exr

    accepted("render", "scene.xml", "-o", "o.exr", "-D", "pings=3", "-D", "speckle=FALSE", "--seed", "7")
    dataset = exr.read("o.exr")
    assert dataset["level"].sizes == {"ping": 3, "side": 2, "range": 50}
    assert dataset.attrs["seed"] == 7 and dataset.attrs["speckle"] is False
    assert dataset.attrs["parameters"] == {"pings": "3", "speckle": "FALSE"} and dataset.attrs["file"] == "scene.xml"


def test_what_is_cut_or_never_seen_is_told(folder, capfd):
    import mitsonar

    course = '<string name="waypoints" value="0 -30, 0 30"/> <float name="altitude" value="10"/>'
    box = '<shape type="cube" id="box.1"><transform name="to_world"><translate x="90" z="-29"/></transform></shape>'
    text = (folder / "scene.xml").read_text()
    (folder / "scene.xml").write_text(text.replace('<boolean name="speckle"', f"{course}<boolean name=\"speckle\"")
                                      .replace("</scene>", f"{box}</scene>"))
    assert cli.main(["render", "scene.xml", "-o", "o.exr", "-D", "pings=11"]) == 0
    assert capfd.readouterr().err.splitlines() == [
        "mitsonar: the course is cut by pings, 11: 2 of 60 m are sailed; 365 pings are all of it",
        "mitsonar: no ping sees box.1: out of range, beyond the track, hidden or buried"]
    told = mitsonar.read("o.exr").attrs
    assert told["course_sailed"] == pytest.approx(10 * 0.08 * 4 * 1852 / 3600) and told["course_planned"] == 60
    assert told["unseen"] == ["box.1"]


def test_same_bytes_from_command_and_call_and_any_number_of_threads(folder, accepted):
    import drjit as dr

    import mitsonar

    mitsonar.io.records.exr.write(mitsonar.render(mitsonar.load_file("scene.xml", pings=3), seed=5), "call.exr")
    before = dr.thread_count()
    try:
        for threads in (1, 2, 5):
            accepted("render", "scene.xml", "-o", f"{threads}.exr", "-D", "pings=3", "--seed", 5, "--threads", threads)
    finally:
        dr.set_thread_count(before)
    once = (folder / "call.exr").read_bytes()
    assert all((folder / f"{threads}.exr").read_bytes() == once for threads in (1, 2, 5))


def test_resolved_scene_of_the_file_renders_the_same_image(folder, accepted):
    from mitsonar.io.records import exr

    accepted("render", "scene.xml", "-o", "a.exr", "-D", "range=45", "-D", "pings=3")
    first = exr.read("a.exr")
    (folder / "resolved.xml").write_text(first.attrs["scene"], encoding="utf-8")
    accepted("render", "resolved.xml", "-o", "b.exr")
    second = exr.read("b.exr")
    assert second.identical(first.assign_attrs(file="resolved.xml", parameters={}))


def test_scenes_that_come_with_mitsonar_go_by_name(accepted):
    assert accepted("render", "sidescan_flat", "-o", "o.exr", "-D", "pings=1", "-D", "rays=2000") == ["o.exr"]


def test_a_refused_render_leaves_the_older_file(folder, accepted, capfd):
    accepted("render", "scene.xml", "-o", "o.exr")
    before = (folder / "o.exr").read_bytes()
    assert cli.main(["render", "scene.xml", "-o", "o.exr", "-D", "rays=0"]) == 2
    assert (folder / "o.exr").read_bytes() == before


def test_out_of_memory_is_a_sentence(folder, monkeypatch, capfd):
    from mitsonar.verbs import images

    def rendered(*_, **__):
        raise MemoryError("Unable to allocate 9 TiB")

    monkeypatch.setattr(images, "rendered", rendered)
    assert cli.main(["render", "scene.xml", "-o", "o.exr"]) == 2
    assert capfd.readouterr().err == ("mitsonar: out of memory: Unable to allocate 9 TiB; take fewer pings, rays or "
                                      "bins\n")


def test_version(capfd):
    import mitsonar

    for option in ("-v", "--version"):
        with pytest.raises(SystemExit) as ended:
            cli.main([option])
        assert ended.value.code == 0
        assert capfd.readouterr().out == f"mitsonar {mitsonar.__version__}\n"


class Terminal(io.StringIO):
    def __init__(self, is_one):
        super().__init__()
        self.is_one = is_one

    def isatty(self):
        return self.is_one


@pytest.fixture
def shown(monkeypatch):
    """Return what is shown of a run that reports (seconds, pings done of 100)."""
    def run(reports, terminal, **options):
        clock = iter([0.0, *(seconds for seconds, _ in reports)])
        monkeypatch.setattr(progress, "time", types.SimpleNamespace(monotonic=lambda: next(clock)))
        monkeypatch.setattr(sys, "stderr", Terminal(terminal))
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setenv("COLUMNS", "100")
        with progress.Progress(**options) as report:
            for _, done in reports:
                report(done, 100)
        return sys.stderr.getvalue()
    return run


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_of_a_short_run_is_not_shown(shown, terminal):
    assert shown([(0.5, 50), (1.9, 100)], terminal) == ""


def test_progress_on_a_terminal_shows_rate_and_vanishes(shown):
    text = shown([(1, 10), (4, 40), (10, 100)], terminal=True)
    words = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", text)
    assert "40/100 pings, 10.0 pings/s, 0:00:06 left" in words and "100/100 pings, 10.0 pings/s, 0:00:00 left" in words
    # the cursor is shown again, goes back up and wipes the line
    assert re.search(r"\x1b\[\?25h.*\x1b\[1A\x1b\[2K$", text, re.S)


def test_progress_elsewhere_is_a_line_now_and_then(shown):
    text = shown([(1, 10), (4, 40), (21, 50), (25, 60), (36, 80)], terminal=False)
    assert text == ("50 of 100 pings, 2.0 pings/s, 0:00:25 left\n"
                    "80 of 100 pings, 2.0 pings/s, 0:00:10 left\n")


def test_progress_does_not_count_the_first_block_which_compiles(shown):
    """9 s for the first ping and 1 s for each of the others: 1 ping a second, not 0.1."""
    assert shown([(9, 1), (12, 4)], terminal=False) == "4 of 100 pings, 1.0 pings/s, 0:01:36 left\n"
    # of two processes, each of which compiles
    assert shown([(9, 1), (9.5, 2), (12.5, 5)], terminal=False, warm_up=2) == (
        "5 of 100 pings, 1.0 pings/s, 0:01:35 left\n")
    assert shown([(15, 1)], terminal=False) == "1 of 100 pings, timing the next\n"
    assert "at most 0:01:36 left" in shown([(9, 1), (12, 4)], terminal=False, at_most=True)


@pytest.mark.parametrize("terminal", [True, False])
def test_progress_shows_parts_of_a_ping(shown, terminal):
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown([(1, 0.1), (12, 0.25), (24, 1)], terminal))
    words = ("0.25/100 pings, 49 pings/h", "1/100 pings, ") if terminal else ("0.25 of 100 pings, 49 pings/h, ",
                                                                               "1 of 100 pings, ")
    assert all(word in text for word in words)


def test_the_demo_is_quick_and_looks_like_its_scene(variant):
    """A ray takes 0.3 µs of CPU, and loading, compiling and writing 18 s: 5 s are left for rays, of two cores' 12 s.

    Rays leave 0.8 dB in a bin, which lowers the mean of levels by 0.04 dB, and speckle 5.6: beside it neither is seen.
    In shadows, which side lobes fill, few rays arrive.
    """
    from mitsonar.cli.rendering import DEMO
    from mitsonar.io.scene_files import scenes

    path = scenes.find("sidescan_targets")
    assert DEMO["pings"] * DEMO["rays"] * 0.3e-6 < 5
    demo, full = (mitsonar.render(mitsonar.load_file(path, **{**values, "pings": 20})) for values in (DEMO, {}))
    levels = [image["mean_level"].values for image in (demo, full)]
    heard = (levels[0] > 60) & (levels[1] > 60) & (demo["label"].values > 0) & (full["label"].values > 0)
    difference = (levels[0] - levels[1])[heard]
    assert abs(difference.mean()) < 0.06 and np.diff(np.percentile(difference, [16, 84]))[0] / 2 < 0.9
    speckled = [image["level"].values for image in (demo, full)]
    assert np.std(speckled[0][heard]) == pytest.approx(np.std(speckled[1][heard]), rel=0.01)
    assert (demo["label"] == full["label"]).mean() > 0.96


@pytest.mark.parametrize("words, outputs", [([], ("demo.exr", "demo.png")),
                                             (["-o", "out/a.b.exr"], ("out/a.b.exr", "out/a.b.png"))])
def test_the_demos_picture_lies_beside_its_image(accepted, monkeypatch, words, outputs):
    from mitsonar.cli import rendering

    written = []
    monkeypatch.setattr(rendering, "_render_to", lambda *arguments: written.append(arguments[3:5]))
    accepted("demo", *words)
    assert written == [outputs]


def test_image_is_what_mitsubas_own_render_gives(folder, accepted):
    import mitsuba as mi

    from mitsonar.io.records import exr

    accepted("render", "scene.xml", "-o", "o.exr", "--seed", "3")
    level = exr.read("o.exr")["level"].values
    image = np.array(mi.render(mi.load_file(str(folder / "scene.xml")), seed=3))
    assert np.array_equal(image[..., 0], np.concatenate([level[:, 0, ::-1], level[:, 1]], -1))


def test_a_warning_is_one_sentence_on_standard_error(folder, capfd):
    """A rigid body of few, large facets: told, and rendered."""
    from small_scene import spoilt

    body = """<shape type="ply" id="ball"><string name="filename" value="ball.ply"/>
        <boolean name="face_normals" value="true"/><bsdf type="rigid"/></shape></scene>"""
    (folder / "ball.ply").write_text(coarse_ball())
    (folder / "scene.xml").write_text(spoilt(("</scene>", body)))
    assert cli.main(["render", "scene.xml", "-o", "o.exr"]) == 0
    out, err = capfd.readouterr()
    assert out == "o.exr\n"
    assert re.fullmatch(r'mitsonar: the smooth mesh "ball" is too coarse for a wavelength of .*\n', err)


def coarse_ball():
    """A ball of 1 m whose edges turn by less than what counts as sharp, as PLY text."""
    angle = np.linspace(0, 2 * np.pi, 17)[:-1]
    rings = [(np.cos(t) * np.cos(angle), np.cos(t) * np.sin(angle), np.full(16, np.sin(t))) for t in
             np.linspace(-1.4, 1.4, 15)]
    points = np.concatenate([np.stack(ring, 1) for ring in rings]) + [30, 0, -28]
    faces = [(16 * i + j, 16 * i + (j + 1) % 16, 16 * (i + 1) + (j + 1) % 16) for i in range(14) for j in range(16)]
    faces += [(16 * i + j, 16 * (i + 1) + (j + 1) % 16, 16 * (i + 1) + j) for i in range(14) for j in range(16)]
    header = (f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\n"
              f"property float z\nelement face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n")
    return (header + "".join("%f %f %f\n" % tuple(point) for point in points)
            + "".join("3 %d %d %d\n" % face for face in faces))


def test_all_sonars_of_a_scene_become_files_each(folder, accepted, capfd):
    from small_scene import spoilt

    second = """<sensor type="sidescan" id="high"><string name="preset" value="towed_400khz"/><ref id="sonar"/>
        <medium type="seawater"/><film type="sonar_film"><float name="range" value="40"/></film></sensor></scene>"""
    (folder / "scene.xml").write_text(spoilt(("</scene>", second)))
    assert accepted("render", "scene.xml", "-o", "o.exr", "--preview", "p.png", "--sensor", "all") == [
        "o_sonar.exr", "p_sonar.png", "o_high.exr", "p_high.png"]
    assert accepted("render", "scene.xml", "-o", "one.exr", "--sensor", "high") == ["one.exr"]
    assert (folder / "one.exr").read_bytes() == (folder / "o_high.exr").read_bytes()
    assert cli.main(["render", "scene.xml", "-o", "first.exr"]) == 0
    said = capfd.readouterr().err
    assert "the scene has 2 sonars, and sonar is rendered; --sensor all renders both" in said and said.count("\n") == 1
    assert (folder / "first.exr").read_bytes() == (folder / "o_sonar.exr").read_bytes()
    for arguments, words in ((("--sensor", "hihg"), 'did you mean "high"'),
                             (("--sensor", "all", "--each-ping"), "--sensor all and --each-ping")):
        assert cli.main(["render", "scene.xml", "-o", "n.exr", *arguments]) == 2
        said = capfd.readouterr().err
        assert words in said and said.count("\n") == 1


FAN = """<scene version="3.0.0"><integrator type="sonar_path"/>
<sensor type="forward_looking"><string name="preset" value="multibeam_720khz"/><integer name="pings" value="2"/>
<integer name="beams" value="9"/><point name="start" x="0" y="0" z="-6"/><medium type="seawater"/>
<film type="sonar_film"><float name="range" value="8"/><float name="range_min" value="6"/></film></sensor>
<shape type="seabed" id="seabed"><float name="depth" value="9"/><float name="length" value="40"/>
<float name="width" value="40"/><float name="spacing" value="2"/></shape></scene>"""


def test_pings_of_a_fan_become_files_each(folder, accepted, capfd):
    from mitsonar.io.records import exr

    (folder / "fan.xml").write_text(FAN)
    assert accepted("render", "fan.xml", "-o", "o.exr", "--each-ping") == ["o_0000.exr to o_0001.exr"]
    accepted("render", "fan.xml", "-o", "whole.exr")
    assert np.array_equal(exr.read("o_0001.exr")["level"], exr.read("whole.exr")["level"][1:])
    for arguments, words in ((("scene.xml", "--each-ping"), "no picture of a single ping"),
                             (("fan.xml", "--each-ping", "--preview", "p.png"), "--preview and --each-ping")):
        assert cli.main(["render", *arguments, "-o", "n.exr"]) == 2
        said = capfd.readouterr().err
        assert words in said and said.count("\n") == 1
