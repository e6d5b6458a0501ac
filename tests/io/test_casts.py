"""Casts read from files: every format by its content, and every fault in one sentence."""
import datetime
from pathlib import Path

import numpy as np
import pytest

from mitsonar.io import casts
from mitsonar.water import SoundSpeedProfile, sound_speed

MEASURED = Path(__file__).resolve().parents[2] / ".." / "shared" / "data" / "profiles"
PROFILE = SoundSpeedProfile([0, 5, 12.5], [1508, 1507.5, 1499])
CARIS = """[SVP_VERSION_2]
two_casts.svp
Section 2020-036 18:26:00 37:51:03.40 -122:27:53.70
5.0 1507.5
0.0 1508.0
12.5 1498.0
12.5 1500.0
Section 2020-037 06:00:30 -00:30:00 010:15:00 Created: 2020-037
1.0 1490.0
"""
CASTAWAY = """% Device,11E101663
% Cast time (UTC),2012-08-21 12:28:17
% Start latitude,43.5
% Start longitude,
%
Depth (Meter),Temperature (Celsius),Salinity (Practical Salinity Scale),Sound velocity (Meters per Second)
0.0,18.0,31.0,1508.0
5.0,17.0,32.0,1507.5
12.5,12.0,33.0,1499.0
"""


@pytest.fixture
def write(tmp_path):
    def write(content, encoding="utf-8"):
        path = tmp_path / "cast.any"
        path.write_text(content, encoding=encoding)
        return path

    return write


@pytest.mark.parametrize("content", [
    "0,1508\n5,1507.5\n12.5,1499\n",
    "depth,sound_speed\n0,1508\n5,1507.5\n12.5,1499\n",
    "Depth (m);Sound Velocity (m/s)\n0;1508\n5;1507,5\n12,5;1499\n",
    "# a comment\n\n0\t1508\n5\t1507.5  # another\n12.5\t1499",
    "Depth_m  SV\r\n 0  1508\r\n 5  1507.5\r\n 12.5  1499\r\n",
    "Station, c, z\nA,1508,0\nB,1507.5,5\nC,1499,12.5\n",
    "0,1508,\n5,1507.5,\n12.5,1499,\n",
], ids=["bare", "header", "semicolons", "tabs", "spaces", "order", "trailing"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_plain_table(write, content, encoding):
    cast = casts.read(write(content, encoding))
    assert cast.profile == PROFILE and cast.format == "table of depth and sound speed"


def test_plain_table_keeps_temperature_and_salinity(write):
    cast = casts.read(write("depth,temperature (deg C),salinity (psu),sound_speed\n0,18,31,1508\n5,17,32,1507.5\n"))
    assert list(cast.temperature) == [18, 17] and list(cast.salinity) == [31, 32]


def test_caris_sorts_merges_and_places_a_cast(write):
    cast = casts.read(write(CARIS))
    assert cast.profile == PROFILE and cast.sections == 2
    assert cast.time == datetime.datetime(2020, 2, 5, 18, 26, tzinfo=datetime.timezone.utc)
    assert cast.latitude == pytest.approx(37 + 51 / 60 + 3.4 / 3600)
    assert cast.longitude == pytest.approx(-(122 + 27 / 60 + 53.7 / 3600))


def test_caris_gives_the_section_asked_for(write):
    cast = casts.read(write(CARIS), section=1)
    assert cast.profile == SoundSpeedProfile([1], [1490])
    assert (cast.latitude, cast.longitude) == (-0.5, 10.25)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_castaway(write, encoding):
    cast = casts.read(write(CASTAWAY, encoding))
    assert cast.profile == PROFILE and cast.format == "CastAway CSV"
    assert list(cast.temperature) == [18, 17, 12] and list(cast.salinity) == [31, 32, 33]
    assert cast.latitude == 43.5 and cast.longitude is None
    assert cast.time == datetime.datetime(2012, 8, 21, 12, 28, 17, tzinfo=datetime.timezone.utc)


@pytest.mark.parametrize("content, message", [
    ("depth,speed\n0,1508\n5,nan\n", "line 3: sound speed is nan"),
    ("depth,speed\n0,1508\nnan,1500\n", "line 3: depth is nan"),
    ("0,1508\n\n5,fast\n", "line 3: sound speed is fast"),
    ("depth,speed\n0,1508\n5\n", "line 3: sound speed is missing"),
    ("depth,speed\n0,unknown\n", "line 2: sound speed is unknown"),
    ("depth,speed\n0,1508\n5,1507\n4,1506\n", "line 4: depth 4 m follows 5 m"),
    ("0,1508\n5,1507\n5,1506\n", "line 3: depth 5 m follows 5 m"),
    ("0,1508\n-5,1507\n", "line 2: depth -5 m follows 0 m; depths are positive down"),
    ("0,1508\n5,15070\n", "line 2: sound speed 15070 m/s is outside"),
    ("0,1508,3\n5,1507,3\n", "line 1 has 3 columns"),
    ("Tiefe,Schall\n0,1508\n", "must name depth and sound_speed"),
    ("Depth (ft),SV\n0,1508\n", "depth is given in 'ft'; convert it to m"),
    ("depth,speed\n", "holds no samples"),
    ("", "is empty"),
    ("# only a comment\n", "is empty"),
    ("Now: 05/06/2013\nBattery level\n", "CARIS SVP, CastAway CSV, .*, table of depth and sound speed"),
    ("[SVP_VERSION_2]\nname\n", "holds 0"),
    (CARIS.replace("1507.5", "?"), r"line 4: sound speed is \?"),
    (CASTAWAY.replace("Depth (Meter)", "Depth (Feet)"), r"no column 'Depth \(Meter\)'"),
    (CASTAWAY.replace("1507.5", "0"), "line 8: sound speed 0 m/s"),
])
def test_faults_are_told_in_one_sentence(write, content, message):
    path = write(content)
    with pytest.raises(ValueError, match=message) as error:
        casts.read(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_absent_sections_are_refused(write):
    with pytest.raises(ValueError, match="section 2 does not exist; the file holds 2"):
        casts.read(write(CARIS), section=2)
    with pytest.raises(ValueError, match="one cast per file"):
        casts.read(write(CASTAWAY), section=1)


def test_binary_files_and_folders_are_refused(tmp_path):
    (tmp_path / "noise").write_bytes(bytes(range(256)))
    for path in (tmp_path, tmp_path / "noise"):
        with pytest.raises(ValueError, match="cannot read the cast"):
            casts.read(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        casts.read(tmp_path / "absent.csv")


@pytest.mark.parametrize("name, nodes, first, last", [
    ("castaway_11E101663_20120821.csv", 75, 1512.62986572, 1491.74608368),
    ("castaway_10M100491_20120222.csv", 80, 1489.10132097, 1489.69781239),
    ("2020_036_182635.svp", 24, 1487.619079, 1491.519287),
])
def test_measured_casts(name, nodes, first, last):
    if not MEASURED.is_dir():
        pytest.skip(f"the measured casts are not beside the checkout ({MEASURED})")
    cast = casts.read(MEASURED / name)
    assert cast.profile.depth.size == nodes
    np.testing.assert_allclose(cast.profile.sound_speed[[0, -1]], [first, last], atol=1e-7)
    if cast.temperature is not None:
        # The instrument uses Chen and Millero, we TEOS-10: they differ by up to 0.1 m/s in shallow water.
        teos = sound_speed(cast.temperature, cast.salinity, cast.profile.depth, latitude=43.0)
        np.testing.assert_allclose(teos, cast.profile.sound_speed, atol=0.1)
