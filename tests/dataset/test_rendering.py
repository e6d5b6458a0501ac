"""A plan rendered by the workers of PyTorch's DataLoader: the images of its sweep, none of them twice."""
import itertools
import pickle
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from small_scene import spoilt

import mitsonar
from mitsonar.dataset import rendering
from mitsonar.dataset.rendered_images import rendered
from mitsonar.sweep import load_plan

CRATE = """<shape type="cube" id="crate.1"><ref id="sand"/>
    <transform name="to_world"><scale value="2"/><translate x="$x" y="0" z="-28"/></transform></shape></scene>"""
PLAN = """
scene = "scene.xml"
seed = 3
samples = {samples}
classes = ["crate", "mine"]
{head}
[set]
rays = 3000
[grid]
range = [50, 60]
[draw]
x = {{ uniform = [15, 30] }}
"""


@pytest.fixture
def plan(tmp_path):
    """Return a function that writes a plan, of a scene with a crate, and returns its path."""
    text = spoilt(("</scene>", CRATE), ('name="pings" value="2"/>', 'name="pings" value="8"/><default name="x" '
                                                                   'value="20"/>'))
    (tmp_path / "scene.xml").write_text(text)

    def written(samples=2, head="", text=PLAN):
        (tmp_path / "plan.toml").write_text(text.format(samples=samples, head=head))
        return tmp_path / "plan.toml"

    return written


def same(one, other):
    return one["level"].equals(other["level"]) and one.attrs == other.attrs


def test_an_image_is_that_of_the_sweep_and_may_lie_beyond_it(plan, tmp_path):
    shorter, longer = load_plan(plan(samples=1)), load_plan(plan(samples=2))
    given = longer.render(3)
    alone = mitsonar.render(tmp_path / "scene.xml", seed=given.seed, **given.parameters)
    assert same(rendered(longer, 3), alone) and not same(rendered(longer, 2), alone)
    assert len(shorter) == 2 and given == longer.render(3)


def test_a_refused_draw_is_drawn_again_by_the_plan_alone(plan):
    text = PLAN.replace("uniform = [15, 30]", 'choice = [20, "nowhere"]')
    once = load_plan(plan(20, text=text))
    with pytest.raises(ValueError, match="nowhere"):
        for index in range(6):
            rendered(once, index)
    again = load_plan(plan(20, head='redraw = ["x"]', text=text))
    assert all(rendered(again, index).attrs["parameters"]["x"] == "20" for index in range(6))


def test_a_plan_without_images_or_classes_is_refused(plan):
    with pytest.raises(ValueError, match="makes lines of soundings, which are no images"):
        rendering(plan(head='output = "{index}.gsf"'))
    with pytest.raises(ValueError, match="numbers classes before the first image is rendered; give classes here"):
        rendering(plan(text=PLAN.replace('classes = ["crate", "mine"]', "")))


def test_without_pytorch_a_plan_is_left_to_sweeps(plan, monkeypatch):
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "mitsonar.dataset.torch_rendering", raising=False)
    with pytest.raises(ImportError, match="run pip install .mitsonar.torch.., or render files"):
        rendering(plan())


@pytest.fixture
def torch():
    return pytest.importorskip("torch")


def test_pairs_are_those_of_files(plan, torch, tmp_path):
    mitsonar.sweep.run(plan(), tmp_path / "files", processes=1)
    files = mitsonar.dataset.open(tmp_path / "files")
    for target in ("class", "boxes", "label", None):
        drawn = list(rendering(plan(), shuffle=False, classes=files.classes if target == "class" else None,
                               target=target))
        expected = files.torch(target=target)
        assert len(drawn) == len(expected) == 4
        for one, other in zip(drawn, (expected[number] for number in range(4)), strict=True):
            one, other = (pair if target else (pair, torch.zeros(1)) for pair in (one, other))
            assert torch.equal(one[0], other[0])
            for name in ("boxes", "labels", "masks") if target == "boxes" else (slice(None),):
                assert torch.equal(one[1][name], other[1][name])
    assert torch.unique(next(iter(rendering(plan())))[1]).tolist() == [0, 1]


