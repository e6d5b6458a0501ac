"""`video`: records in, a GIF or PNG files out, one sentence for what cannot be."""
import numpy as np
import xarray as xr
from PIL import Image

from mitsonar.cli import main
from mitsonar.io.records import exr


def written(path, beams=9):
    """A record of two pings."""
    angle = np.deg2rad(np.linspace(-40, 40, beams))
    level = np.random.default_rng(0).normal(60, 5, (2, beams, 30)).astype(np.float32)
    exr.write(xr.Dataset({"level": (("ping", "beam", "range"), level)}, {
        "ping": [0, 1], "ping_time": ("ping", [0.0, 0.5]), "beam": angle, "range": 1 + 0.25 * np.arange(30),
        **{f"beam_{axis}": ("beam", part) for axis, part in zip("xyz", (np.cos(angle), np.sin(angle), 0 * angle))}},
        {"frequency": 3e5, "sonar": "forward_looking"}), path)
    return str(path)


def test_records_become_a_video(tmp_path, capsys):
    records = [written(tmp_path / f"{number}.exr") for number in range(2)]
    options = ["--fps", "4", "--colours", "grey", "--tvg", "none"]
    assert main.main(["video", *records, str(tmp_path / "a.gif"), *options]) == 0
    assert capsys.readouterr().out.strip().endswith("a.gif")
    with Image.open(tmp_path / "a.gif") as gif:
        assert gif.n_frames == 4 and gif.info["duration"] == 250
    assert main.main(["video", records[0], str(tmp_path / "frames")]) == 0
    assert len(list((tmp_path / "frames").iterdir())) == 2


def test_what_makes_no_video_is_one_sentence(tmp_path, capsys):
    good, other = written(tmp_path / "a.exr"), written(tmp_path / "b.exr", beams=7)
    for arguments, words in (([good, other, "c.gif"], "make a video of each"), ([good, "c.avi"], "must end in .gif or"),
                             ([str(tmp_path / "no.exr"), "c.gif"], "no.exr"), ([good], "required: OUT"),
                             ([good, "c.gif", "--fps", "quick"], "'quick' is not a number")):
        arguments[-1:] = [str(tmp_path / arguments[-1])] if arguments[-1].startswith("c.") else arguments[-1:]
        assert main.main(["video", *arguments]) == 2
        said = capsys.readouterr().err
        assert words in said and said.count("\n") == 1, said
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.exr", "b.exr"]
