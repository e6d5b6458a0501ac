"""The plan of divers: its frames differ, and what it strews is seen and labelled in metres."""
import json
from pathlib import Path

import pytest

import mitsonar
from mitsonar.dataset.labels import Labels, write
from mitsonar.sweep import load_plan

SCENES = Path(__file__).resolve().parents[2] / "scenes"
TINY = {"elements": 24, "beams": 48, "bandwidth_khz": 12, "cell": 0.09, "range": 15, "bed_spacing": 0.3, "mines": "1",
        "clutter": "2", "divers": "1", "ripple_wavelength": 1.5,
        "sonar_z": -9, "swimmer_z": -10, "swimmer_bearing_deg": 20, "tilt_deg": 10}


def test_the_plan_makes_200_frames_of_different_fields():
    plan = load_plan("divers")
    drawn = [plan.render(number).parameters for number in range(len(plan))]
    assert len(plan) == 200 and len({str(each) for each in drawn}) == 200
    assert len({each["target_seed"] for each in drawn}) > 195
    # below the sonar's water line and above the bed, wherever the swimmer is
    assert all(-12 < each["swimmer_z"] < -8 and -12 < each["sonar_z"] < 0 for each in drawn)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two frames as the plan draws them, but tiny."""
    folder = tmp_path_factory.mktemp("divers")
    plan = load_plan("divers")
    for number in (0, 1):
        parameters = {**plan.render(number).parameters, **TINY, "swimmer_range": 6 + 2 * number}
        scene = mitsonar.load_file(plan.scene, **parameters)
        mitsonar.write(mitsonar.render(scene, seed=number), folder / f"{number}.exr")
    return folder


@pytest.mark.filterwarnings("ignore:no ping sees")
def test_frames_show_divers_among_mines_and_clutter(variant, folder):
    files = sorted(folder.glob("*.exr"))
    images = mitsonar.dataset.open(files, form="cartesian", cell=0.1)
    assert len(images) == 2 and "diver" in images.object_classes and len(images.object_classes) >= 3
    assert len(set(images.seabeds)) == 2
    write(files, folder / "labels", Labels(coco=True, form="cartesian", cell=0.1, smallest=2))
    told = json.loads((folder / "labels/annotations.json").read_text())
    numbers = {category["name"]: category["id"] for category in told["categories"]}
    divers = [each for each in told["annotations"] if each["category_id"] == numbers["diver"]]
    assert {each["image_id"] for each in divers} == {1, 2}
    for image, away in zip(told["images"], (6, 8), strict=True):
        swimmer, = (each for each in divers if each["image_id"] == image["id"] and each["instance"] == "diver.swimmer")
        left, upper, width, height = swimmer["bbox"]
        x = image["left"] + image["cell_x"] * (left + width / 2)
        y = image["top"] + image["cell_y"] * (upper + height / 2)
        # a level range of 6 or 8 m, 20 degrees to starboard; the diver is 2.5 m long, beams are 5 degrees wide
        assert x == pytest.approx(away * 0.342, abs=1.3) and y == pytest.approx(away * 0.94, abs=1.3)
