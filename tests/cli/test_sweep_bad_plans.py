"""Whatever is wrong with a plan: one clear sentence, exit code 2, nothing made. `refusal` checks the form."""
import os

import pytest

S = 'scene = "scene.xml"\n'
PLANS = {
    "nothing": ("", 'names no scene; write scene = "FILE.xml"'),
    "no TOML": ("scene = [", "cannot read the plan"),
    "a scene": ('<?xml version="1.0"?>\n<scene version="3.0.0"/>', "is XML, a scene perhaps; a plan is a TOML file"),
    "cut short": (S + '[grid]\nrange = [30, "4', "cannot read the plan"),
    "nested without end": (S + "[set]\nrange = " + "[" * 100_000, "cannot read the plan"),
    "unknown key": (S + "sample = 3", "unknown key 'sample' (did you mean \"samples\"?); known: scene, output"),
    "scene that is not there": ('scene = "no.xml"', "scene no.xml does not exist; give the path of a Mitsuba XML file"),
    "scene of the wrong type": ("scene = 3", "scene is 3; give the name of a file"),
    "scene that is a plan": ('scene = "plan.toml"', "the XML is broken"),
    "unknown parameter": (S + "[set]\nrnge = 3",
                          "no parameter 'rnge' (did you mean \"range\"?); it has pings, range, rays"),
    "given twice": (S + "[set]\nrange = 3\n[grid]\nrange = [3, 4]", "the parameter range is given twice"),
    "date": (S + "[set]\nrange = 2020-01-01", "set.range is datetime.date(2020, 1, 1); give a number, true or false"),
    "not a number": (S + "[set]\nrange = nan", "set.range is nan; give a finite number"),
    "huge number": (S + "[set]\nrange = 1" + "0" * 4000, "set.range is a number of 13288 bits; give a whole number of"),
    "control characters": (S + '[set]\nrange = "a\\u0000b"', "set.range is a text of 3 characters"),
    "empty list": (S + "[grid]\nrange = []", "grid.range is []; give a list of values"),
    "number for a list": (S + "[grid]\nrange = 30", "grid.range is 30; give a list of values"),
    "unequal lists": (S + "[list]\nrange = [1, 2]\npings = [1]", "run side by side, and have the lengths"),
    "range without an end": (S + "[grid]\nrange = { from = 3 }", "give { from, to, count } or { from, to, step }"),
    "step the wrong way": (S + "[grid]\nrange = { from = 3, to = 1, step = 1 }", "give a step that gets there"),
    "step of nothing": (S + "[grid]\nrange = { from = 3, to = 4, step = 0 }", "give a step that gets there"),
    "endless range": (S + "[grid]\nrange = { from = 0, to = 1e9, step = 1e-9 }", "in at most 1,000,000"),
    "log of nothing": (S + "[grid]\nrange = { from = 0, to = 1, count = 3, scale = 'log' }", "give numbers above 0"),
    "unknown distribution": (S + "[draw]\nrange = { gauss = [0, 1] }", "give one of uniform, log_uniform, normal"),
    "no spread": (S + "[draw]\nrange = { uniform = [3, 3] }", "is from 3 to 3; give the lowest and the highest number"),
    "negative deviation": (S + "[draw]\nrange = { normal = [3, -1] }", "standard deviation -1; give one above 0"),
    "weights": (S + "[draw]\nrange = { choice = [1, 2], weights = [1] }", "has 2 values and the weights [1]"),
    "weights of nothing": (S + "[draw]\nrange = { choice = [1, 2], weights = [0, 0] }", "not all 0"),
    "weights of numbers": (S + "[draw]\nrange = { uniform = [1, 2], weights = [1] }", "unknown key 'weights' beside"),
    "half a pair": (S + "[draw]\nrange = { integer = [1] }", "draw.range: integer is [1]; give two numbers"),
    "samples of nothing": (S + "samples = 3", "no parameter is drawn, so that all would be alike"),
    "no samples": (S + "samples = 0", "samples is 0; give a whole number from 1 to 1000000"),
    "redraw of nothing": (S + 'redraw = ["pings"]', "redraw names 'pings', which is not drawn"),
    "redraw in names": (S + 'output = "{range}.exr"\nredraw = ["range"]\n[draw]\nrange = { uniform = [30, 40] }',
                        "output holds the parameter range, which redraw may draw again"),
    "classes twice": (S + 'classes = ["tyre", "tyre"]', "give a list of different names"),
    "same seeds": (S + "seeds = [1, 1]", "give different whole numbers"),
    "seed too large": (S + "seed = 4294967296", "seed is 4294967296; give a whole number from 0 to 4294967295"),
    "too many": (S + "seeds = 1000\n[grid]\nrange = { from = 1, to = 2, count = 10000 }", "makes 10,000,000 renders; "
                 "make it at most 1,000,000"),
    "far too many": (S + "[grid]\n" + "".join(f"{name} = {{ from = 1, to = 2, count = 100001 }}\n"
                                              for name in ("range", "rays", "pings")), "makes over 1e15 renders"),
    "same names": (S + 'output = "{range}.exr"\n[grid]\nrange = [3, 4]\npings = [1, 2]',
                   "names both render 0 and render 1 '3.exr'; put {index} or all that varies into it"),
    "names that differ by capitals": (S + 'output = "{range}.exr"\n[grid]\nrange = ["a", "A"]', "0 and render 1"),
    "outside the folder": (S + 'output = "../{index}.exr"', "give names that do not begin with a dot"),
    "anywhere": (S + 'output = "/etc/{index}.exr"', "inside the sweep's folder"),
    "hidden": (S + 'output = ".{index}.exr"', "give names that do not begin with a dot"),
    "hidden by a value": (S + 'output = "{range}.exr"\n[set]\nrange = "..x"', "give one that makes visible names"),
    "other files": (S + 'output = "{index}.png"', "give names that end in .exr"),
    "unknown field": (S + 'output = "{depth}.exr"', "output has the field 'depth'; known: index, seed"),
    "field that looks inside": (S + 'output = "{index.__class__}.exr"', "output has the field 'index.__class__'"),
    "field without end": (S + 'output = "{index.exr"', "output is"),
    "wide field": (S + 'output = "{index:999999999}.exr"', "with the format '999999999'; give one such as 04"),
    "format that does not fit": (S + 'output = "{range:d}.exr"\n[set]\nrange = "a"', "does not fit its value 'a'"),
    "long name": (S + 'output = "{range}.exr"\n[set]\nrange = "' + "a" * 300 + '"', "at most 200 bytes"),
    "table with a text for a number": (S + 'table = "k.csv"', "the parameter range is '9 m'; the scene scene.xml "
                                       "takes a number"),
    "fraction for a whole number": (S + "[grid]\npings = [1, 2.5]", "pings is 2.5; the scene scene.xml takes a whole"),
    "fraction drawn for a whole number": (S + "[draw]\npings = { uniform = [1, 9] }", "takes a whole number"),
    "number for true or false": (S + "[set]\nspeckle = 1", "speckle is 1; the scene scene.xml takes true or false"),
    "list for a number": (S + "[set]\nrange = [3, 4]", "range is (3, 4); the scene scene.xml takes a number"),
    "previews": (S + "previews = 1", "previews is 1; give true or false"),
    "options of soundings for pictures": (S + "[soundings]\ncolumn = true", "[soundings] is given, but output names "
                                          "pictures"),
    "unknown option of soundings": (S + 'output = "{index}.gsf"\n[soundings]\ncolum = true',
                                     "soundings.colum is unknown"),
    "column of soundings": (S + 'output = "{index}.gsf"\n[soundings]\ncolumn = 1', "column is 1; give true or false"),
    "place of soundings": (S + 'output = "{index}.gsf"\n[soundings]\nplace = [91, 0]', "place is 91"),
    "tide of soundings": (S + 'output = "{index}.gsf"\n[soundings]\ntide = 1e4', "tide is 10000 m"),
    "cast of soundings": (S + 'output = "{index}.gsf"\n[soundings]\nprofile = "no.csv"', "no.csv"),
    "previews of soundings": (S + 'output = "{index}.gsf"\npreviews = true', "leave previews out"),
    "section that is none": (S + "grid = 3", "grid is 3; write parameters under [grid]"),
    "table that is not there": (S + 'table = "no.csv"', "no.csv does not exist; give the path of a CSV file"),
    "table that never ends": (S + 'table = "/dev/zero"', "/dev/zero is no file; give the path of a CSV file"),
    "table that is no text": (S + 'table = "b.csv"', "it is not a text file"),
    "table without rows": (S + 'table = "h.csv"', "it has a header but no records"),
    "table of other parameters": (S + 'table = "c.csv"', "has no parameter 'depth'"),
    "table with a column twice": (S + 'table = "t.csv"', "give each a name of its own"),
    "table with too many fields": (S + 'table = "w.csv"', "w.csv, line 3: 3 fields, but the header names 2"),
}
TABLES = {"b.csv": b"\xff\x00\xfe", "h.csv": b"range,pings\n", "c.csv": b"range,depth\n1,2\n",
          "t.csv": b"range,range\n1,2\n", "w.csv": b"range,pings\n1,2\n1,2,3\n",
          "k.csv": b"range\n30\n9 m\n"}


