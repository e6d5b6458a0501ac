"""Pictures of every kind of sonar with a recorder: their counts, and what is made of them."""
import functools
import json

import numpy as np
import pytest
from numbered_scenes import KINDS, numbered
from PIL import Image

import mitsonar
from mitsonar import plots
from mitsonar.dataset.labels.writing import write as write_labels
from mitsonar.imaging import recorded_levels
from mitsonar.io.records import exr
from mitsonar.io.xtf import xtf
from mitsonar.io.xtf.amplitudes import read_amplitudes
from mitsonar.labels.rules import Labels
from mitsonar.sonar.preset_tables import recorders

RECORDED = tuple(kind for kind in KINDS if kind != "synthetic_aperture")       # whose echoes are focused, not shown
OF = {"array_sonar": "imaging_8bit"}                                           # the one without presets
FANS = "forward_looking", "multibeam", "array_sonar"
every_kind = pytest.mark.parametrize("kind", RECORDED)


def scene(kind, **written):
    return numbered(kind, np.random.default_rng(7), **{"recorder": OF[kind]} if kind in OF else {}, **written)


@functools.cache
def rendered(kind):
    return mitsonar.render(scene(kind, pings=2), seed=4)


@every_kind
def test_every_preset_has_a_recorder_that_leaves_levels_alone(kind):
    picture = rendered(kind)
    plain = mitsonar.render(numbered(kind, np.random.default_rng(7), recorder="none", pings=2), seed=4)
    assert "recorded" not in plain and "recorder" not in plain.attrs
    assert np.array_equal(plain["level"].values, picture["level"].values)
    assert picture["recorded"].dims == picture["level"].dims


@every_kind
def test_counts_of_every_kind_follow_the_levels(kind):
    """Where an echo is clear of noise, line and floor, and below full scale, its count leads back to its level.

    Beams between formed ones mix neighbours: medians lie within 1 dB. A sidescan's peak detector writes the highest
    power of some 2 to 4 independent samples of a bin, 10 log(1 + 1/2 + ... 1/n) = 1.8 to 3.2 dB above the mean.
    """
    picture = rendered(kind)
    settings, counts = picture.attrs["recorder"], picture["recorded"].values.astype(float)
    clear = (counts > counts.max() / 10) & (counts < 2 ** settings["bits"] - 1) & (picture["time"].values > 2e-3)
    assert clear.sum() > 20
    error = (recorded_levels(picture) - picture["level"]).values[clear]
    above = 2.5 if kind == "sidescan" else 0.0
    assert np.median(error) == pytest.approx(above, abs=1.0)


@pytest.mark.parametrize("kind", FANS)
def test_frames_have_the_counts_of_the_whole(kind):
    frames = [frame["recorded"].values[0] for frame in mitsonar.frames(scene(kind, pings=2), seed=4)]
    assert np.array_equal(frames, rendered(kind)["recorded"].values)


@every_kind
def test_counts_are_read_back_as_they_were_written(kind, tmp_path):
    picture = rendered(kind)
    exr.write(picture, tmp_path / "picture.exr")
    found = mitsonar.read(tmp_path / "picture.exr")
    assert found["recorded"].identical(picture["recorded"]) and found.attrs["recorder"] == picture.attrs["recorder"]
    assert np.array_equal(recorded_levels(found).values, recorded_levels(picture).values)


@every_kind
def test_a_plot_shows_counts(kind, tmp_path):
    plots.plot(rendered(kind), None, tmp_path / "counts.png", tvg="counts")
    plots.plot(rendered(kind), None, tmp_path / "levels.png", tvg=None)
    assert (tmp_path / "counts.png").read_bytes() != (tmp_path / "levels.png").read_bytes()


def test_an_xtf_holds_the_counts_themselves(tmp_path):
    picture = rendered("sidescan")
    written = xtf.write(picture, tmp_path / "line.xtf", tvg="counts")
    counts = picture["recorded"].values
    samples = read_amplitudes(tmp_path / "line.xtf")["amplitude"].values
    assert np.array_equal(samples[..., -counts.shape[-1]:], counts)
    level = written.scales[0].levels(counts, picture["range"].values)
    far = (picture["range"].values > 1) & (counts > 0)
    assert np.abs(level - recorded_levels(picture).values)[far].max() < 0.01


@pytest.mark.parametrize("kind", ["forward_looking", "array_sonar"])
def test_pictures_of_labels_are_counts_of_8_bits(kind, tmp_path):
    picture = rendered(kind)
    exr.write(picture, tmp_path / "fan.exr")
    write_labels(tmp_path / "fan.exr", tmp_path / "labels", Labels(coco=True, tvg="counts"))
    about = json.loads((tmp_path / "labels" / "annotations.json").read_text())["images"]
    for number, image in enumerate(about):
        grey = np.asarray(Image.open(tmp_path / "labels" / "images" / image["file_name"]))
        assert np.array_equal(np.sort(grey, None), np.sort(picture["recorded"].values[number], None))
        assert image["grey"] == "count [1]"


def test_what_cannot_hold_counts_says_so(tmp_path):
    picture = rendered("sidescan")
    with pytest.raises(ValueError, match="holds no recorded counts"):
        plots.plot(picture.drop_vars("recorded"), None, tmp_path / "none.png", tvg="counts")
    rooted = picture.assign_attrs(recorder={**picture.attrs["recorder"], "law": "root"})
    with pytest.raises(ValueError, match="these counts are root"):
        xtf.write(rooted, tmp_path / "none.xtf", tvg="counts")
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("written, words", [
    ({"recorder": "tape"}, "one of"), ({"recorder_bits": 25}, "at most 24"),
    ({"recorder_low_pass": 0.5}, "at most 0.33"),
    ({"recorder_tvg_start": 5.0, "recorder_tvg_end": 4.0}, "ends at 4 m"),
    ({"recorder_lost": 0.8, "recorder_repeated": 0.4}, "shares of 0.8 lost"),
    ({"recorder": "none", "recorder_tvg": 30.0}, "recorder_tvg is given, but the recorder is none"),
    ({"adc_bits": 8, "recorder_bits": 8}, "adc_bits is an earlier name of recorder_bits")])
def test_a_scene_with_an_impossible_recorder_is_refused(written, words):
    with pytest.raises((RuntimeError, ValueError)) as caught:
        scene("sidescan", **written)
    assert words in str(caught.value)


def test_earlier_names_are_read():
    old = scene("sidescan", adc_bits=8, full_scale_db=140.0, ringing_ms=1.0).sensors()[0].recorder
    new = scene("sidescan", recorder_bits=8, recorder_full_scale_db=140.0,
                recorder_ringing_ms=1.0).sensors()[0].recorder
    assert old == new and old.converter.bits == 8 and old.converter.full_scale_db == 140.0
    assert scene("sidescan", adc_bits=0).sensors()[0].recorder is None


def test_classes_of_recorders_have_the_same_values():
    table = recorders()
    assert all(set(values) == set(table["none"]) for values in table.values())
