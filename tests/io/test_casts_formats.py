"""Every format of casts, on small samples: depths, speeds, place and time, in the spellings that instruments have.

The Sea-Bird, AML and CTD samples are of one water, made by the formulas: salinity of conductivity by PSS-78, sound
speed by Chen and Millero, which TEOS-10 follows within 0.06 m/s there.
"""
import datetime

import cast_samples
import gsw
import numpy as np
import pytest

from mitsonar.io import casts
from mitsonar.io.casts import fields

DEPTH = [0.6, 3.0, 9.0]
PRESSED = -gsw.z_from_p(DEPTH, 54.175)
EXPECTED = [
    # sample, depths, speeds, has a place (None: only a latitude), latitude by which pressure became depth
    (cast_samples.CARIS, [0.5, 2, 9], [1490.5, 1490, 1486], True, None),
    (cast_samples.CASTAWAY, [0.5, 2, 8.9], [1492, 1490.5, 1486.2], True, None),
    (cast_samples.AML, PRESSED, [1490.81, 1489.51, 1485.51], True, 54.175),
    (cast_samples.AML_TITLES, DEPTH, [1490.85, 1489.54, 1485.53], False, None),
    (cast_samples.AML_NEWER, PRESSED, [1490.81, 1489.51, 1485.51], True, 54.175),
    (cast_samples.KONGSBERG, [0, 2, 9], [1490.5, 1490, 1486], True, None),
    (cast_samples.SEABIRD, -gsw.z_from_p([0.605, 0.9, 3, 9], 54.175), [1490.83, 1490.81, 1489.51, 1485.51], True,
     54.175),
    (cast_samples.HYPACK, [0, 2, 9], [1490.5, 1490, 1486], True, None),
    (cast_samples.VALEPORT, PRESSED, [1490.85, 1489.54, 1485.53], None, 54.175),
]
IDS = ["caris", "castaway", "aml", "aml titles", "aml newer", "kongsberg", "sea-bird", "hypack", "valeport"]
CNV = ("* Sea-Bird SBE 19\n# name 0 = {pressure}\n# name 1 = {temperature}\n# name 2 = t190C: Temperature, 2 [ITS-90, "
       "deg C]\n# name 3 = {salinity}\n*END*\n 1 {t} 99 {s}\n 5 {t} 99 {s}\n")
CNV_COLUMNS = {"pressure": "prDM: Pressure, Digiquartz [db]", "temperature": "t090C: Temperature [ITS-90, deg C]",
               "salinity": "sal00: Salinity, Practical [PSU]", "t": 10, "s": 35}


@pytest.fixture
def read(tmp_path):
    """Read a cast of this text."""
    def read(content, encoding="utf-8", **choices):
        path = tmp_path / "cast.any"
        path.write_bytes(content.encode(encoding))
        return casts.read(path, **choices)

    return read


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
@pytest.mark.parametrize("sample, depth, speed, placed, pressure_latitude", EXPECTED, ids=IDS)
def test_samples(read, sample, depth, speed, placed, pressure_latitude, encoding):
    cast = read(sample, encoding)
    np.testing.assert_allclose(cast.profile.depth, depth, atol=1e-9)
    # The newer AML sample gives no sound speed: TEOS-10 takes the place of Chen and Millero.
    np.testing.assert_allclose(cast.profile.sound_speed, speed,
                               atol=0.06 if cast.sound_speed_source == "teos-10" else 1e-9)
    assert cast.latitude == (pytest.approx(54.175) if placed is not False else None)
    assert cast.longitude == (pytest.approx(-7.5) if placed else None)
    assert cast.time == datetime.datetime(2021, 4, 10, 6, 30, tzinfo=datetime.timezone.utc)
    assert cast.pressure_latitude == (pytest.approx(pressure_latitude) if pressure_latitude else None)
    assert sample in cast_samples.SAMPLES[cast.format]


def test_windows_line_ends(read):
    assert read(cast_samples.SEABIRD.replace("\n", "\r\n")).profile == read(cast_samples.SEABIRD).profile


