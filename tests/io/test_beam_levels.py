"""Measured beam patterns as CSV files."""
import pytest

from mitsonar.io.scene_files import beam_levels


@pytest.mark.parametrize("level", ["1e300", "-1e300", "301", "-4000"])
def test_levels_that_no_face_has_are_refused(tmp_path, level):
    path = tmp_path / "beam.csv"
    path.write_text(f"angle_deg,level_db\n-10,-3\n10,{level}\n")
    with pytest.raises(ValueError, match="line 3: the level is .* dB; it must lie within -300 to 300 dB"):
        beam_levels.read(path)


def test_rows_come_in_any_order(tmp_path):
    path = tmp_path / "beam.csv"
    path.write_text("angle_deg,level_db\n10,-3\n-10,-4\n0,0\n")
    assert beam_levels.read(path).level_db.tolist() == [-4, 0, -3]