@pytest.mark.parametrize("text, says", PLANS.values(), ids=PLANS)
def test_spoilt_plans(folder, refusal, text, says):
    for name, content in TABLES.items():
        (folder / name).write_bytes(content)
    (folder / "plan.toml").write_text(text, encoding="utf-8")
    assert says in refusal("sweep", "plan.toml")
    assert says in refusal("sweep", "plan.toml", "--dry-run")


@pytest.mark.parametrize("name, content, says", [
    ("none.toml", None, "none.toml does not exist; give the path of a TOML file or one of: divers, "
                        "divers_and_boxes, focused_targets, gallery, minefield, mines_and_wrecks"),
    ("b.toml", b"\xff\xfe\x00", "is not a text file; give a TOML file"),
    ("d.toml", "a folder", "d.toml is no file"),
])
def test_files_that_are_no_plans(folder, refusal, name, content, says):
    if isinstance(content, bytes):
        (folder / name).write_bytes(content)
    elif content:
        (folder / name).mkdir()
    assert says in refusal("sweep", name)


def test_a_huge_plan_is_not_read(folder, refusal):
    with open(folder / "plan.toml", "wb") as file:
        file.truncate(1 << 40)                         # a hole: no disk is used
    assert "has 1,099,511,627,776 bytes; give a TOML file of at most 10,000,000" in refusal("sweep", "plan.toml")


