"""Array files: what the columns mean, how they may be written, and which lines are refused by number."""
import numpy as np
import pytest

from mitsonar.io.scene_files import arrays

PLAIN = "x,y,z\n0.1,-0.2,0.3\n-0.1,0.2,0.3\n"
FULL = ("x,y,z,nx,ny,nz,ax,ay,az,weight,delay\n"
        "0.1,-0.2,0.3,0,-2,0,3,1,0,0.5,1e-6\n-0.1,0.2,0.3,0,0,1,0,1,0,0,-2e-6\n")


def written(folder, text):
    path = folder / "array.csv"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.parametrize("text", [
    PLAIN,
    PLAIN.replace(",", "; "),
    "# bow\n" + PLAIN.replace("\n", "\r\n\r\n"),
    "note,Z,Y,X\nport,0.3,-0.2,0.1\n\"a, b\",0.3,0.2,-0.1\n",
], ids=["plain", "semicolon", "comments", "shuffled"])
def test_positions_alone(text, tmp_path):
    array = arrays.read(written(tmp_path, text))
    np.testing.assert_array_equal(array.position, [[0.1, -0.2, 0.3], [-0.1, 0.2, 0.3]])
    np.testing.assert_array_equal(array.normal, [[0, 0, 1]] * 2)
    np.testing.assert_array_equal(array.along, [[1, 0, 0]] * 2)
    assert array.weight.tolist() == [1, 1] and array.delay.tolist() == [0, 0] and array.pattern == "omni"


def test_all_columns(tmp_path):
    array = arrays.read(written(tmp_path, FULL), pattern="circular", length=0.05, baffle="hard")
    np.testing.assert_array_equal(array.normal, [[0, -1, 0], [0, 0, 1]])
    np.testing.assert_array_equal(array.along, [[1, 0, 0], [0, 1, 0]])           # made perpendicular to the normal
    assert array.weight.tolist() == [0.5, 0] and array.working.tolist() == [True, False]
    assert array.delay.tolist() == [1e-6, -2e-6]
    assert (array.pattern, array.length, array.baffle) == ("circular", 0.05, "hard")


def test_normal_for_all_where_the_file_has_none(tmp_path):
    array = arrays.read(written(tmp_path, PLAIN), normal="starboard", along="down")
    np.testing.assert_array_equal(array.normal, [[0, 1, 0]] * 2)
    np.testing.assert_array_equal(array.along, [[0, 0, 1]] * 2)


@pytest.mark.parametrize(("text", "words"), [
    ("", "no header and no records"),
    ("x,y,z\n", "a header but no records"),
    ("x,y\n0,1\n", "the column z is missing; the header has x, y and needs x, y and z"),
    ("0,1,2\n3,4,5\n", "numbers where the names of columns belong; give a header line"),
    ("x,y,z,nx,nz\n0,1,2,0,1\n", "the column ny is missing"),
    ("x,y,z,z\n0,1,2,3\n", "the column z is given twice"),
    ("x,y,z\n0,1,2\n\n0,1,here\n", "line 4: z is 'here', which is not a finite number"),
    ("x,y,z\n0,1,2\n0,1\n", "line 3: 2 fields, but the header names 3"),
    ("x,y,z,weight\n0,1,2,nan\n", "line 2: weight is 'nan'"),
    ("x,y,z,weight\n0,1,2,0\n", "no element has a weight"),
    ("x,y,z,nx,ny,nz\n0,1,2,0,0,1\n0,1,2,0,0,0\n", "normal of element 1 is [0. 0. 0.]"),
])
def test_bad_files_are_refused_in_one_sentence(text, words, tmp_path):
    with pytest.raises(ValueError, match="array.csv") as caught:
        arrays.read(written(tmp_path, text))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_what_is_no_text_file_is_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="cannot read the array .*: there is no such file"):
        arrays.read(tmp_path / "missing.csv")
    with pytest.raises(ValueError, match="it is a folder; give the path of a CSV file"):
        arrays.read(tmp_path)
