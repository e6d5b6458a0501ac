"""A sweep of a synthetic aperture, from its plan to labels: focused images with their truth."""
import json

import numpy as np
import pytest
from PIL import Image
from strip_with_a_crate import TEXT

import mitsonar
from mitsonar.cli import main as cli
from mitsonar.synthetic_aperture.record import check_image

PLAN = """
scene = "strip.xml"
output = "{index}_{bed_seed}.exr"
seeds = 2
[grid]
bed_seed = [1, 2]
"""


@pytest.mark.slow
def test_a_sweep_of_focused_images_is_labelled_and_split_by_its_seabeds(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "strip.xml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    assert cli.main(["sweep", "plan.toml", "--processes", "1"]) == 0
    assert capfd.readouterr().out.startswith("4 renders: 4 rendered")
    images = mitsonar.dataset.open("plan")
    assert list(images.names) == ["0_1", "1_2", "2_1", "3_2"] and images.object_classes == ("crate",)
    assert images.parameters["bed_seed"].tolist() == [1, 2, 1, 2] and len(set(images.seeds)) == 4
    beds = images.seabeds
    assert beds[0] == beds[2] != beds[1] == beds[3]
    levels = images.stack("level")["level"]
    assert len({level.tobytes() for level in levels}) == 4
    for image in images:
        check_image(image)
        crate = next(number for number, name in image.attrs["labels"].items() if name == "crate")
        assert (image["label"] == int(crate)).sum() > 50 and (image["object_shadow"] == int(crate)).sum() > 50
    assert cli.main(["labels", "plan", "-o", "out", "--coco", "--masks", "--split", "train=0.5,val=0.5"]) == 0
    subsets = json.loads((tmp_path / "out/split.json").read_text())["images"]
    assert sorted(map(sorted, subsets.values())) == [["0_1.png", "2_1.png"], ["1_2.png", "3_2.png"]]
    lit, dark = (np.array(Image.open(tmp_path / f"out/masks/{kind}/0_1.png")) for kind in ("instance", "shadow"))
    assert np.nonzero(lit)[1].mean() < np.nonzero(dark)[1].mean()                # the shadow lies behind, on the right