def test_teos_10_instead_of_the_files_speed(read):
    cast = read(cast_samples.SEABIRD, sound_speed="teos-10")
    assert cast.sound_speed_source == "teos-10"
    np.testing.assert_allclose(cast.profile.sound_speed[1:], [1490.81, 1489.51, 1485.51], atol=0.06)
    assert not np.array_equal(cast.profile.sound_speed, read(cast_samples.SEABIRD).profile.sound_speed)
    with pytest.raises(ValueError, match="cannot be computed by TEOS-10, for it has no salinity"):
        read(cast_samples.VALEPORT, sound_speed="teos-10")


def test_table_of_a_ctd(read):
    cast = read(cast_samples.CTD_TABLE)
    assert cast.sound_speed_source == "teos-10" and cast.pressure_latitude == 45
    np.testing.assert_allclose(cast.profile.depth, -gsw.z_from_p([0.5, 2, 9], 45), atol=1e-12)
    np.testing.assert_allclose(cast.salinity, gsw.SP_from_C([36.9, 36.8, 36.5], [11, 10.5, 9], [0.5, 2, 9]))


def test_columns_of_a_table_that_are_not_needed_may_be_anything(read):
    cast = read("depth,pressure (bar),conductivity,cond2,sound_speed\n0,,,,1500\n5,x,,,1490\n")
    assert list(cast.profile.depth) == [0, 5] and cast.salinity is None


@pytest.mark.parametrize("columns, expected", [
    ({}, (1, 10, 35)),
    ({"pressure": "prM: Pressure [db]"}, (1, 10, 35)),
    ({"pressure": "prdE: Pressure, Strain Gauge [psi]"}, (0.6894757, 10, 35)),
    ({"pressure": "depFM: Depth [fresh water, m]"}, (1 / 1.019716, 10, 35)),
    ({"temperature": "t068C: Temperature [IPTS-68, deg C]"}, (1, 10 / 1.00024, 35)),
    ({"salinity": "c0S/m: Conductivity [S/m]", "s": 3.9}, (1, 10, float(gsw.SP_from_C(39, 10, 1)))),
    ({"salinity": "c0mS/cm: Conductivity [mS/cm]", "s": 39}, (1, 10, float(gsw.SP_from_C(39, 10, 1)))),
    ({"salinity": "c0uS/cm: Conductivity [uS/cm]", "s": 39000}, (1, 10, float(gsw.SP_from_C(39, 10, 1)))),
], ids=["digiquartz", "plain", "psi", "fresh", "ipts-68", "s/m", "ms/cm", "us/cm"])
def test_names_and_units_of_sea_bird(read, columns, expected):
    pressure, temperature, salinity = expected
    cast = read(CNV.format(**{**CNV_COLUMNS, **columns}))
    assert cast.profile.depth[0] == pytest.approx(-gsw.z_from_p(pressure, 45), abs=1e-9)
    assert cast.temperature[0] == pytest.approx(temperature) and cast.salinity[0] == pytest.approx(salinity, abs=1e-6)


def test_sea_bird_depth_where_there_is_no_pressure(read):
    cast = read(CNV.format(**{**CNV_COLUMNS, "pressure": "depSM: Depth [salt water, m]"}))
    assert list(cast.profile.depth) == [1, 5] and cast.pressure_latitude is None


def test_aml_without_a_fix(read):
    cast = read(cast_samples.AML_NEWER.replace("54.175", "0.000000").replace("-7.5", "0.000000"))
    assert cast.latitude is None and cast.longitude is None and cast.pressure_latitude == 45


def test_valeport_in_metres(read):
    cast = read(cast_samples.VALEPORT.replace("units: dBar", "units: m"))
    np.testing.assert_allclose(cast.profile.depth, DEPTH, atol=1e-12)


@pytest.mark.parametrize("text, degrees", [
    ("54.175", 54.175), ("-54:10:30", -54.175), ("54 10.5 N", 54.175), ("54 10 30 S", -54.175), ("S 54 10.5", -54.175),
    ("54\N{DEGREE SIGN}10'30\" N", 54.175), ("-0:30:00", -0.5), ("No-Lock", None), ("", None), ("91", None),
    ("10 75", None), ("nan", None),
])
def test_positions(text, degrees):
    assert fields.position(text, "latitude") == (None if degrees is None else pytest.approx(degrees))
