"""Plans of sweeps: which renders they make, in which order, what is drawn; whatever is wrong is one sentence."""
import copy
import itertools
import re
from pathlib import Path

import hypothesis
import pytest
from hypothesis import strategies
from small_scene import TEXT

from mitsonar.io.scene_files import scenes
from mitsonar.sweep import execute, load_plan, values

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """A folder with a scene in it, to put plans into."""
    folder = tmp_path_factory.mktemp("plans")
    (folder / "scene.xml").write_text(TEXT, encoding="utf-8")
    return folder


@pytest.fixture
def plan(place):
    """Load a plan of the scene from its text."""
    def load(text="", scene='scene = "scene.xml"\n'):
        (place / "plan.toml").write_text(scene + text, encoding="utf-8")
        return load_plan(place / "plan.toml")
    return load


def renders(plan):
    return [plan.render(index) for index in range(len(plan))]


def test_a_bare_plan_is_one_render_of_the_scene(plan):
    (only,) = renders(plan())
    assert (only.index, only.output, only.parameters) == (0, "000000.exr", {})


def test_a_scene_that_comes_with_mitsonar(plan):
    assert plan("[set]\npings = 3", 'scene = "sidescan_flat"\n').scene.endswith("sidescan_flat.xml")


def test_grid_crosses_lists_run_side_by_side_and_the_table_gives_rows(plan, place):
    (place / "runs.csv").write_text("speckle, rays\ntrue, 100\nfalse, 200\n", encoding="utf-8")
    found = renders(plan("""
        table = "runs.csv"
        output = "{index:02}_{range}_{pings}.exr"
        [grid]
        range = [30, 50.5]
        [list]
        pings = [2, 3, 4]"""))
    assert len(found) == 2 * 3 * 2
    expected = itertools.product([(True, 100), (False, 200)], [2, 3, 4], [30, 50.5])
    for index, (render, ((speckle, rays), pings, reach)) in enumerate(zip(found, expected, strict=True)):
        assert render.parameters == {"speckle": speckle, "rays": rays, "pings": pings, "range": reach}
        assert render.output == f"{index:02}_{reach}_{pings}.exr"
    assert found[0].parameters["speckle"] is True and isinstance(found[0].parameters["rays"], int)


@pytest.mark.parametrize("text, values", [
    ("{ from = 5, to = 10, count = 3 }", (5, 7.5, 10)),
    ("{ from = 0, to = 0.3, step = 0.1 }", (0.0, 0.1, 0.2, 0.3)),
    ("{ from = 3, to = 1, step = -1 }", (3, 2, 1)),
    ("{ from = 1, to = 10, step = 4 }", (1, 5, 9)),
    ("{ from = 1, to = 1000, count = 4, scale = 'log' }", (1, 10.0, 100.0, 1000)),
    ("{ from = 2, to = 2, count = 1 }", (2,)),
])
def test_ranges(plan, text, values):
    found = tuple(render.parameters["range"] for render in renders(plan(f"[grid]\nrange = {text}")))
    assert list(map(str, found)) == list(map(str, values))           # whole numbers stay whole


DRAWS = """
[draw]
range = { uniform = [10, 20] }
rays = { integer = [5, 7] }
pings = { choice = [1, 2, 4], weights = [1, 0, 3] }
speckle = { choice = [true, false] }
"""


def test_draws_follow_their_distributions(plan):
    found = [render.parameters for render in renders(plan("samples = 2000" + DRAWS))]
    reach = sorted(one["range"] for one in found)
    # Kolmogorov-Smirnov: beyond 1.63 / sqrt(n) once in a hundred seeds, and this seed is always the same
    assert max(abs(value - 10 - 10 * k / 2000) / 10 for k, value in enumerate(reach)) < 1.63 / 2000**0.5
    assert {one["rays"] for one in found} == {5, 6, 7}
    counts = [sum(one["pings"] == value for one in found) for value in (1, 2, 4)]
    assert counts[1] == 0 and abs(counts[0] - 500) < 60          # three standard deviations
    assert {one["speckle"] for one in found} == {True, False}