def test_rules_of_the_plan_and_transforms_hold(plan, torch):
    output = 'output = "{index}.tar"'
    few = rendering(plan(head=output + "\n[labels]\nsmallest = 100000"), target="boxes")
    assert not any(len(target["boxes"]) for _, target in few)
    for more, number in (("", []), ('negative_class = "clutter"', [2])):
        clutter = plan(head=f'{output}\n[labels]\nnegatives = ["crate"]\n{more}', text=PLAN.replace('"crate", ', ""))
        for target in ("boxes", "class"):
            shown = next(iter(rendering(clutter, target=target)))[1]
            assert (shown["labels"].tolist() if target == "boxes" else shown.unique().tolist()[1:]) == number
    data = rendering(plan(head=output), target="boxes", transform=lambda image, target: len(target["boxes"]))
    assert list(data) == [1, 1, 1, 1]


def numbers(image):
    """Return the seed of an image, which no other image has."""
    return image.attrs["seed"]


@pytest.mark.slow
def test_no_image_comes_twice_across_workers_and_epochs(plan, torch):
    data = rendering(plan(samples=3), image=numbers, target=None)
    loader = torch.utils.data.DataLoader(data, batch_size=None, num_workers=2, multiprocessing_context="spawn",
                                         persistent_workers=True)
    seen = [list(loader), list(loader), list(data)]
    single = torch.utils.data.DataLoader(data, batch_size=None, num_workers=1, multiprocessing_context="spawn")
    seen.append(list(single))
    beyond = load_plan(plan(samples=12))
    assert [len(epoch) for epoch in seen] == [6] * 4 and len(loader) == 6
    assert [set(epoch) for epoch in seen] == [{beyond.render(index).seed for index in range(first, first + 6)}
                                              for first in range(0, 24, 6)]
    data.set_epoch(1)
    assert set(data) == set(seen[1])


def test_all_workers_begin_at_one_epoch_even_if_there_were_fewer_before(plan, torch, monkeypatch):
    data = rendering(plan(), target=None)
    monkeypatch.setattr(data, "_set_threads", lambda workers: None)
    monkeypatch.setattr(data, "_images", lambda worker, workers, state: iter([state["epoch"]]))
    epochs = [next(iter(data))]                        # a look at the first image, in this process
    for seed, workers in ((100, 3), (200, 1), (300, 5)):
        for worker in range(workers):
            monkeypatch.setattr(data, "_begun", 1)     # each has a copy of its own
            monkeypatch.setattr(torch.utils.data, "get_worker_info", lambda: SimpleNamespace(
                id=worker, num_workers=workers, seed=seed + worker))
            epochs.append(next(iter(data)))
    assert epochs == [0, 1, 1, 1, 2, 3, 3, 3, 3, 3]


@pytest.mark.slow
def test_torchdata_resumes_in_the_middle_of_an_epoch(plan, torch):
    loading = pytest.importorskip("torchdata.stateful_dataloader").StatefulDataLoader

    def loader():
        data = rendering(plan(samples=4), image=numbers, target=None)
        return loading(data, batch_size=None, num_workers=2, multiprocessing_context="spawn")

    stopped = loader()
    images = iter(stopped)
    first = [next(images) for _ in range(3)]
    state, rest = stopped.state_dict(), list(images)
    resumed = loader()
    resumed.load_state_dict(state)
    assert list(resumed) == rest and len({*first, *rest}) == 8


