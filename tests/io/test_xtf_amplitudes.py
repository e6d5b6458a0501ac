"""Samples of XTF files: those that our own records are written to come back, and other files are refused."""
import numpy as np
import pytest
from synthetic_sidescan import sidescan

from mitsonar.io.xtf import xtf
from mitsonar.io.xtf.amplitudes import read_amplitudes


def test_samples_of_a_written_record_come_back_near_range_first(tmp_path):
    record = sidescan(pings=30)
    scale = xtf.write(record, tmp_path / "line.xtf").scales[0]
    got = read_amplitudes(tmp_path / "line.xtf")
    assert got["amplitude"].dims == ("ping", "side", "range") and list(got["side"].values) == ["port", "starboard"]
    np.testing.assert_allclose(got["range"], record["range"], atol=1e-4)
    np.testing.assert_allclose(got["altitude"], record["altitude"], atol=1e-4)
    loud = got["amplitude"].values > 100
    level = scale.levels(got["amplitude"].values, got["range"].values)
    assert loud.mean() > 0.5 and np.abs(level - record["level"].values)[loud & (level < level.max() - 1)].max() < 0.1


@pytest.mark.parametrize(("contents", "words"), [(b"", "cannot read"), (b"time,x,y\n" * 300, "cannot read")])
def test_what_is_no_sidescan_record_is_refused_in_one_sentence(contents, words, tmp_path):
    path = tmp_path / "line.xtf"
    path.write_bytes(contents)
    with pytest.raises(ValueError, match=words) as caught:
        read_amplitudes(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_said(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_amplitudes(tmp_path / "none.xtf")