@pytest.mark.parametrize("options, says", [
    (["--threads", "0"], "0 threads were asked for; give 1 to 1024"),
    (["--processes", "0"], "0 processes were asked for; give 1 to 1024"),
    (["--workers", "2", "--processes", "2"], "were asked for together; give one of them"),
    (["--scheduler", "nonsense://x"], "no Dask workers to be had at nonsense://x"),
    (["-o", "new/newer", "--scheduler", "nonsense://x"], "no Dask workers to be had at"),
    (["-o", "scene.xml/in"], "scene.xml/in: it is a file, or in one; give a folder by -o"),
    (["-o", "scene.xml"], "scene.xml: it is a file, or in one; give a folder by -o"),
    (["--processes", "two"], "'two' is not a whole number"),
    (["--dry-run", "--scheduler", "tcp://x:1"], "estimates for this machine"),
    (["--rate-core-hour", "0.04"], "rates are given, but no dry run"),
    (["--dry-run", "--currency", "EUR"], "a currency is given, but no rate"),
    (["--dry-run", "--rate-gb-month", "-1"], "the rate of a GB and month is -1"),
])
def test_spoilt_options(folder, refusal, options, says):
    (folder / "plan.toml").write_text(S, encoding="utf-8")
    assert says in refusal("sweep", "plan.toml", *options)


def test_a_scene_that_cannot_be_loaded_is_told_before_anything_starts(folder, refusal):
    (folder / "plan.toml").write_text(S + '[grid]\nrays = [0, -1]', encoding="utf-8")
    assert 'no render of plan.toml was started: ' in (said := refusal("sweep", "plan.toml"))
    assert "rays is the integer 0" in said


@pytest.mark.parametrize("text", ['[set]\ncast = "no.csv"', '[grid]\ncast = ["c.csv", "no.csv"]',
                                  '[draw]\ncast = { choice = ["c.csv", "no.csv"] }'])
