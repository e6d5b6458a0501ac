"""Sediment maps on a survey, against the codes at the middles of its cells, worked out one by one.

In the survey's own system every cell is right. In degrees, cells whose middle lies within a tenth of a map's cell from
an edge may fall either way: the warper places them to an eighth of its own cells.
"""
import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine, from_origin
from rasterio.warp import transform

from mitsonar.io.grids import bathymetry, sediment_map
from mitsonar.io.grids.sediment_map import ClassTable, blended

WEST, SOUTH = 500000.0, 5000000.0
TABLE = ClassTable.of("1: clay, 7: medium sand, 9: Sandy_Gravel, 12: clay")


@pytest.fixture
def survey(tmp_path):
    """A level bed of 2 m, 41 x 51 nodes from WEST + 1, SOUTH + 1."""
    with rasterio.open(tmp_path / "bed.tif", "w", driver="GTiff", height=41, width=51, count=1, dtype="float32",
                       crs="EPSG:32632", transform=from_origin(WEST, SOUTH + 82, 2, 2)) as raster:
        raster.write(np.full((1, 41, 51), -20, np.float32))
    return bathymetry.read(tmp_path / "bed.tif")


def write(path, codes, placed, crs="EPSG:32632", nodata=None, dtype="uint8"):
    with rasterio.open(path, "w", driver="GTiff", height=codes.shape[-2], width=codes.shape[-1],
                       count=codes.shape[0] if codes.ndim == 3 else 1, dtype=dtype, crs=crs, nodata=nodata,
                       transform=placed) as raster:
        raster.write(codes.astype(dtype) if codes.ndim == 3 else codes.astype(dtype)[None])
    return path


def codes(rows, columns, seed=0):
    return np.random.default_rng(seed).choice([1, 7, 9, 12], (rows, columns))


def middles(survey):
    x, y = (axis[:-1] + np.diff(axis) / 2 + offset
            for axis, offset in zip((survey.x, survey.y), survey.local_origin))
    return np.meshgrid(x, y)


def expected(values, placed, east, north):
    back = ~placed
    column, row = east * back.a + north * back.b + back.c, east * back.d + north * back.e + back.f
    return values[np.floor(row).astype(int), np.floor(column).astype(int)], column % 1, row % 1


def named(numbers, table=TABLE):
    return np.array(table.sediments)[numbers]


@pytest.mark.parametrize("crs", ["EPSG:32632", None])
@pytest.mark.parametrize("placed", [
    from_origin(WEST - 20, SOUTH + 110, 7.3, 9.1), from_origin(WEST + 0.17, SOUTH + 90.3, 0.7, 0.9),
    Affine(5.3, 0, WEST - 5.1, 0, 5.7, SOUTH - 5.3)], ids=["coarse", "fine", "south up"])
def test_codes_are_those_at_the_middles_of_cells(tmp_path, survey, placed, crs):
    values = codes(140, 200)
    numbers = sediment_map.read(write(tmp_path / "map.tif", values, placed, crs), survey, TABLE)
    wanted, across, down = expected(values, placed, *middles(survey))
    clear = (np.abs(across - 0.5) < 0.499) & (np.abs(down - 0.5) < 0.499)
    assert clear.mean() > 0.85
    names = np.vectorize(TABLE.classes.get)(wanted)
    assert np.array_equal(named(numbers).reshape(names.shape)[clear], names[clear])


def test_map_in_degrees(tmp_path, survey):
    longitude, latitude = (v[0] for v in transform("EPSG:32632", "EPSG:4326", [WEST], [SOUTH]))
    placed = from_origin(longitude - 1e-4, latitude + 1e-3, 1e-4, 7e-5)
    values = codes(30, 30)
    numbers = sediment_map.read(write(tmp_path / "map.tif", values, placed, "EPSG:4326"), survey, TABLE)
    east, north = middles(survey)
    east, north = (np.reshape(v, east.shape) for v in transform("EPSG:32632", "EPSG:4326", east.ravel(), north.ravel()))
    wanted, across, down = expected(values, placed, east, north)
    clear = (np.abs(across - 0.5) < 0.4) & (np.abs(down - 0.5) < 0.4)
    names = np.vectorize(TABLE.classes.get)(wanted)
    assert clear.mean() > 0.5 and np.array_equal(named(numbers).reshape(names.shape)[clear], names[clear])


@pytest.mark.parametrize("nodata", [0, None])
def test_what_the_map_leaves_out_is_as_the_table_says(tmp_path, survey, nodata):
    table = ClassTable.of("1: clay, 7: sand, 9: silt, 12: clay, nodata: gravel")
    half = write(tmp_path / "map.tif", np.full((10, 5), 7), from_origin(WEST + 1, SOUTH + 100, 10, 10), nodata=nodata)
    numbers = sediment_map.read(half, survey, table)
    east, _ = middles(survey)
    assert np.array_equal(named(numbers, table).reshape(east.shape) == "gravel", east > WEST + 51)
    with pytest.raises(ValueError, match='no class on 50.0% of the seabed; say what lies there by the code nodata'):
        sediment_map.read(half, survey, TABLE)
    assert set(sediment_map.read(half, survey, TABLE, np.flatnonzero(east < WEST + 51))) == {1}   # the cells asked for


def test_ascii_maps_are_in_the_survey_s_system(tmp_path, survey):
    (tmp_path / "map.asc").write_text(f"ncols 2\nnrows 2\nxllcorner {WEST}\nyllcorner {SOUTH}\ncellsize 51\n"
                                      "1 7\n9 12\n")
    east, north = middles(survey)
    names = named(sediment_map.read(tmp_path / "map.asc", survey, TABLE)).reshape(east.shape)
    assert set(names[(east < WEST + 51) & (north > SOUTH + 51)]) == {"clay"}
    assert set(names[(east < WEST + 51) & (north < SOUTH + 51)]) == {"sandy gravel"}
    assert set(names[(east > WEST + 51) & (north > SOUTH + 51)]) == {"medium sand"}


