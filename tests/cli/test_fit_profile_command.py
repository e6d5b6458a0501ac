"""The command `fit profile`: its verdict, the files it writes, and what it refuses in one sentence."""
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from sounded_line import SUMMER, recorded, rocking, sounded

from mitsonar.cli import main as cli
from mitsonar.hydrography.reduction.resounding import resounded
from mitsonar.io import casts, survey_lines
from mitsonar.water import SoundSpeedProfile

REAL = Path(__file__).resolve().parents[2] / "../shared/data/measured/multibeam/em710_122m.all"
COURSE = np.array([3.0, 5.0]) / np.hypot(3, 5)


@pytest.fixture
def lines(folder):
    """Four lines up a slope from 75 to 15 m, by exact rays between moving arrays, reduced with water of one speed."""
    rng, names = np.random.default_rng(4), []
    sent = np.repeat(np.linspace(1, 59, 30)[:, None], 24, 1)
    for number, offset in enumerate((-60, -20, 20, 60)):
        motion = rocking(np.arange(-1, 62, 0.1))
        motion = replace(motion, x=motion.x + offset * COURSE[1], y=motion.y - offset * COURSE[0])
        place = motion.at(sent).place[..., :2]
        along = place @ COURSE
        reach = 1.5 * bed(along) * np.linspace(-1, 1, 24)
        across = np.stack([reach * COURSE[1], -reach * COURSE[0]], -1) + place
        points = np.concatenate([across, bed(across @ COURSE)[..., None]], -1)
        line = recorded(sounded(points, sent, motion))
        line["travel_time"] += 5e-6 * rng.standard_normal(sent.shape)
        wrong = resounded(line, SoundSpeedProfile([0.0, 120], [1500.0, 1500]))
        names.append(f"line_{number}.nc")
        survey_lines.write(wrong, folder / names[-1])
    return names


def bed(along):
    """Depth of the slope."""
    return np.clip(75 - 60 * along / 350, 15, 75)


def test_lines_over_a_slope_give_a_cast(folder, lines, capfd):
    assert cli.main(["fit", "profile", *lines, "--under-way", "--noise", "5", "--deviation", "15", "--profile",
                     "cast.csv", "-o", "fit.nc"]) == 0
    out, err = capfd.readouterr()
    assert "tell the speed at" in out and "cast.csv" in out and err == ""
    cast = casts.read(folder / "cast.csv").profile
    with xr.open_dataset(folder / "fit.nc") as answer:
        told, depth = answer["told"].values.astype(bool), answer["depth"].values
    error = (cast.at(depth) - SUMMER.at(depth))[told]
    assert told.sum() >= 8 and np.abs(SUMMER.at(depth) - 1500)[told].mean() > 15
    # nodes are six metres apart, in water that bends at ten depths
    assert np.abs(error).mean() < 1.5


@pytest.fixture
def real():
    if not REAL.is_file():
        pytest.skip(f"{REAL.name} is not beside this checkout")
    return REAL


def test_a_real_line_alone_is_told_to_tell_nothing(folder, real, capfd):
    assert cli.main(["fit", "profile", str(real), "-o", "fit.nc", "--picture", "fit.png"]) == 0
    out, err = capfd.readouterr()
    assert out.splitlines()[0].startswith("Each part of the bed was seen from one direction only")
    assert err == "" and (folder / "fit.png").stat().st_size > 10_000
    with xr.open_dataset(folder / "fit.nc") as answer:
        assert answer.sizes["node"] == 13 and answer.attrs["soundings"] == 4000


def test_where_there_is_no_profile_none_is_written(refusal, real):
    said = refusal("fit", "profile", real, "-o", "fit.nc", "--profile", "cast.csv")
    assert "seen from one direction only" in said


@pytest.mark.parametrize("arguments, says", [
    (("none.all", "-o", "fit.nc"), "there is no such file"),
    (("none.all", "-o", "fit.csv"), "cannot write fit.csv: its name must end in .nc"),
    (("none.all", "--profile", "cast.txt"), "cannot write cast.txt: its name must end in .csv"),
    (("scene.xml", "-o", "fit.nc"), "scene.xml"), (("none.all",), "give -o OUT.nc")])
def test_files_that_will_not_do_are_refused(refusal, arguments, says):
    assert says in refusal("fit", "profile", *arguments)


def test_a_line_is_not_written_over(folder, refusal):
    (folder / "line.nc").write_bytes(b"what it holds")
    assert "line.nc is one of the inputs; give another name" in refusal("fit", "profile", "line.nc", "-o", "line.nc")


def test_nodes_and_noise_that_will_not_do_are_refused(refusal, real):
    assert "1 nodes from the head" in refusal("fit", "profile", real, "-o", "a.nc", "--nodes", "1")
    assert "noise is 0 s" in refusal("fit", "profile", real, "-o", "a.nc", "--noise", "0")
    assert "deviation is -1" in refusal("fit", "profile", real, "-o", "a.nc", "--deviation", "-1")