def test_a_file_that_is_not_there_is_told_before_anything_starts(folder, refusal, text):
    scene = (folder / "scene.xml").read_text(encoding="utf-8")
    speed = '<float name="sound_speed" value="1500"/>'
    assert speed in scene
    (folder / "scene.xml").write_text(scene.replace(speed, '<string name="cast" value="$cast"/>'), encoding="utf-8")
    (folder / "c.csv").write_text("depth,speed\n0,1500\n40,1490\n", encoding="utf-8")
    (folder / "plan.toml").write_text(S + text, encoding="utf-8")
    assert "scene.xml reads the file no.csv, which is not there" in refusal("sweep", "plan.toml")


TARGETS = '<shape type="targets"><string name="meshes" value="{}"/><integer name="count" value="1"/></shape></scene>'
BITMAP = '<texture type="bitmap" name="mu_db"><string name="filename" value="{}"/></texture>'


@pytest.mark.parametrize("written, missing", [
    (TARGETS.format("no_folder"), "no_folder"), (TARGETS.format("mine.ply, rock.ply"), "rock.ply"),
    (f'<bsdf type="lambert">{BITMAP.format("no.png")}</bsdf></scene>', "no.png")])
def test_what_other_plugins_read_is_looked_for_too(folder, refusal, written, missing):
    """A folder or a list of meshes, and what a plugin of Mitsuba's own names."""
    scene = (folder / "scene.xml").read_text(encoding="utf-8")
    (folder / "scene.xml").write_text(scene.replace("</scene>", written), encoding="utf-8")
    (folder / "mine.ply").write_text("ply", encoding="utf-8")
    (folder / "plan.toml").write_text(S, encoding="utf-8")
    assert f"scene.xml reads the file {missing}, which is not there" in refusal("sweep", "plan.toml")


def test_a_place_where_no_folder_can_be_made(folder, refusal, monkeypatch):
    """As for a plan in a folder that is only to be read; root would be let in."""
    def shut(path, **_):
        raise PermissionError(13, "Permission denied", path)
    (folder / "plan.toml").write_text(S, encoding="utf-8")
    monkeypatch.setattr("mitsonar.sweep.execute.os.makedirs", shut)
    assert f"cannot write into {folder}/plan: no permission to make it in {folder}; give another folder by -o" in \
        refusal("sweep", "plan.toml")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_to(folder, refusal):
    (folder / "plan.toml").write_text(S, encoding="utf-8")
    (folder / "shut").mkdir(mode=0o500)
    assert "no permission to write in" in refusal("sweep", "plan.toml", "-o", "shut")


@pytest.mark.parametrize("rules, said", [
    ('whole = "no"', "labels.whole is 'no'; give true or false"),
    ("masks = 0", "labels.masks is 0; give true or false"),
    ("tile = [64, 64, 64]", "labels.tile is [64, 64, 64]; give a list of two numbers"),
    ("tile = [64.5, 64]", "labels.tile is 64.5; give a whole number"), ("tile = [-8, 8]", "labels.tile is -8; give"),
    ("tile = [4, 8]", "[labels]: a tile is 4 pings by 8 bins"), ("smallest = true", "labels.smallest is True; give"),
    ('tvg = "nonsense"', "labels.tvg is 'nonsense'; give seabed or target or"),
    ("yolo = {}", "labels.yolo is {}; give"),
    ("window = {a = 1}", "labels.window is {'a': 1}; give a list of two"),
    ('threshold = "0.5"', "is '0.5'; give a number"),
    ("window = [3, 1]", "[labels]: black is 3 dB"),
    ('form = "cartesian"\ncell = -1', "labels.cell is -1; give a length"),
    ('arrays = "level"', "labels.arrays is 'level'; give a list of variables")])
def test_rules_of_another_kind(folder, refusal, rules, said):
    (folder / "plan.toml").write_text(f'{S}output = "{{index}}.tar"\nclasses = ["box"]\n[labels]\n{rules}\n',
                                      encoding="utf-8")
    assert said in refusal("sweep", "plan.toml")


@pytest.mark.parametrize("output, said", [
    ("{range}.tar", "output names both render 0 and render 1 '1_5.tar'; put {index} or all that varies into it"),
    ("a/{index}" + "_" * 62 + ".tar", "which is too long for files in a tar; give one that makes names of at most 64")])
def test_samples_whose_pictures_would_have_no_names(folder, refusal, output, said):
    (folder / "plan.toml").write_text(f'{S}output = "{output}"\nclasses = ["box"]\n[grid]\nrange = ["1.5", "1_5"]\n',
                                      encoding="utf-8")
    assert said in refusal("sweep", "plan.toml")
