"""Several scenes in one plan, and subsets that are known before anything is rendered."""
import dataclasses
import time
from collections import Counter

import hypothesis
import numpy as np
import pytest
from hypothesis import strategies
from small_scene import TEXT
from test_sweep_runs import Pool, left

from mitsonar.sweep import estimate, execute, load_plan, merging, run
from mitsonar.sweep.drawing.shares import SharedTurns
from mitsonar.sweep.execute import only
from mitsonar.sweep.manifest import SUBSETS, ManifestEntry, stamp_of, versions
from mitsonar.sweep.parts import Part

SCENES = """
renders = 40
output = "{scene}_{index:04}.exr"
[set]
pings = 3
[draw]
rays = { integer = [1, 1000000] }
[[scenes]]
name = "reef"
scene = "scene.xml"
share = 0.5
[[scenes]]
name = "mud"
scene = "scene.xml"
share = 0.3
[scenes.grid]
range = [30, 50]
[[scenes]]
scene = "other.xml"
share = 0.2
[scenes.set]
pings = 1
[scenes.draw]
range = { uniform = [1, 2] }
"""
SPLIT = '\n[split]\ntrain = 0.7\nval = 0.2\ntest = 0.1\ngroup = ["rays"]\n'


@pytest.fixture
def place(tmp_path):
    """A folder with two scenes in it, to put plans into."""
    (tmp_path / "scene.xml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "other.xml").write_text(TEXT.replace("-27", "-30"), encoding="utf-8")
    return tmp_path


@pytest.fixture
def plan(place):
    """Load a plan from its text."""
    def load(text):
        (place / "plan.toml").write_text(text, encoding="utf-8")
        return load_plan(place / "plan.toml")
    return load


def renders(plan):
    return [plan.render(index) for index in range(len(plan))]


@hypothesis.settings(max_examples=60, deadline=None, derandomize=True)
@hypothesis.given(strategies.lists(strategies.integers(1, 20), min_size=1, max_size=8), strategies.integers())
def test_turns_keep_their_shares_at_any_length(parts, seed):
    """Exact where all shares of a length are whole, a few turns from it elsewhere.

    A thing is at most one turn from its share of the places, and places at most one for each thing from the turns.
    """
    total = sum(parts)
    which = SharedTurns(parts, seed).which(5 * total)
    counts = np.cumsum(which[:, None] == np.arange(len(parts)), axis=0)
    np.testing.assert_array_equal(counts[total - 1::total], np.outer(np.arange(1, 6), parts))
    ideal = np.outer(np.arange(1, 5 * total + 1), np.array(parts) / total)
    assert np.abs(counts - ideal).max() < 1 + len(parts) * max(parts) / total
    np.testing.assert_array_equal(SharedTurns(parts, seed).which(total), which[:total])
    turns = SharedTurns(parts, seed)
    assert [turns[turn] for turn in range(total)] == [
        (thing, counts[turn, thing] - 1) for turn, thing in enumerate(which[:total])]


def test_turns_are_in_random_order():
    """Parts of a sweep, which take every n-th render, get all scenes; without chance they would get one each."""
    which = SharedTurns([0.7, 0.3], 0).which(10_000)
    for count in (2, 10):
        for first in range(count):
            assert 0.5 < np.mean(which[first::count] == 0) < 0.9


def test_scenes_share_the_renders_of_a_plan(plan, place):
    found = renders(plan(SCENES))
    assert Counter(render.recipe.name for render in found) == {"reef": 20, "mud": 12, "other": 8}
    assert all(render.output == f"{render.recipe.name}_{render.index:04}.exr" for render in found)
    by_scene = {name: [render for render in found if render.recipe.name == name] for name in ("reef", "mud", "other")}
    assert {render.recipe.scene for render in by_scene["other"]} == {str(place / "other.xml")}
    assert {tuple(render.parameters) for render in by_scene["reef"]} == {("pings", "rays")}
    assert {render.parameters["pings"] for render in by_scene["other"]} == {1}                # its own, not the head's
    assert [render.parameters["range"] for render in by_scene["mud"]] == 6 * [30, 50]
    assert all(1 < render.parameters["range"] < 2 for render in by_scene["other"])
    assert len({render.parameters["rays"] for render in found}) == 40       # of one name, but drawn apart in each scene
    assert len({render.seed for render in found}) == 40
    assert repr(plan(SCENES)).endswith("plan.toml': 40 renders of reef, mud, other, seed 0>")


def test_more_renders_change_none_of_those_before(plan):
    for text in (SCENES, SCENES + SPLIT):
        assert renders(plan(text.replace("renders = 40", "renders = 333")))[:40] == renders(plan(text))
    other = renders(plan("seed = 1" + SCENES))
    assert [render.recipe.name for render in other] != [render.recipe.name for render in renders(plan(SCENES))]


@pytest.mark.parametrize("old, new, part", [
    ("renders = 40", "", "give renders = 1000"), ("renders = 40", "renders = 40\nsamples = 3", "give renders, the"),
    ("renders = 40", 'renders = 40\nscene = "scene.xml"', "scene is given beside"),
    ("share = 0.5", "share = 0", "scenes.reef.share is 0"), ("share = 0.5", "shares = 1", 'did you mean "share"'),
    ('name = "reef"', 'name = "mud"', "two scenes are named mud"), ('name = "reef"', 'name = "a/b"', "is 'a/b'; give"),
    ('scene = "other.xml"', "", r"scenes\[2\] names no scene"), ("range = { uniform", "rnge = { uniform",
                                                                                           "scene other"),
    ("{scene}", "{range}", "the field 'range'; known: index, pings, rays, scene, seed"),
    ("pings = 1", "pings = 1.5", "pings is 1.5; the scene other.xml takes a whole number"),
])
def test_wrong_scenes_are_refused_in_a_sentence(plan, old, new, part):
    with pytest.raises(ValueError, match=part) as refusal:
        plan(SCENES.replace(old, new))
    assert "\n" not in str(refusal.value)


def test_a_plan_is_lengthened_by_its_count(plan):
    crossed = 'scene = "scene.xml"\nsamples = 20\n[grid]\npings = [1, 2]\n[draw]\nrays = { integer = [1, 900] }'
    for text in (SCENES, crossed):
        short = plan(text)
        long = dataclasses.replace(short, count=3 * short.count)
        assert len(long) == 120 and renders(long)[:40] == renders(short) and len(set(map(str, renders(long)))) == 120
    assert short.grid == {"pings": (1, 2)} and set(short.draws) == {"rays"} and (short.seeds, short.fixed) == (1, {})


def test_renders_of_one_scene_are_samples(plan):
    with pytest.raises(ValueError, match="give samples"):
        plan('scene = "scene.xml"\nrenders = 3')


@pytest.fixture
def sweep(place, monkeypatch):
    """Run a plan by a pool that renders nothing."""
    def start(folder, text=SCENES + SPLIT, **options):
        (place / "plan.toml").write_text(text, encoding="utf-8")
        monkeypatch.setattr(execute, "Local", lambda *_: Pool({}))
        return run(place / "plan.toml", place / folder, **options)
    return start


def test_parts_merge_resume_and_manifest_work_with_scenes(sweep, place):
    outcome = sweep("whole")
    assert (outcome.done, outcome.failed) == (40, 0)
    files, records = left(place / "whole")
    plan = load_plan(place / "plan.toml")
    for render in renders(plan):
        record = records[render.output]
        assert (record["scene"], record["split"], record["parameters"]) == (render.recipe.name, render.split,
                                                                           render.parameters)
    again = sweep("whole")
    assert (again.kept, again.done) == (40, 0)
    for number in (1, 2, 3):
        sweep("parts", part=Part(number=number, count=3))
    merged = merging.merge(plan, [place / "parts"])
    assert (merged.joined, merged.missing, merged.wrong, merged.twice) == (40, (), (), ())
    assert left(place / "parts") == (files, records)
    (place / "other.xml").write_text(TEXT.replace("-27", "-31"), encoding="utf-8")
    assert sweep("whole").done == 8                                 # those of the scene that changed
    assert sweep("whole", SCENES.replace("40", "50") + SPLIT).done == 10


def test_a_changed_split_moves_what_is_finished(sweep, place):
    """Without a group no parameter depends on the split, so that nothing is rendered anew."""
    text, said = 'scene = "scene.xml"\nsamples = 40\n[draw]\nrays = { integer = [1, 1000000] }\n', []

    def agree(folder):
        _, records = left(place / folder)
        return all(records[render.output].get("split") == render.split for render in
                   renders(load_plan(place / "plan.toml")))

    sweep("out", text)
    for shares in ("train = 0.8\nval = 0.2", "train = 0.5\nval = 0.5", "train = 0.8\nval = 0.2"):
        outcome = sweep("out", f"{text}[split]\n{shares}\n", say=said.append)
        assert (outcome.kept, outcome.done) == (40, 0) and agree("out")
    assert len(said) == 3 and "40 finished renders are in another subset than before" in said[0]
    assert sweep("out", text, say=said.append).done == 0 and agree("out")
    sweep("parts", text, part=Part(number=1, count=2))
    sweep("parts", f"{text}[split]\ntrain = 0.8\nval = 0.2\n", part=Part(number=2, count=2))
    assert merging.merge(place / "plan.toml", [place / "parts"]).joined == 40 and agree("parts")


def test_every_scene_is_loaded_before_a_sweep_starts(sweep, place, monkeypatch):
    class Picky(Pool):
        def submit(self, job):
            self.jobs += 1
            assert job["output"] is None
            self.trouble = {self.jobs: "fails"} if job["scene"].endswith("other.xml") else {}
            self.jobs -= 1
            return super().submit({**job, "output": "x"})

    (place / "plan.toml").write_text(SCENES, encoding="utf-8")
    (place / "whole").mkdir()
    monkeypatch.setattr(execute, "Local", lambda *_: Picky({}))
    with pytest.raises(ValueError, match="no render of plan.toml was started: no good"):
        run(place / "plan.toml", place / "whole")


def test_an_estimate_is_that_of_every_scene(plan, place, monkeypatch):
    """Scenes that take 1 s, 2 s and 4 s, at shares of 0.5, 0.3 and 0.2, take 1.9 s on average."""
    class Timed(Pool):
        def submit(self, job):
            future = super().submit(job)
            pings, other = job["parameters"]["pings"], "range" not in job["parameters"]
            future.result().update(seconds=4.0 if pings == "1" else 1.0 if other else 2.0, bytes=1000)
            return future

    monkeypatch.setattr(estimate, "Local", lambda *_: Timed({}))
    found = estimate.estimate(plan(SCENES), place / "out", processes=1)
    assert found.seconds == pytest.approx(0.5 + 0.6 + 0.8) and found.bytes == 1000
    assert [(one.name, one.missing, one.seconds) for one in found.scenes] == [("reef", 20, 1.0), ("mud", 12, 2.0),
                                                                             ("other", 8, 4.0)]


def test_one_render_of_several_scenes_is_made_alone(plan, place, monkeypatch):
    made = {}

    class Watched(Pool):
        def submit(self, job):
            made.update(job)
            return super().submit(job)

    monkeypatch.setattr(execute, "Local", lambda *_: Watched({}))
    several = plan(SCENES)
    index = next(render.index for render in renders(several) if render.recipe.name == "other")
    only(several, index, place / "one.exr")
    assert made["scene"] == str(place / "other.xml") and made["parameters"]["rays"] == str(
        several.render(index).parameters["rays"])


def test_scenes_have_rules_of_labels_of_their_own(plan, place, monkeypatch):
    rules = {}

    class Watched(Pool):
        def submit(self, job):
            rules[job["scene"]] = job["labels"]
            return super().submit(job)

    monkeypatch.setattr(execute, "Local", lambda *_: Watched({}))
    text = f'classes = ["mine"]{SCENES.replace(".exr", ".tar")}[scenes.labels]\ntile = [64, 64]\n[labels]\nwhole = true'
    several = plan(text)
    run(several, place / "out")
    assert rules == {str(place / "scene.xml"): [{"whole": True}, ("mine",)],
                     str(place / "other.xml"): [{"whole": True, "tile": [64, 64]}, ("mine",)]}
    other = next(render for render in renders(several) if render.recipe.name == "other")
    again = plan(text.replace("[64, 64]", "[32, 64]"))
    assert again.digest(again.render(other.index)) != several.digest(other)
    reef = next(render for render in renders(several) if render.recipe.name == "reef")
    assert again.digest(again.render(reef.index)) == several.digest(reef)


def homes(found, *names):
    """Subsets of every group."""
    subsets = {}
    for render in found:
        subsets.setdefault(tuple(render.parameters[name] for name in names), set()).add(render.split)
    return subsets


GROUPS = {
    "large integers": '[draw]\nrays = { integer = [1, 1000000] }',
    "few integers": '[draw]\nrays = { integer = [1, 40] }',
    "choices": '[draw]\nrays = { choice = [3, 4, 5, 6, 7], weights = [5, 1, 1, 1, 1] }',
    "numbers": '[draw]\nrays = { of = "round(1000 * range)" }\nrange = { uniform = [1, 60] }',
    "a list": '[draw]\nrange = { uniform = [1, 60] }\n[list]\nrays = [1, 2, 3, 4, 5, 1, 7, 8, 9, 10]',
    "a grid": '[draw]\nrange = { uniform = [1, 60] }\n[grid]\nrays = [1, 2, 3, 4]\npings = [1, 2]',
    "rows": '[rows]\ntable = "rows.csv"',
    "correlated": '[draw]\nrays = { integer = [1, 1000] }\nrange = { uniform = [1, 60] }\n[together]\nrange.rays = 0.9',
    "cases": '[draw]\nspeckle = { choice = [true, false] }\n'
             'rays = { when = "speckle", cases = { true = { integer = [1, 20] }, false = { integer = [15, 500] } } }',
}


@pytest.mark.parametrize("kind", GROUPS)
@pytest.mark.parametrize("seeds", ["", "seeds = 2\n"])
def test_no_group_is_in_two_subsets(plan, place, kind, seeds):
    (place / "rows.csv").write_text("rays, range\n" + "".join(f"{k}, {k + 1}\n" for k in range(1, 30)),
                                    encoding="utf-8")
    found = renders(plan(f'scene = "scene.xml"\nsamples = 300\n{seeds}{GROUPS[kind]}{SPLIT}'))
    assert all(len(subsets) == 1 for subsets in homes(found, "rays").values())
    assert {render.split for render in found} == set(SUBSETS)
    shares = Counter(render.split for render in found)
    if kind not in ("a list", "a grid"):               # where groups are drawn, shares are exact
        assert shares == {"train": 0.7 * len(found), "val": 0.2 * len(found), "test": 0.1 * len(found)}


def test_no_seabed_is_in_two_subsets_of_several_scenes(plan):
    found = renders(plan(SCENES.replace("[1, 1000000]", "[1, 2000]").replace("40", "3000") + SPLIT))
    assert all(len(subsets) == 1 for subsets in homes(found, "rays").values())
    assert Counter((render.recipe.name, render.split) for render in found) == {
        (name, subset): round(3000 * share * part) for name, share in (("reef", 0.5), ("mud", 0.3), ("other", 0.2))
        for subset, part in (("train", 0.7), ("val", 0.2), ("test", 0.1))}


def test_groups_of_two_parameters_are_told_apart_by_both(plan):
    text = 'scene = "scene.xml"\nsamples = 40\n[draw]\nrays = { integer = [1, 5] }\n[list]\npings = [1, 2, 3]\n'
    found = renders(plan(text + SPLIT.replace('"rays"', '"rays", "pings"')))
    subsets = homes(found, "rays", "pings")
    assert len(subsets) == 15 and all(map(len, subsets.values())) and {len(one) for one in subsets.values()} == {1}


def test_without_a_group_images_are_split_and_repeated_seeds_stay_together(plan):
    text = 'scene = "scene.xml"\nsamples = 50\nseeds = 2\n[draw]\nrange = { uniform = [1, 60] }\n'
    found = renders(plan(text + SPLIT.replace('group = ["rays"]', "")))
    assert Counter(render.split for render in found) == {"train": 70, "val": 20, "test": 10}
    assert {len(subsets) for subsets in homes(found, "range").values()} == {1}
    plain = renders(plan(text))
    assert [render.parameters for render in found] == [render.parameters for render in plain]
    assert all(render.split is None for render in plain)


def test_stratified_draws_hold_in_scenes_cases_and_splits(plan):
    """Even over 2^m samples of each scene; a group that is drawn again for its subset is no longer even."""
    text = 'renders = 128\n[draw]\nrays = { integer = [1, 32], stratified = true }\n[[scenes]]\nscene = "scene.xml"\n' \
        '[[scenes]]\nscene = "other.xml"\n'
    found = renders(plan(text))
    for name in ("scene", "other"):
        counts = Counter(render.parameters["rays"] for render in found if render.recipe.name == name)
        assert set(counts.values()) == {2} and len(counts) == 32
    assert found[:20] == renders(plan(text.replace("128", "20")))
    split = renders(plan(text + SPLIT))
    assert all(len(subsets) == 1 for subsets in homes(split, "rays").values())
    assert {render.split for render in split} == set(SUBSETS)
    cases = renders(plan('scene = "scene.xml"\nsamples = 64\n[draw]\nspeckle = { choice = [true, false] }\nrays = { '
                         'when = "speckle", cases = { true = { integer = [1, 4], stratified = true }, false = 5 } }'))
    assert {render.parameters["rays"] for render in cases if render.parameters["speckle"]} == {1, 2, 3, 4}


def test_a_split_names_files(plan):
    found = renders(plan(f'output = "{{split}}/{{index}}.exr"{SCENES.replace("output", "#")}{SPLIT}'))
    assert all(render.output == f"{render.split}/{render.index}.exr" for render in found)


@pytest.mark.parametrize("old, new, part", [
    ("0.7", "0.6", r"\[split\] add up to 0.9"), ("train = 0.7", "trian = 0.7", 'did you mean "train"'),
    ("0.7", "-0.7", "split.train is -0.7"), ("0.7", '"x"', "split.train is 'x'; give a number"),
    ('["rays"]', '["ray"]', 'did you mean "rays"'), ('["rays"]', '"rays"', "split.group is 'rays'; give a list"),
    ('["rays"]', '["range"]', "no parameter of the scene reef"),
])
def test_wrong_splits_are_refused_in_a_sentence(plan, old, new, part):
    with pytest.raises(ValueError, match=part) as refusal:
        plan(SCENES + SPLIT.replace(old, new))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("values", ['[draw]\nrays = { choice = [3, 4] }', '[grid]\nrays = [3, 4, 3]'])
def test_too_few_groups_for_all_subsets_are_refused(plan, values):
    with pytest.raises(ValueError, match="split.group has 2 different values of rays .*; give more values"):
        plan(f'scene = "scene.xml"\n{values}{SPLIT}')


@pytest.mark.parametrize("values", ["round(0 * range)", "round(range / 60)"])
def test_drawn_groups_of_too_few_values_are_refused(plan, values):
    with pytest.raises(ValueError, match=r"so few different values of rays in the scene scene that none is for \w+;"):
        plan(f'scene = "scene.xml"\nsamples = 100\n[draw]\nrange = {{ uniform = [1, 60] }}\n'
             f'rays = {{ of = "{values}" }}{SPLIT}')


def test_a_group_is_one_however_it_is_written(plan):
    """Also if one scene is given what is another one's default."""
    text = 'renders = 400\n[draw]\nrays = {{ integer = [1, 60] }}\n[[scenes]]\nname = "a"\nscene = "scene.xml"\n{}' \
        '[[scenes]]\nname = "b"\nscene = "scene.xml"\n{}'
    default = float(plan('scene = "scene.xml"\n').inputs.defaults()["range"])
    given = text.format("", f"[scenes.set]\nrange = {default}\n") + SPLIT.replace('"rays"', '"rays", "range"')
    assert {len(subsets) for subsets in homes(renders(plan(given)), "rays").values()} == {1}
    grids = ("[scenes.grid]\nrange = [30, 40, 50]\n", "[scenes.grid]\nrange = [30.0, 40.0, 50.0]\n")
    found = renders(plan(text.format(*grids) + SPLIT.replace("rays", "range")))
    assert {len(subsets) for subsets in homes(found, "range").values()} == {1}
    assert {str(render.parameters["range"]) for render in found} == {"30", "40", "50", "30.0", "40.0", "50.0"}


def test_redraw_does_not_move_a_render_to_another_subset(plan):
    with pytest.raises(ValueError, match="redraw names rays, which decides on the subset"):
        plan(f'scene = "scene.xml"\nredraw = ["rays"]\n[draw]\nrays = {{ integer = [1, 100000] }}{SPLIT}')


def test_a_plan_of_a_million_renders_loads_and_resumes_in_seconds(place, plan, monkeypatch):
    """CPU seconds of reading the plan, and of its state with nothing there and with every second render.

    Some 3 s were measured, with the entries; drawing the parameters of all renders would take 40.
    """
    text = SCENES.replace("renders = 40", "renders = 1000000").replace('"{scene}_', '"{split}/{scene}/') + SPLIT
    begin = time.process_time()
    large = plan(text.replace("{index:04}", "{index:07}"))
    assert len(execute._folders(large, "out")) == 9 and large.render(999_999).split in SUBSETS
    assert len(execute.standing(large, str(place / "out"), {}, {}).missing) == 1_000_000
    monkeypatch.setattr(execute, "_is_there", lambda *_: True)
    digest, made_by = large.digests(), versions()
    inputs = {recipe.name: digest(render) for render in map(large.render, range(20)) for recipe in [render.recipe]}
    stamp = stamp_of(large.stamp, made_by)
    entries = {str(index): ManifestEntry(key=b"", status="ok", bytes=1, preview=None, seconds=1.0, index=index,
                                         inputs=inputs[large.turn(index)[0].name], stamp=stamp)
               for index in range(0, 1_000_000, 2)}
    state = execute.standing(large, str(place / "out"), entries, made_by)
    assert len(state.missing) == len(state.finished) == 500_000
    assert time.process_time() - begin < 10
