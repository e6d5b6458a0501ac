"""Detectors of a set are scored as they say, and find squares in noise; a sheet of the set outlines these."""
import importlib.util
import io
import json
import tarfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

ROOT = Path(__file__).resolve().parents[2]
BOX = 12                           # pixels, of the squares


def program(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def detectors():
    return program(ROOT / "tests/benchmarks/detectors.py")


@pytest.fixture(scope="module")
def squares(tmp_path_factory):
    """A set of pictures of noise, with a bright square each and its shadow."""
    folder, rng = tmp_path_factory.mktemp("squares"), np.random.default_rng(0)
    for subset, count in (("train", 4), ("test", 2)):
        with tarfile.open(folder / f"{subset}-00000.tar", "w") as tar:
            for number in range(count):
                left, top = (int(place) for place in rng.integers(20, 100, 2))
                grey, mask = rng.rayleigh(40, (128, 160)), np.zeros((128, 160), np.uint16)
                mask[top:top + BOX, left:left + BOX] = 1
                grey[mask > 0] += 120
                grey[top:top + BOX, left + BOX:left + 3 * BOX] *= 0.1
                told = {"annotations": [{"category": "cylinder", "bbox": [left, top, BOX, BOX]},
                                        {"category": "cylinder shadow", "bbox": [left + BOX, top, 2 * BOX, BOX]}]}
                held = {"json": json.dumps(told).encode()}
                for kind, values in (("png", grey.clip(0, 255).astype(np.uint8)), ("instance.png", mask)):
                    stream = io.BytesIO()
                    Image.fromarray(values).save(stream, "png")
                    held[kind] = stream.getvalue()
                for kind, content in held.items():
                    info = tarfile.TarInfo(f"{number:04}.{kind}")
                    info.size = len(content)
                    tar.addfile(info, io.BytesIO(content))
    return folder


def test_scores_are_those_counted_by_hand(detectors):
    truth = np.array([[10, 10, 8, 8], [40, 40, 8, 8]])
    # the strongest is right, the next is no object, the third repeats the first, the weakest covers 2/3 of the other
    found = np.array([[10, 10, 8, 8], [70, 10, 8, 8], [10, 11, 8, 8], [40, 40, 8, 12]]), np.array([4.0, 3.0, 2.0, 1.0])
    precision, recalls = detectors.scores([found], [truth])
    assert precision == pytest.approx((1 / 1 + 2 / 4) / 2)
    assert recalls == pytest.approx([0.5, 0.5, 1.0])
    precision, _ = detectors.scores([found], [truth], 0.7)
    assert precision == pytest.approx(1 / 2)                # the weakest is too large now, and no box meets the other


def test_squares_in_noise_are_found(detectors, squares, capsys):
    detectors.main([str(squares)])
    told = capsys.readouterr().out
    assert "4 pictures learned from, 2 held out with 2 objects" in told
    assert "forest   overlap 0.5: AP 1.00" in told


def test_a_sheet_outlines_what_is_sought(squares, tmp_path):
    program(ROOT / "scenes/make_sheet.py").main([str(squares), "-o", str(tmp_path / "sheet.png"), "--columns", "3"])
    with Image.open(tmp_path / "sheet.png") as sheet:
        pixels = np.asarray(sheet.convert("RGB")).reshape(-1, 3)
    for colour in ((255, 150, 0), (70, 130, 255)):
        assert (pixels == colour).all(-1).sum() > 6 * 4 * BOX          # six squares, four sides each