def test_log_uniform_and_normal_draws(plan):
    def drawn(how):
        return [one.parameters["range"] for one in renders(plan(f"samples = 2000\n[draw]\nrange = {how}"))]
    assert abs(sum(one < 10 for one in drawn("{ log_uniform = [1, 100] }")) - 1000) < 70
    assert abs(sum(one < 54 for one in drawn("{ normal = [50, 4] }")) - 0.8413 * 2000) < 50


def test_a_longer_sweep_begins_with_the_same_renders(plan):
    short, long = renders(plan("samples = 3" + DRAWS)), renders(plan("samples = 9" + DRAWS))
    assert long[:3] == short
    other = renders(plan("samples = 3" + DRAWS.replace("pings", "#")))
    assert [one.parameters["range"] for one in other] == [one.parameters["range"] for one in short]
    assert [one.seed for one in other] == [one.seed for one in short]
    again = renders(plan("seed = 1\nsamples = 3" + DRAWS))
    assert all(one.seed != two.seed and one.parameters["range"] != two.parameters["range"]
               for one, two in zip(again, short, strict=True))


def test_draws_are_those_of_earlier_versions(plan):
    render = plan("seed = 7\nsamples = 5\n" + DRAWS).render(3)
    assert render.parameters == {"range": 12.4493390942, "rays": 6, "pings": 4, "speckle": False}
    assert render.seed == 819277884


@pytest.mark.parametrize("bits", [0, (1 << 256) - 1])
def test_the_ends_of_the_random_numbers_can_be_drawn(bits):
    for given in ({"uniform": [1, 2]}, {"log_uniform": [1, 2]}, {"normal": [1, 2]}, {"integer": [1, 2]},
                  {"choice": [1, 2], "weights": [0.1, 0.2]}, {"choice": [1, 2], "weights": [1, 0]}):
        assert -20 < values.draw(given, "it").at(bits) < 20


def test_seeds_of_every_combination(plan):
    found = renders(plan('seeds = 3\noutput = "{range}_{seed}.exr"\n[grid]\nrange = [1, 2]'))
    assert len({render.seed for render in found}) == 6
    found = renders(plan('seeds = [7, 5]\noutput = "{range}_{seed}.exr"\n[grid]\nrange = [1, 2]'))
    assert [render.output for render in found] == ["1_7.exr", "2_7.exr", "1_5.exr", "2_5.exr"]


def test_values_make_safe_names(plan, place):
    (place / "texts.xml").write_text('<scene version="3.0.0"><string name="x" value="$range"/>'
                                     '<string name="y" value="$pings"/></scene>', encoding="utf-8")
    (only,) = renders(plan('output = "a/{range}_{pings}.exr"\n[set]\nrange = "x/../y z"\npings = [1, 2]',
                           'scene = "texts.xml"\n'))
    assert only.output == "a/x_.._y_z_1,2.exr"
    assert only.parameters == {"range": "x/../y z", "pings": (1, 2)}


def test_a_file_is_named_without_its_folder(plan, place):
    for name in ("deep", "flat"):
        (place / "casts").mkdir(exist_ok=True)
        (place / "casts" / f"{name}.csv").touch()
    (place / "cast.xml").write_text('<scene version="3.0.0"><medium type="seawater"><string name="cast" value="$cast"/>'
                                    '<string name="text" value="$text"/></medium></scene>', encoding="utf-8")
    found = renders(plan('output = "{cast}_{text}.exr"\n[set]\ntext = "a/b"\n[grid]\n'
                         f'cast = ["casts/deep.csv", "{place}/casts/flat.csv"]', 'scene = "cast.xml"\n'))
    assert [one.output for one in found] == ["deep.csv_a_b.exr", "flat.csv_a_b.exr"]
    assert found[0].parameters == {"cast": "casts/deep.csv", "text": "a/b"}


