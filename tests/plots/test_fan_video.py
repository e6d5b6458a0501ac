"""Pings as a video: a frame each, one dynamic range for all, memory that does not grow, nothing left of what fails."""
import stat
import sys
import tracemalloc

import numpy as np
import pytest
import xarray as xr
from PIL import Image

import mitsonar
from mitsonar import plots
from mitsonar.plots.fans import fan_sheet


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """Small pictures: what is asked here does not hang upon their size."""
    monkeypatch.setattr(fan_sheet, "SIZE", 300)


def record(pings=3, beams=21, ranges=40, louder=0.0, apart=0.25):
    """Pings of an even fan, each 6 dB louder than the one before."""
    angle = np.deg2rad(np.linspace(-50, 50, beams))
    level = 60 + louder + 6 * np.arange(pings)[:, None, None] + np.sin(np.arange(ranges)) + np.zeros((1, beams, 1))
    return xr.Dataset(
        {"level": (("ping", "beam", "range"), level.astype(np.float32))},
        {"ping": np.arange(pings), "ping_time": ("ping", apart * np.arange(pings)), "beam": angle,
         "range": 2 + 0.5 * np.arange(ranges), "beam_x": ("beam", np.cos(angle)), "beam_y": ("beam", np.sin(angle)),
         "beam_z": ("beam", 0 * angle)}, {"frequency": 3e5, "sonar": "forward_looking"})


def frames_of(folder):
    return [np.asarray(Image.open(path)) for path in sorted(folder.iterdir())]


