"""Measured backscatter strength: read from a file, given back as it is, and refused where it makes no sense."""
import numpy as np
import pytest

from mitsonar.io.scene_files import backscatter
from mitsonar.scattering import EmpiricalSeabed, backscatter_strength_db, bistatic_strength_db

TABLE = "grazing, 300 kHz, 30kHz\n45, -18, -20\n# a remark\n8, -28, -32\n\n90, -9, -4\n"


@pytest.fixture
def read(tmp_path):
    """Read a table from its text."""
    def run(text):
        path = tmp_path / "measured.csv"
        path.write_text(text, encoding="utf-8")
        return backscatter.read(path)
    return run


def test_a_table_comes_back_as_it_is(read):
    seabed = read(TABLE)
    np.testing.assert_allclose(np.degrees(seabed.angles), [8, 45, 90])
    assert list(seabed.frequencies) == [30e3, 300e3]
    angles = np.radians([8, 45, 90])
    for frequency, strengths in ((30e3, [-32, -20, -4]), (300e3, [-28, -18, -9]), (10e3, [-32, -20, -4]),
                                 (1e6, [-28, -18, -9])):
        np.testing.assert_allclose(backscatter_strength_db(seabed, angles, frequency), strengths, atol=1e-9)


def test_between_and_beyond_its_entries(read):
    seabed = read(TABLE)
    between = backscatter_strength_db(seabed, np.radians(26.5), np.sqrt(30e3 * 300e3))
    assert between == pytest.approx((-32 - 28 - 20 - 18) / 4, abs=1e-9)
    below = backscatter_strength_db(seabed, np.radians(2), 30e3)
    assert below == pytest.approx(-32 + 20 * np.log10(np.sin(np.radians(2)) / np.sin(np.radians(8))), abs=1e-9)
    both = bistatic_strength_db(seabed, np.radians(45), np.radians(90), [0.0, 2.0], 30e3)
    np.testing.assert_allclose(both, -12, atol=1e-9)
    one = read("angle; S\n20; -25\n60; -20")
    assert backscatter_strength_db(one, np.radians(40), [1e4, 1e6]) == pytest.approx(-22.5)


def test_a_table_of_one_angle_is_lamberts_law_below_it(read):
    found = backscatter_strength_db(read("a,s\n90,-25"), np.radians([10, 50]), 1e5)
    np.testing.assert_allclose(found, -25 + 20 * np.log10(np.sin(np.radians([10, 50]))), atol=1e-9)


@pytest.mark.parametrize("text, words", [
    ("grazing\n10\n", "one column"),
    ("a, s\n10, loud\n", "line 2: s is 'loud'"),
    ("a, s\n0, -30\n", "line 2: the grazing angle is 0"),
    ("a, s\n95, -30\n", "line 2: the grazing angle is 95"),
    ("a, s\n10, -30\n10, -29\n", "the grazing angle 10 is there twice"),
    ("a, low, high\n10, -30, -29\n", 'the column "low" has no frequency in its name'),
    ("a, 30 kHz, 30 kHz\n10, -30, -29\n", "each be there once"),
    ("a, s\n5, -3\n90, -3\n", "more comes back than arrives: "),
    ("a, 30 kHz, 100 kHz\n5, -33, -3\n90, -23, -3\n", "more comes back than arrives at 100 kHz"),
    ("a, s\n", "it has a header but no records"),
])
def test_refusals_say_why(read, text, words):
    with pytest.raises(ValueError, match=words):
        read(text)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(FileNotFoundError, match="there is no such file"):
        backscatter.read(tmp_path / "none.csv")


def test_arrays_that_make_no_table():
    with pytest.raises(ValueError, match="as many rows"):
        EmpiricalSeabed(angles=[0.1, 0.2], strengths_db=[-30])
    with pytest.raises(ValueError, match="grazing angles must increase"):
        EmpiricalSeabed(angles=[0.2, 0.1], strengths_db=[-30, -20])
    with pytest.raises(ValueError, match="2 columns of strengths need as many frequencies"):
        EmpiricalSeabed(angles=[0.2], strengths_db=[[-30, -20]])