def test_plans_that_come_with_mitsonar_and_the_one_of_the_manual(tmp_path):
    for path in ROOT.glob("scenes/*.toml"):
        assert len(load_plan(path)) > 1
    page = (ROOT / "scenes" / "manual" / "sweeps.md").read_text(encoding="utf-8")
    (tmp_path / "plan.toml").write_text(re.search(r"^```toml\n(.*?)^```$", page, re.M | re.S)[1], encoding="utf-8")
    for name in ("minefield.xml", "targets"):
        (tmp_path / name).symlink_to(ROOT / "scenes" / name)
    assert len(load_plan(tmp_path / "plan.toml")) == 720


@pytest.mark.parametrize("name", ["minefield", "minefield.toml"])
def test_a_plan_that_comes_with_mitsonar_is_found_by_name_and_renders_where_the_user_is(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    for _ in range(2):
        plan = load_plan(name)
        assert Path(plan.path).samefile(ROOT / "scenes" / "minefield.toml")
        assert execute.default_folder(plan) == str(tmp_path / "minefield")
        (tmp_path / "minefield").mkdir(exist_ok=True)              # made by a sweep, and no plan
    assert Path(scenes.find("minefield")).samefile(ROOT / "scenes" / "minefield.xml")
    assert execute.default_folder(load_plan(ROOT / "scenes" / "minefield.toml")) == str(ROOT / "scenes" / "minefield")
    (tmp_path / "minefield.toml").write_text('scene = "sidescan_flat"', encoding="utf-8")
    assert Path(load_plan("minefield.toml").path).parent == tmp_path


WORDS = ["scene", "output", "seed", "seeds", "samples", "previews", "table", "set", "list", "grid", "draw", "range",
         "pings", "from", "to", "count", "step", "scale", "log", "uniform", "normal", "choice", "weights", "integer",
         "log_uniform", "scene.xml", "{index}.exr", "{range}.exr", "{index:99999}.exr", "../x.exr", "/dev/zero", "",
         "of", "when", "cases", "else", "together", "rows", "scenes", "share", "split", "group", "train", "val",
         "renders", "name", "rays", "speckle", "true", "range > 3", "rays * 2", "rows.csv", "n",
         "{split}/{index}.exr", "redraw"]
LEAVES = strategies.one_of(strategies.booleans(), strategies.integers(), strategies.floats(), strategies.text(),
                           strategies.sampled_from(WORDS), strategies.integers(0, 20), strategies.dates())
VALUES = strategies.recursive(LEAVES, lambda inner: strategies.one_of(
    strategies.lists(inner, max_size=4), strategies.dictionaries(strategies.sampled_from(WORDS), inner, max_size=3)))
SOUND = {"scene": "scene.xml", "output": "{index:03}_{range}.exr", "seed": 3, "seeds": 2, "samples": 2,
         "previews": False, "set": {"pings": 2}, "list": {"speckle": [True, False]},
         "grid": {"range": {"from": 30, "to": 50, "count": 3}}, "draw": {"rays": {"integer": [1000, 2000]}}}
TOGETHER = {"scene": "scene.xml", "samples": 4, "output": "{split}/{index:03}.exr", "draw": {
    "range": {"uniform": [10, 20]}, "pings": {"integer": [1, 9]},
    "speckle": {"when": "range > 15", "cases": {"true": True}, "else": {"choice": [True, False]}}},
    "rows": {"table": "rows.csv", "weights": "n"}, "together": {"range": {"pings": 0.5}},
    "split": {"train": 0.5, "val": 0.5, "group": ["pings"]}}
SEVERAL = {"renders": 9, "output": "{scene}_{index:03}.exr", "set": {"pings": {"of": "rays + 1"}}, "scenes": [
    {"scene": "scene.xml", "share": 2, "draw": {"rays": {"integer": [1, 900]}}},
    {"scene": "scene.xml", "name": "b", "grid": {"rays": [1, 2, 3]}}],
    "split": {"train": 0.5, "test": 0.5, "group": ["rays"]}}


@strategies.composite
def plans(pick):
    """A sound plan with one or two things in it replaced, added or left out."""
    plan = copy.deepcopy(pick(strategies.sampled_from([SOUND, TOGETHER, SEVERAL])))
    for _ in range(pick(strategies.integers(1, 2))):
        inside = plan
        while isinstance(inside, (dict, list)) and inside:
            key = pick(strategies.sampled_from(sorted(inside) if isinstance(inside, dict) else range(len(inside))))
            if not isinstance(inside[key], (dict, list)) or not inside[key] or pick(strategies.booleans()):
                break
            inside = inside[key]
        change = pick(strategies.sampled_from(["replace", "add", "leave out"]))
        if change == "leave out":
            inside.pop(key)
        else:
            replaced = change == "replace" or isinstance(inside, list)
            inside[key if replaced else pick(strategies.sampled_from(WORDS))] = pick(VALUES)
    return plan


def as_toml(value):
    """Write a value as TOML, tables inline."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, dict):
        return "{" + ", ".join(f"{as_toml(key)} = {as_toml(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(as_toml, value)) + "]"
    if isinstance(value, list):
        return f"[{', '.join(map(as_toml, value))}]"
    if isinstance(value, str):
        return '"' + "".join(letter if letter.isalnum() and letter.isascii() else f"\\U{ord(letter):08x}"
                             for letter in value if not 0xd800 <= ord(letter) < 0xe000) + '"'
    return str(value)


def loads_or_says_why(path):
    try:
        plan = load_plan(path)
    except (ValueError, OSError) as error:
        assert "\n" not in str(error) and 10 < len(str(error)) < 1500
        return
    for index in {0, len(plan) // 2, len(plan) - 1}:
        name = plan.render(index).output
        assert name.lower().endswith(".exr") and not name.startswith("/") and ".." not in name.split("/")


FUZZ = {"deadline": None, "derandomize": True, "suppress_health_check": list(hypothesis.HealthCheck)}


@hypothesis.settings(max_examples=300, **FUZZ)
@hypothesis.given(given=plans())
def test_any_plan_loads_or_is_refused_in_a_sentence(place, given):
    (place / "rows.csv").write_text("rays, n\n100, 1\n200, 3\n", encoding="utf-8")
    text = "\n".join(f"{as_toml(key)} = {as_toml(value)}" for key, value in given.items())
    (place / "fuzz.toml").write_text(text, encoding="utf-8")
    loads_or_says_why(place / "fuzz.toml")


@hypothesis.settings(max_examples=60, **FUZZ)
@hypothesis.given(given=strategies.one_of(strategies.binary(), strategies.text().map(str.encode), strategies.integers(
    0, len(DRAWS)).map(lambda cut: ('scene = "scene.xml"\nsamples = 2' + DRAWS)[:cut].encode())))
def test_any_bytes_load_or_are_refused_in_a_sentence(place, given):
    (place / "fuzz.toml").write_bytes(given)
    loads_or_says_why(place / "fuzz.toml")


@hypothesis.settings(max_examples=60, **FUZZ)
@hypothesis.given(given=strategies.one_of(strategies.binary(), strategies.text(alphabet='range,pings;\n\t"1e.-').map(
    lambda text: f"range,pings\n{text}".encode())))
def test_any_table_loads_or_is_refused_in_a_sentence(place, given):
    (place / "fuzz.csv").write_bytes(given)
    (place / "fuzz.toml").write_text('scene = "scene.xml"\ntable = "fuzz.csv"', encoding="utf-8")
    loads_or_says_why(place / "fuzz.toml")