def brightness(frame):
    """Mean of the picture's middle."""
    rows, columns = frame.shape[:2]
    return frame[rows // 3:rows // 2, columns // 3:columns // 2].mean()


def test_all_frames_have_one_dynamic_range(tmp_path):
    plots.video([record(), record(1, louder=6.0)], tmp_path / "frames", tvg=None)
    frames = frames_of(tmp_path / "frames")
    assert [path.name for path in sorted((tmp_path / "frames").iterdir())] == [f"frame_{k:05d}.png" for k in range(4)]
    bright = [brightness(frame) for frame in frames]
    assert bright[0] + 10 < bright[1] and bright[1] + 10 < bright[2]
    assert bright[3] == pytest.approx(bright[1], abs=1.0)                        # the same level in another record
    assert np.array_equal(frames[1][86:], frames[3][86:])                        # but for what stands above it
    assert not np.array_equal(frames[0][:86], frames[1][:86])                    # the ping's number


def test_a_frame_is_what_plot_draws(tmp_path):
    """Drawn on a sheet whose frame was drawn once, a picture has the elements of one drawn by itself."""
    one = record(1)
    plots.video(one, tmp_path / "frames", colours="grey")
    plots.plot(one, "waterfall", tmp_path / "a.png", colours="grey")
    alone = np.asarray(Image.open(tmp_path / "a.png").convert("RGB"))
    moving = frames_of(tmp_path / "frames")[0]
    assert alone.shape == moving.shape and (np.abs(alone.astype(int) - moving).max(-1) > 8).mean() < 1e-3


def test_a_gif_holds_the_frames_at_their_pace(tmp_path):
    plots.video(record(apart=0.3), tmp_path / "a.gif")
    plots.video(record(apart=0.3), tmp_path / "frames")
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 3 and gif.info["loop"] == 0
        durations = []
        for number, wanted in enumerate(frames_of(tmp_path / "frames")):
            gif.seek(number)
            durations.append(gif.info["duration"])
            shown = np.asarray(gif.convert("RGB")).astype(int)
            assert np.abs(shown - wanted).mean() < 4
    assert sum(durations) == pytest.approx(900, abs=10)                          # ms: 1 / 0.3 s frames a second


def test_frames_are_reduced_to_a_width_and_keep_their_form(tmp_path):
    for name, width in (("whole", None), ("narrow", 120), ("wide", 5000)):
        plots.video(record(1), tmp_path / f"{name}.gif", width=width)
    whole, narrow, wide = (Image.open(tmp_path / f"{name}.gif").size for name in ("whole", "narrow", "wide"))
    assert narrow[0] == 120 < whole[0] and wide == whole
    assert narrow[1] == pytest.approx(120 * whole[1] / whole[0], abs=0.5)
    with pytest.raises(ValueError, match="the video is 20 pixels wide; give 100 or more"):
        plots.video(record(1), tmp_path / "tiny.gif", width=20)


def test_memory_does_not_grow_with_the_frames(tmp_path):
    one, peaks = record(1), []
    plots.video(one, tmp_path / "0.gif", limits=(50.0, 70.0))                    # fonts, caches
    for number in (2, 20):
        tracemalloc.start()
        plots.video([one] * number, tmp_path / f"{number}.gif", limits=(50.0, 70.0))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    size = np.asarray(Image.open(tmp_path / "2.gif")).size
    assert peaks[1] - peaks[0] < 3 * size                                        # 18 frames more are 18 sizes and more


def program(path, body):
    """A program that stands in for ffmpeg."""
    path.write_text(f"#!{sys.executable}\nimport sys\n{body}\n", encoding="utf-8")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def test_an_mp4_holds_the_frames_at_their_pace(tmp_path):
    """H.264 of quality 20 is off by a few of 255 levels; its sides are even."""
    imageio = pytest.importorskip("imageio.v2", reason="no extra video")
    pytest.importorskip("imageio_ffmpeg", reason="no extra video")
    plots.video(record(), tmp_path / "a.mp4", fps=12.5)
    plots.video(record(), tmp_path / "frames")
    with imageio.get_reader(tmp_path / "a.mp4", format="FFMPEG") as movie:
        shown = [frame.astype(int) for frame in movie]
        assert movie.get_meta_data()["fps"] == 12.5
    wanted = frames_of(tmp_path / "frames")
    assert len(shown) == len(wanted) == 3 and all(side % 2 == 0 for side in shown[0].shape[:2])
    for one, other in zip(shown, wanted):
        assert np.abs(one[:other.shape[0], :other.shape[1]] - other).mean() < 4


@pytest.mark.parametrize("body", ["sys.exit('no encoder')", "sys.stdin.buffer.read(); sys.exit('no encoder')"])
def test_what_ffmpeg_refuses_is_said_and_leaves_nothing(tmp_path, monkeypatch, capfd, body):
    pytest.importorskip("imageio_ffmpeg", reason="no extra video")
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", program(tmp_path / "ffmpeg", body))
    with pytest.raises(OSError, match="ffmpeg could not write the video, for the reason that it printed"):
        plots.video(record(6), tmp_path / "a.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"] and "no encoder" in capfd.readouterr().err


@pytest.mark.parametrize("package", ["imageio", "imageio_ffmpeg"])
def test_without_the_extra_an_mp4_is_refused_with_a_remedy(tmp_path, monkeypatch, package):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(ValueError, match=r"need the extra video; run pip install 'mitsonar\[video\]', or give a name"):
        plots.video(record(), tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


def test_records_may_be_files(tmp_path):
    mitsonar.write(record(2), tmp_path / "a.nc")
    plots.video([tmp_path / "a.nc", str(tmp_path / "a.nc")], tmp_path / "frames")
    assert len(frames_of(tmp_path / "frames")) == 4


def test_records_may_be_made_while_the_video_is(tmp_path):
    """A generator is taken record by record: after the first twelve, each is drawn before the next one is made."""
    folder, made = tmp_path / "frames", []

    def records():
        for number in range(15):
            made.append(len(list(tmp_path.rglob("frame_*.png"))))
            yield record(1, louder=0.1 * number).assign_coords(ping=[number], ping_time=("ping", [0.1 * number]))

    plots.video(records(), folder)
    assert len(frames_of(folder)) == 15 and made == [0] * 12 + [12, 13, 14]
    plots.video(list(records()), tmp_path / "a.gif")
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 15 and gif.info["duration"] == 100                # the records' own pace


def test_pings_faster_than_a_video_or_without_times_have_a_usual_pace(tmp_path):
    for number, (dataset, milliseconds) in enumerate([(record(apart=0.001), 30), (record(apart=20.0), 1000),
                                                      (record().drop_vars("ping_time"), 100)]):
        plots.video(dataset, tmp_path / f"{number}.gif")
        with Image.open(tmp_path / f"{number}.gif") as gif:
            assert gif.info["duration"] == milliseconds


@pytest.mark.parametrize("records, name, options, sentence", [
    ([], "a.gif", {}, "no record to make a video of"), (iter([]), "a.gif", {}, "no record to make a video of"),
    ([record(1), record(1, beams=20)], "a.gif", {}, "20 beams to 21.5 m follows one with 21"),
    ([record(1, beams=1)], "a.gif", {}, "two or more beams"), ([record(1).isel(beam=0)], "a.gif", {}, "two or more"),
    ([record(1)], "a.avi", {}, "must end in .gif or .mp4, or be that of a folder"),
    ([record(1)], "a.gif", {"fps": 60}, "60 frames a second are more than the 50"),
    ([record(1)], "a.gif", {"fps": 0}, "above 0 and at most 1000"),
    ([record(1)], "a.gif", {"colours": "green"}, "no colours 'green'"),
    ([record(1)], "a.gif", {"tvg": "most"}, "display gain is 'most'"),
    ([record(1)], "none/a.gif", {}, "folder"),
    ([record(1)], "full", {}, "it is a folder with files"), ([record(1)], "full/b", {}, "it is a file")])
def test_what_makes_no_video_is_refused_and_leaves_nothing(tmp_path, records, name, options, sentence):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "b").write_text("b")
    with pytest.raises((ValueError, FileNotFoundError), match=sentence):
        plots.video(records, tmp_path / name, **options)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["b", "full"]