def test_tables_as_text_and_as_files(tmp_path):
    assert TABLE.sediments == ["clay", "medium sand", "sandy gravel"] and TABLE.elsewhere is None
    (tmp_path / "table.csv").write_text("name,Code,Sediment\nmud,1,Clay\nS,7,medium-sand\n,nodata,silt\n")
    table = ClassTable.of(str(tmp_path / "table.csv"))
    assert table.classes == {1: "clay", 7: "medium sand"} and table.elsewhere == "silt"
    assert table.sediments == ["clay", "medium sand", "silt"]


@pytest.mark.parametrize("text, said", [
    ("", "has no codes"),
    ("nodata: sand", "has no codes"),
    ("clay, sand", 'the code "clay", which is no whole number'),
    ("1.5: clay", 'the code "1.5"'),
    ("1: clay, 1: sand", "has the code 1 twice"),
    ("1: marzipan", 'no sediment is called "marzipan"; known are'),
])
def test_tables_that_are_none(text, said):
    with pytest.raises(ValueError, match=said):
        ClassTable.of(text)


def test_table_files_that_are_none(tmp_path):
    (tmp_path / "t.csv").write_text("number,sediment\n1,clay\n")
    with pytest.raises(ValueError, match="the columns are number, sediment; a class table has code and sediment"):
        ClassTable.of(str(tmp_path / "t.csv"))


PLACE = from_origin(WEST - 20, SOUTH + 110, 10, 10)


@pytest.mark.parametrize("make, said", [
    (lambda p: p.with_suffix(".none"), "there is no such file"),
    (lambda p: p.write_bytes(b"nothing") and p, "this is not a map of classes that GDAL can read"),
    (lambda p: write(p, codes(15, 15) + 1, PLACE), "the map has the codes 2, 8, 10, 13 on 100.0% of the seabed"),
    (lambda p: write(p, codes(15, 15) + 0.25, PLACE, dtype="float32"), "which is no code; classes are whole numbers"),
    (lambda p: write(p, np.ones((3, 15, 15)), PLACE), "has 3 bands; a map of classes has one, not colours"),
    (lambda p: write(p, codes(15, 15), from_origin(WEST + 5000, SOUTH, 10, 10)), "no class anywhere on the survey"),
    (lambda p: write(p, codes(15, 15), from_origin(10, 50, 1e-3, 1e-3), None), "look like degrees"),
    (lambda p: write(p, codes(15, 15), Affine.identity(), None), "no georeference"),
])
def test_maps_that_are_none(tmp_path, survey, make, said, capfd):
    path = make(tmp_path / "map.tif")
    capfd.readouterr()
    with pytest.raises(ValueError, match=said) as caught:
        sediment_map.read(path, survey, TABLE)
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(path))
    assert capfd.readouterr().err == ""


def test_map_with_a_system_on_a_survey_without_one(tmp_path):
    np.save(tmp_path / "bed.npy", np.full((5, 5), -20.0))
    bed = bathymetry.read(tmp_path / "bed.npy", spacing=1.0)
    with pytest.raises(ValueError, match="the map has a coordinate system and the survey none"):
        sediment_map.read(write(tmp_path / "map.tif", codes(15, 15), PLACE), bed, TABLE)


# ---- borders

@pytest.mark.parametrize("size", [3, 4])
def test_borders_are_triangular_and_lean_to_no_side(size):
    numbers = np.repeat([[0] * 10 + [1] * 10], 5, axis=0)
    other, share = blended(numbers, np.ones(numbers.shape, bool), 2, (2.0 * size, 2.0 * size))
    kernel = np.convolve(np.ones(size), np.ones(size)) / size ** 2
    wanted = [kernel[size + step:].sum() for step in range(size - 1)]
    np.testing.assert_allclose(share[2, 9::-1][:size - 1], wanted, atol=1e-6)
    np.testing.assert_allclose(share[2, 10:][:size - 1], wanted, atol=1e-6)
    assert not share[:, :9 - size].any() and np.array_equal(other[share > 0], 1 - numbers[share > 0])


def test_the_most_frequent_other_class_counts_and_gaps_count_for_nothing():
    numbers = np.zeros((30, 30), np.uint32)
    numbers[:, 15:], numbers[20:, 15:] = 1, 2
    known = np.ones(numbers.shape, bool)
    known[:5] = False
    other, share = blended(numbers, known, 3, (6.0, 6.0))
    assert other[10, 14] == 1 and other[26, 14] == 2 and not share[:5].any()
    assert share[5, 14] == pytest.approx(share[10, 14])            # beside a gap as elsewhere
    assert not blended(numbers, known, 3, (1.0, 1.0))[1].any()


def test_the_usual_border_is_a_cell_of_the_map(tmp_path, survey):
    values = np.repeat([[1, 7]], 20, axis=0)
    wide = write(tmp_path / "wide.tif", values, from_origin(WEST, SOUTH + 410, 52.0, 52.0))
    painting = sediment_map.paint(wide, survey, TABLE)
    share = painting.share.reshape(40, 50)
    assert np.array_equal(painting.number, sediment_map.read(wide, survey, TABLE))
    spread = np.count_nonzero(share[20] > 0.001) * survey.spacing[0]
    assert spread == pytest.approx(52, abs=6)
    assert not sediment_map.paint(wide, survey, TABLE, border=0.0).share.any()
