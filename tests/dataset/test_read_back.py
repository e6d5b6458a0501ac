"""Labels and shards opened by the libraries that people train with: each finds what was written, and nothing else."""
import contextlib
import io

import numpy as np
import pytest
from labelled_sidescan import labelled
from PIL import Image

from mitsonar.dataset.labels import Labels, write
from mitsonar.io.records import exr
from mitsonar.labels.polygons import polygons
from mitsonar.labels.samples import SampleRules, write_sample

CLASSES = ["box", "wreck"]
HOLED = [("highlight", "box.1", 1, 10, 40, 30, 70), ("highlight", "wreck", 1, 20, 30, 45, 55),
         ("shadow", "box.1", 1, 15, 35, 70, 90)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """COCO, YOLO and masks of three images; the second object of the last lies within a hole of the first."""
    folder = tmp_path_factory.mktemp("labels")
    for number in range(3):
        exr.write(labelled(seed=number, seabed="abc"[number], **({"rectangles": HOLED} if number == 2 else {})),
                  folder / f"i{number}.exr")
    with pytest.warns(UserWarning, match="training images cannot validate"):
        write(sorted(folder.glob("*.exr")), folder / "out", Labels(coco=True, yolo="polygons", masks=True))
    return folder / "out"


@pytest.fixture(scope="module")
def shard(tmp_path_factory):
    """A shard of four samples, and the records in it."""
    path = tmp_path_factory.mktemp("set") / "train-00000.tar"
    rules = SampleRules(labels=Labels(coco=True, yolo="boxes", masks=True, classes=CLASSES), arrays=("level",))
    with open(path, "wb") as stream:
        records = [labelled(seed=7)]
        write_sample(records[0], stream, "000000", rules)
    return path


def quietly(work, *args):
    with contextlib.redirect_stdout(io.StringIO()):
        return work(*args)


def mask(folder, kind, image):
    return np.array(Image.open(folder / "masks" / kind / image["file_name"].replace("images/", "")))


def test_pycocotools_fills_polygons_to_the_masks(folder):
    coco = quietly(pytest.importorskip("pycocotools.coco").COCO, str(folder / "annotations.json"))
    assert len(coco.anns) == 4 + 4 + 3
    for image in coco.imgs.values():
        for kind, masks in (("highlight", "class"), ("shadow", "shadow")):
            filled = np.zeros((image["height"], image["width"]), int)
            for entry in coco.loadAnns(coco.getAnnIds(imgIds=image["id"])):
                if coco.cats[entry["category_id"]]["supercategory"] == kind:
                    one = coco.annToMask(entry)
                    assert one.sum() == entry["area"] and not filled[one > 0].any()
                    filled[one > 0] = entry["category_id"] if kind == "highlight" else 1
            written = mask(folder, masks, image)
            assert (filled == (written if kind == "highlight" else written > 0)).all() and filled.any()


def test_pycocotools_fills_any_mask():
    tools, rng = pytest.importorskip("pycocotools.mask"), np.random.default_rng(0)
    for _ in range(300):
        drawn = rng.random(rng.integers(1, 14, 2)) < rng.uniform(0.2, 0.95)
        rings = [ring.ravel().tolist() for ring in polygons(drawn)]
        filled = tools.decode(tools.merge(tools.frPyObjects(rings, *drawn.shape))) if rings else np.zeros(drawn.shape)
        assert (filled == drawn).all()


@pytest.mark.parametrize("kind", ["bbox", "segm"])
def test_the_truth_scores_one_against_itself(folder, kind):
    module = pytest.importorskip("pycocotools.cocoeval")
    truth = quietly(pytest.importorskip("pycocotools.coco").COCO, str(folder / "annotations.json"))
    found = [{"image_id": entry["image_id"], "category_id": entry["category_id"], "score": 0.9,
              **({"bbox": entry["bbox"]} if kind == "bbox" else {"segmentation": truth.annToRLE(entry)})}
             for entry in truth.anns.values()]
    scores = module.COCOeval(truth, quietly(truth.loadRes, found), kind)
    for work in (scores.evaluate, scores.accumulate, scores.summarize):
        quietly(work)
    assert scores.stats[0] == pytest.approx(1.0) and scores.stats[8] == pytest.approx(1.0)


def test_torchvision_reads_and_draws_them(folder):
    pytest.importorskip("pycocotools.coco")
    torchvision = pytest.importorskip("torchvision")
    from torchvision.transforms import v2

    plain = quietly(torchvision.datasets.CocoDetection, str(folder / "images"), str(folder / "annotations.json"))
    wrapped = torchvision.datasets.wrap_dataset_for_transforms_v2(plain, target_keys=("boxes", "labels", "masks"))
    assert len(wrapped) == 3
    for number in range(3):
        picture, target = wrapped[number]
        entries = plain[number][1]
        image = v2.functional.pil_to_tensor(picture)
        assert target["masks"].shape == (len(entries), *image.shape[1:])
        assert target["masks"].sum((1, 2)).tolist() == [entry["area"] for entry in entries]
        around = torchvision.ops.masks_to_boxes(target["masks"]).numpy() + [0, 0, 1, 1]
        assert (target["boxes"].numpy() == around).all()
        drawn = torchvision.utils.draw_bounding_boxes(image, target["boxes"], colors="red")
        assert drawn.shape[0] == 3 and (drawn[0] != drawn[1]).any()
    turned, target = v2.Compose([v2.ToImage(), v2.RandomHorizontalFlip(1.0)])(*wrapped[2])
    assert (torchvision.ops.masks_to_boxes(target["masks"]).numpy() + [0, 0, 1, 1] == target["boxes"].numpy()).all()


def test_the_pairs_of_detectors_are_what_torchvision_trains_on(folder):
    torchvision, torch = pytest.importorskip("torchvision"), pytest.importorskip("torch")
    import mitsonar

    images = mitsonar.dataset.open(sorted(folder.parent.glob("*.exr")))
    image, target = images.torch(target="boxes")[0]
    drawn = torchvision.utils.draw_segmentation_masks(torch.zeros((3, *image.shape[1:]), dtype=torch.uint8),
                                                      target["masks"].bool(), colors=["red", "blue"])
    assert (drawn.any(0) == target["masks"].any(0)).all()
    torch.manual_seed(0)
    detector = torchvision.models.detection.fasterrcnn_mobilenet_v3_large_320_fpn(weights=None, weights_backbone=None,
                                                                                num_classes=3).train()
    losses = detector([image.expand(3, -1, -1) / 100], [target])
    assert all(torch.isfinite(loss) for loss in losses.values())


def test_webdataset_reads_a_shard(shard):
    webdataset = pytest.importorskip("webdataset")
    masks = webdataset.handle_extension("class.png", lambda content: np.array(Image.open(io.BytesIO(content))))
    one, = webdataset.WebDataset(str(shard), shardshuffle=False).decode(masks, "pil")
    assert one["__key__"] == "000000" and one["png"].size == (one["json"]["width"], one["json"]["height"])
    assert set(np.unique(one["class.png"])) == {0, 1, 2} and one["class.png"].shape == one["npz"]["level"].shape
    assert [entry["category"] for entry in one["json"]["annotations"]][:1] == ["box"] and one["txt"].startswith("0 ")


def test_datasets_reads_a_shard(shard, tmp_path, monkeypatch):
    monkeypatch.setenv("HF_HUB_OFFLINE", "1")
    datasets = pytest.importorskip("datasets")
    one, = datasets.load_dataset("webdataset", data_files=str(shard), split="train", cache_dir=str(tmp_path))
    assert one["__key__"] == "000000" and one["png"].size == (one["json"]["width"], one["json"]["height"])
    assert np.array(one["class.png"]).max() == 2 and one["json"]["counts"]["box"] == 1