def test_ranks_and_workers_part_every_epoch_evenly(plan, torch):
    ranks = [rendering(plan(samples=5), rank=rank, world_size=3) for rank in range(3)]
    for epoch in range(3):
        shares = [np.concatenate([data.share(epoch, worker, 2) for worker in range(2)]) for data in ranks]
        assert [len(share) for share in shares] == [3] * 3 == [len(data) for data in ranks]
        mixed = np.concatenate(shares)
        assert len(set(mixed)) == 9 and set(mixed // 10) == {epoch}
    with pytest.raises(ValueError, match="the rank is 3 of 3 processes; give one from 0 to 2"):
        rendering(plan(), rank=3, world_size=3)
    with pytest.raises(ValueError, match="makes 4 renders, fewer than the 5 processes"):
        rendering(plan(), rank=0, world_size=5)


def test_a_subset_has_the_renders_of_the_split_alone(plan, torch):
    shares = "[split]\ntrain = 0.75\ntest = 0.25\n"
    longer = load_plan(plan(samples=30, text=PLAN + shares))
    path = plan(samples=10, text=PLAN + shares)
    for subset, count in (("train", 15), ("test", 5)):
        data = rendering(path, subset=subset)
        assert len(data) == count
        epochs = [data.share(epoch, 0, 1) for epoch in range(3)]
        assert {longer.render(int(index)).split for share in epochs for index in share} == {subset}
        assert len(set(np.concatenate(epochs))) == sum(map(len, epochs)) and list(epochs[0]) != sorted(epochs[0])
    with pytest.raises(ValueError, match=r"'val' was asked for, but \[split\] of .* has train, test; give"):
        rendering(path, subset="val")


def test_an_endless_set_goes_on_and_a_stopped_one_begins_where_it_was(plan, torch):
    data = rendering(plan(samples=1), image=numbers, target=None, endless=True)
    first = list(itertools.islice(data, 5))
    assert len(set(first)) == 5
    with pytest.raises(TypeError, match="the number of images is not known: they are endless"):
        len(data)
    fresh = rendering(plan(samples=1), image=numbers, target=None, endless=True)
    images = iter(fresh)
    assert [next(images) for _ in range(3)] == first[:3]
    resumed = rendering(plan(samples=1), image=numbers, target=None, endless=True)
    resumed.load_state_dict(fresh.state_dict())
    assert list(itertools.islice(resumed, 2)) == first[3:]
    for x in ("", 'x = {{ of = "range / 2" }}'):       # what is computed is drawn no more than what is given
        with pytest.raises(ValueError, match="every epoch after the first would repeat its images"):
            rendering(plan(1, head="seeds = [1, 2]", text=PLAN.replace("x = {{ uniform = [15, 30] }}", x)),
                      endless=True)


def test_renders_that_fail_are_left_out_and_many_of_them_end_it(plan, torch):
    text = PLAN.replace("uniform = [15, 30]", 'choice = [20, "nowhere"]')
    data = rendering(plan(3, text=text), image=numbers, target=None)
    with pytest.warns(UserWarning, match=r"render \d of .*plan.toml is left out: .*nowhere"):
        assert 0 < len(list(data)) < 6
    never = rendering(plan(30, text=text.replace("20, ", "")), target=None)
    with pytest.warns(UserWarning), pytest.raises(ValueError, match="20 renders of .* failed one after the other"):
        next(iter(never))


def test_classes_to_learn_may_be_some_but_those_of_the_plan_are_all(plan, torch):
    for target, nothing in (("class", lambda mask: not mask.any()), ("boxes", lambda boxes: not len(boxes["boxes"]))):
        assert all(nothing(one) for _, one in rendering(plan(), classes=["mine"], target=target))
    lacking = rendering(plan(text=PLAN.replace('"crate", ', "")))
    with pytest.raises(ValueError, match="has objects of the class crate, which the plan's classes lack"):
        next(iter(lacking))


def test_a_worker_reads_the_plan_again_unless_it_has_changed(plan, torch):
    data = rendering(plan(), image=numbers, target=None)
    copy = pickle.loads(pickle.dumps(data))
    assert list(copy) == list(data)
    held = pickle.dumps(data)
    plan(samples=3)
    for worker in (False, True):                       # a worker passes it on instead of ending in a traceback
        changed = torch.utils.data.DataLoader(data, batch_size=None, num_workers=1, multiprocessing_context="spawn")
        with pytest.raises(ValueError, match="plan.toml was changed since the data set was made"):
            next(iter(changed if worker else pickle.loads(held)))
