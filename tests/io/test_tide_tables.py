"""Tide tables of survey software and authorities: recognised by content, in UTC and metres, or refused in a sentence.

Samples are made up in the layouts of the CARIS manual (Tide File Formats) and of NOAA's CO-OPS service.
"""
import numpy as np
import pytest

from mitsonar.io.tracks import tides

START = 1777629600.0               # 2026-05-01T10:00Z
HEIGHTS = [0.522, 0.317, -0.395]
STAMPS = ("2026/05/01 10:00", "2026/05/01 10:06", "2026/05/01 10:12")
RULE = "-" * 60


def rows(pattern, join="\n"):
    return join.join(pattern.format(stamp=stamp, day=stamp[:10], clock=stamp[11:], height=f"{height:.3f}")
                     for stamp, height in zip(STAMPS, HEIGHTS)) + "\n"


TABLES = {
    "CARIS": "--------\n" + rows("{stamp} {height}"),
    "CARIS with seconds": "--------\r\n" + rows("{stamp}:00.0\t{height}", "\r\n"),
    "COWLIS": f"{RULE}\n----- Time Zone: GMT ( 0.0) -----\n\nName Type Size\nstart_time INTG 4 seconds 93/06/29 "
              f"18:45:00\n{RULE}\n\n" + rows("{stamp}:00 {height} 0.030") + "\n--------- End Of LIBEX File ---------\n",
    "NOS": "NOS SIX MINUTE WATER LEVEL HEIGHTS\n\nData are in meters above MLLW\nTimes are on UTC (GMT)\n\n9452210 "
           f"Juneau from 20260501 to 20260502\n{RULE}\nStation Date Time WL_Value Sigma\n\n"
           + rows("9452210 {stamp} {height} 0.019 0 0 0 0") + RULE + "\n",
    "CO-OPS service": "Date Time, Water Level, Sigma, O or I (for verified), F, R, L, Quality \n"
                      + rows("{stamp},{height},0.007,0,0,0,0,v").replace("/", "-"),
    "CO-OPS prediction": "Date Time, Prediction\n" + rows("{stamp},{height}").replace("/", "-"),
    "CO-OPS site": '"Date","Time (GMT)","Predicted (m)","Preliminary (m)","Verified (m)"\n'
                   + rows('"{day}","{clock}","9.9","-","{height}"'),
    "plain": "time,height\n" + rows("{day}T{clock}:00Z,{height}").replace("/", "-"),
}


@pytest.mark.parametrize("table", TABLES.values(), ids=TABLES)
def test_a_table_is_known_by_its_content(tmp_path, table):
    (tmp_path / "any.txt").write_text(table, newline="")
    found = tides.load(tmp_path / "any.txt")
    np.testing.assert_allclose(found.time, START + 360 * np.arange(3), atol=1e-3)
    np.testing.assert_allclose(found.height, HEIGHTS, atol=1e-9)
    assert found.dated


def test_feet_become_metres_and_missing_readings_are_left_out(tmp_path):
    site = TABLES["CO-OPS site"].replace("(m)", "(ft)").replace('"0.317"', '"-"')
    for table in (TABLES["NOS"].replace("meters", "feet").replace("0.317", "-"), site):
        (tmp_path / "a.csv").write_text(table)
        found = tides.load(tmp_path / "a.csv")
        np.testing.assert_allclose(found.time, START + np.array([0, 720]), atol=1e-3)
        np.testing.assert_allclose(found.height, 0.3048 * np.array([0.522, -0.395]))
    preliminary = site.replace('"-","0.522"', '"0.522","-"').replace('"-","-0.395"', '"-0.395","-"')
    (tmp_path / "a.csv").write_text(preliminary)
    np.testing.assert_allclose(tides.load(tmp_path / "a.csv").height, 0.3048 * np.array([0.522, -0.395]))


@pytest.mark.parametrize("table, words", [
    (TABLES["COWLIS"].replace("( 0.0)", "(-4.0)"), "in the zone 'GMT"),
    (TABLES["NOS"].replace("UTC (GMT)", "Local Standard Time"), "in the zone 'Local Standard Time'; give a table"),
    (TABLES["NOS"].replace("meters", "fathoms"), "its heights are in 'fathoms'"),
    (TABLES["CO-OPS site"].replace("GMT", "LST/LDT"), "in the zone 'lst/ldt'"),
    (TABLES["CARIS"].replace("05/01 10:06", "13/01 10:06"), "line 3 has the time 2026-13-01 10:06, which is none"),
    (TABLES["CARIS"].replace("0.317", "high"), "line 3: height is 'high'"),
    (TABLES["CARIS"] + "and so on\n", "line 5 is 'and so on', neither a reading"),
    (TABLES["CARIS"].replace("10:12", "10:01"), "line 4: the time .* is not later than"),
    (TABLES["CARIS"].replace("0.522", "52.2"), "height is 52.2 m, and no tide"),
    ("--------\n2026/05/01 10:00 0.5\n", "it has one reading"),
    ("Date Time, My Water Level\n2026-05-01 10:00,0.5\n", "no column of the header begins with verified, preliminary"),
    (TABLES["CO-OPS service"].replace(",0.317,0.007,0,0,0,0,v", ""), "line 3 has 1 fields"),
    ("", "no header and no records")])
def test_other_tables_are_refused_in_a_sentence(tmp_path, table, words):
    (tmp_path / "a.tid").write_text(table)
    with pytest.raises(ValueError, match=words):
        tides.load(tmp_path / "a.tid")
