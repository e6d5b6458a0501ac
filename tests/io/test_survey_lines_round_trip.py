"""A line that was written is read again: what the format holds comes back, to the format's own steps."""
import numpy as np
import pytest

import mitsonar
from mitsonar.hydrography.record import VARIABLES
from mitsonar.io.survey_lines import read_blocks, reading, write
from tests.inputs.soundings_line import soundings_line

# Largest differences: of times, places, angles and depths, by what the formats count in (GSF: 1e-7 degrees of places,
# 0.01 degrees of attitudes, 1 cm of heave); KMALL has a transmission's angle a sector, not a beam.
STEPS = {"kmall": {"m": 2e-4, "s": 1e-6, "rad": 1e-5},
         "gsf": {"m": 0.02, "s": 1e-6, "rad": 4e-4}}
ELSEWHERE = {"kmall": {"transmit_angle"}, "gsf": set()}


@pytest.mark.parametrize("suffix", ["kmall", "gsf"])
def test_a_line_comes_back(tmp_path, suffix):
    line = soundings_line()
    write(line, tmp_path / f"line.{suffix}")
    again = reading.read(tmp_path / f"line.{suffix}")
    moved = np.array(again.attrs["origin"]) - np.array(line.attrs["origin"])
    start = float(line["ping_time"][0])
    zero = {"x": moved[0], "y": moved[1]}
    assert again.attrs["crs"] == line.attrs["crs"] and np.array_equal(again["valid"], line["valid"])
    needed = {name for name, one in VARIABLES.items() if one.needed and one.dtype.startswith("f")}
    for name in sorted(needed - ELSEWHERE[suffix]):
        unit = VARIABLES[name].unit
        before, after = line[name].values, again[name].values + zero.get(name.rpartition("_")[2], 0.0)
        after = after + (start if name in ("ping_time", "motion_time") else 0.0)
        some = np.isfinite(before) & np.isfinite(after)
        step = STEPS[suffix].get(unit, 5e-4)
        assert some.any() and np.allclose(before[some], after[some], rtol=1e-6, atol=step), name
        lost = np.broadcast_to(~line["valid"].values, before.shape) if before.shape == line["valid"].shape else ~some
        assert np.isfinite(after[~lost]).all(), name
    for name in ("sector", "detection"):
        assert np.array_equal(again[name].values[line["valid"].values], line[name].values[line["valid"].values])
    if suffix == "kmall":
        level = again["column_level_db"].values
        before = line["column_level_db"].values[..., :level.shape[-1]]
        assert np.array_equal(np.isfinite(level), np.isfinite(before))


@pytest.mark.parametrize("suffix", ["kmall", "nc"])
def test_a_line_is_read_block_by_block_with_its_water_column_or_without(tmp_path, suffix):
    write(soundings_line(pings=5), tmp_path / f"line.{suffix}")
    blocks = list(read_blocks(tmp_path / f"line.{suffix}", size=2))
    assert [one.sizes["ping"] for one in blocks] == [2, 2, 1]
    assert all("column_level_db" in one for one in blocks)
    assert not any("column_level_db" in one for one in read_blocks(tmp_path / f"line.{suffix}", column=False))


def test_a_line_is_written_by_the_verb_as_by_the_writer(tmp_path):
    line = soundings_line()
    mitsonar.write(line, tmp_path / "verb.gsf")
    write(line, tmp_path / "writer.gsf")
    assert (tmp_path / "verb.gsf").read_bytes() == (tmp_path / "writer.gsf").read_bytes()
    with pytest.raises(ValueError, match="takes lines of soundings"):
        mitsonar.write(line[["depth"]], tmp_path / "depths.gsf")
