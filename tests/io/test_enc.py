"""Beds from electronic charts (S-57): a chart written here record by record, and damaged ones."""
import struct

import numpy as np
import pytest

from mitsonar.io.grids import bathymetry, enc

SCALE, DEPTHS = 10_000_000, 10
LONGITUDE, LATITUDE = 8.2, 54.1


def record(*fields, kind=b"D"):
    """Return a record of ISO/IEC 8211 with fields (tag, content)."""
    contents = [content + b"\x1e" for _, content in fields]
    starts = np.cumsum([0, *map(len, contents)])
    directory = "".join(f"{tag}{len(content):05d}{start:05d}" for (tag, _), content, start in zip(
        fields, contents, starts)).encode() + b"\x1e"
    base = 24 + len(directory)
    leader = f"{base + starts[-1]:05d}".encode() + b" " + kind + b"     " + f"{base:05d}".encode() + b"   5504"
    return leader + directory + b"".join(contents)


def whole(value, scale=SCALE):
    return round(value * scale)


def chart(*, datum=2, unit=1, soundings=((0.0, 0.0, 12.5), (0.01, 0.0, 14.0), (0.0, 0.01, -1.5), (0.01, 0.01, 3.0))):
    """A chart of four soundings, and a contour of 10 m over an edge with its two end nodes."""
    places = b"".join(struct.pack("<3i", whole(LATITUDE + y), whole(LONGITUDE + x), whole(z, DEPTHS))
                      for x, y, z in soundings)

    def node(number, x, y):
        return record(("VRID", struct.pack("<BIHB", 120, number, 1, 1)),
                      ("SG2D", struct.pack("<2i", whole(LATITUDE + y), whole(LONGITUDE + x))))

    edge = struct.pack("<4i", *(whole(value) for x in (0.004, 0.006) for value in (LATITUDE + 0.005, LONGITUDE + x)))
    ends = b"".join(struct.pack("<BI4B", 120, number, 255, 1 + index, 255, 255) for index, number in enumerate((7, 8)))
    return b"".join([
        record(("0000", b"x"), ("DSID", b"y"), kind=b"L"),
        record(("DSPM", struct.pack("<BI3BI4B2I", 20, 1, datum, 3, 23, 10_000, unit, 1, 1, 1, SCALE, DEPTHS))),
        record(("VRID", struct.pack("<BIHB", 110, 1, 1, 1)), ("SG3D", places)),
        node(7, 0.002, 0.005), node(8, 0.008, 0.005),
        record(("VRID", struct.pack("<BIHB", 130, 9, 1, 1)), ("VRPT", ends), ("SG2D", edge)),
        record(("FRID", struct.pack("<BI2BHHB", 100, 1, 2, 2, 43, 1, 1)),
               ("ATTF", struct.pack("<H", 174) + b"10\x1f" + struct.pack("<H", 116) + b"x\x1f"),
               ("FSPT", struct.pack("<BI3B", 130, 9, 1, 255, 255))),
        record(("FRID", struct.pack("<BI2BHHB", 100, 2, 2, 2, 42, 1, 1)),          # a depth area: not read
               ("ATTF", struct.pack("<H", 174) + b"99\x1f"), ("FSPT", struct.pack("<BI3B", 130, 9, 1, 255, 255)))])


def test_soundings_and_contours_are_read(tmp_path):
    (tmp_path / "cell.000").write_bytes(chart())
    survey = enc.read(tmp_path / "cell.000")
    assert str(survey.crs) == "EPSG:32632" and str(survey.source) == "EPSG:4326"
    assert sorted(survey.z) == [-1.5, 3.0, 10.0, 10.0, 10.0, 10.0, 12.5, 14.0]
    contour = survey.x[survey.z == 10.0]
    # Degrees of longitude are 65.4 km at 54.1 degrees north (and the zone's scale is 0.9996).
    np.testing.assert_allclose(np.diff(np.sort(contour)), 65.4e3 * 0.002, atol=0.2)


def test_a_chart_is_a_bed(tmp_path):
    (tmp_path / "cell.000").write_bytes(chart())
    bed = bathymetry.read(tmp_path / "cell.000", resolution=20.0)
    assert bed.vertical == "depth" and bed.crs == "EPSG:32632"
    assert (np.nanmin(bed.heights), np.nanmax(bed.heights)) == pytest.approx((-14.0, 1.5), abs=0.3)
    # Between contour and soundings the depth is linear.
    middle = bed.height_at(*(0.5 * (axis[0] + axis[-1]) for axis in (bed.x, bed.y)))
    assert float(middle) == pytest.approx(-10, abs=0.5)
    with pytest.raises(ValueError, match="electronic chart.* leave crs"):
        bathymetry.read(tmp_path / "cell.000", crs="EPSG:4326")


@pytest.mark.parametrize("content, message", [
    (chart(datum=1), "not in degrees of WGS 84"), (chart(unit=2), "not in degrees of WGS 84"),
    (chart()[:-30], "the chart is cut: its record at byte"), (chart() + b"00012", "damaged or cut at byte"),
    (record(("0000", b"x"), ("DSID", b"y"), kind=b"L"), "states no units"),
    (chart(soundings=((100.0, 50.0, 1.0), (0, 0, 2.0))), "off the Earth"),
    (chart().replace(b"VRID0000900000VRPT", b"VRID0000900000VRxT").replace(b"FRID", b"FRI\xff"), "damaged")])
def test_charts_that_make_no_sense_are_refused(content, message, tmp_path):
    (tmp_path / "cell.000").write_bytes(content)
    with pytest.raises(ValueError, match=message):
        bathymetry.read(tmp_path / "cell.000")


def test_any_damage_is_one_sentence(tmp_path):
    good, chance = chart(), np.random.default_rng(3)
    for _ in range(60):
        bad = bytearray(good)
        for place in chance.integers(len(bad), size=3):
            bad[place] = chance.integers(256)
        (tmp_path / "cell.000").write_bytes(bad)
        try:
            enc.read(tmp_path / "cell.000")
        except ValueError as error:
            assert str(error).endswith(".") and "\n" not in str(error)
