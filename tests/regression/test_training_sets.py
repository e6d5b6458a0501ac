"""The plans of a set to take away: their renders load, differ, and give pictures with labels of the plan's classes."""
import io
import json
import random
import tarfile
from collections import Counter

import pytest

import mitsonar
from mitsonar.labels.samples import write_sample
from mitsonar.scene.protocols import strewn_shape
from mitsonar.sweep import load_plan
from mitsonar.sweep.products import sample_rules

COARSE = {"bed_spacing": 0.3, "ripple_wavelength": 2}
TINY = {"mines_and_wrecks": {"pings": 48, "rays": 8000, "bins": 200, "mines": 4, "range": 30, **COARSE},
        "divers_and_boxes": {"elements": 24, "beams": 48, "bandwidth_khz": 12, "cell": 0.09, "clutter": 5, **COARSE},
        "focused_targets": {"pings": 4, "cell": 0.12, "image_spacing": 0.06, "mines": 3, "ripple_wavelength": 0.8}}
REDRAWS = 20                       # of a sweep


def loaded(plan, number):
    """Load a render's scene as a sweep does; return it with the parameters that were not refused."""
    for redrawn in range(REDRAWS + 1):
        parameters = plan.render(number, redrawn).parameters
        try:
            return mitsonar.load_file(plan.scene, **parameters), parameters
        except ValueError as error:
            refused = error
    raise refused


@pytest.mark.parametrize("name", TINY)
def test_a_plan_makes_a_thousand_pictures_of_different_fields(name):
    plan = load_plan(name)
    drawn = [plan.render(number).parameters for number in range(len(plan))]
    assert 1000 <= len(plan) <= 1100
    # seeds of a million: a thousand have at most a few in common
    assert len({each["bed_seed"] for each in drawn}) > 990 and len({each["target_seed"] for each in drawn}) > 990
    # every sonar sees every kind of bed equally often
    kinds = Counter((each["preset"], each["sand_db"]) for each in drawn)
    assert len(set(kinds.values())) == 1 and len(kinds) == 8 * len(plan.grid["preset"])


@pytest.mark.parametrize("name", TINY)
def test_renders_of_a_plan_load_with_targets_of_its_classes(variant, name):
    plan = load_plan(name)
    numbers = [0, len(plan) - 1, *random.Random(1).sample(range(len(plan)), 2)]
    placed = []
    for number in numbers:
        scene, _ = loaded(plan, number)
        placed.append([target["species"] for shape in scene.shapes() if (strewn := strewn_shape(shape)) is not None
                       for target in strewn.placed.values()])
    assert len({len(each) for each in placed}) > 1
    negatives = set(plan.labels["negatives"])
    assert {species for each in placed for species in each} <= negatives | set(plan.classes)
    assert not negatives & set(plan.classes)


@pytest.mark.parametrize("name", TINY)
def test_beds_and_numbers_of_mines_are_in_every_subset_and_no_bed_in_two(name):
    plan = load_plan(name)
    renders = [plan.render(number) for number in range(len(plan))]
    of_bed = {}
    for render in renders:
        of_bed.setdefault(render.parameters["bed_seed"], set()).add(render.split)
    assert {len(subsets) for subsets in of_bed.values()} == {1}
    counts = Counter(render.split for render in renders)
    for subset, share in (("train", 0.7), ("val", 0.1), ("test", 0.2)):
        assert abs(counts[subset] - share * len(plan)) <= 1
        assert len({render.parameters["sand_db"] for render in renders if render.split == subset}) == 8
        assert {render.parameters["mines"] for render in renders if render.split == subset} == \
            {render.parameters["mines"] for render in renders}


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", TINY)
def test_a_tiny_picture_of_a_plan_has_labelled_targets(variant, name):
    plan = load_plan(name)
    _, parameters = loaded(plan, 3)
    record = mitsonar.render(mitsonar.load_file(plan.scene, **{**parameters, **TINY[name]}), seed=1)
    held = io.BytesIO()
    assert write_sample(record, held, "0003", sample_rules({**plan.labels, "smallest": 1}, plan.classes)).pictures == 1
    held.seek(0)
    with tarfile.open(fileobj=held) as tar:
        name, = (name for name in tar.getnames() if name.endswith(".json"))
        told = json.loads(tar.extractfile(name).read())
    assert told["annotations"] and sum(told["counts"].values()) == len(told["annotations"])
