"""The medium `seawater`: which attribute decides what, and what it refuses.

The formulas are tested in tests/water; here only their way through the attributes, exactly.
"""
import functools

import numpy as np
import pytest

from mitsonar.water import SoundSpeedProfile, absorption_db, ambient_noise_db, sound_speed
from mitsonar.water.seawater import FORMULAS

FREQUENCY = 400e3
CASTAWAY = """% Device,CC1234567
% Cast time (UTC),2012-08-21 10:11:12
% Start latitude,44.1
% Start longitude,-68.5

Pressure (Decibar),Depth (Meter),Temperature (Celsius),Conductivity (MicroSiemens per Centimeter),\
Specific conductance (MicroSiemens per Centimeter),Salinity (Practical Salinity Scale),\
Sound velocity (Meters per Second),Density (Kilograms per Cubic Meter)
0.5,0.5,15.0,39000,48000,31.0,1502.0,1022.9
10.0,9.9,9.0,34000,49000,32.0,1482.0,1024.8
"""


@pytest.fixture
def water(make):
    """Make a medium of attributes."""
    return functools.partial(make, "seawater")


def absorption(medium, depth):
    return medium.absorption_column(FREQUENCY).at(depth)


def test_sound_speed_from_temperature_and_salinity(water):
    profile = water(temperature=4.0, salinity=34.0).profile
    assert np.array_equal(profile.sound_speed, sound_speed(4.0, 34.0, profile.depth))
    assert profile.depth[0] == 0 and profile.depth[-1] == 6000
    assert water().profile == water(temperature=10.0, salinity=35.0).profile


def test_sound_speed_given(water):
    assert water(sound_speed=1480).profile == SoundSpeedProfile([0], [1480])
    assert water(profile="0:1500, 10:1490").profile == SoundSpeedProfile([0, 10], [1500, 1490])


def test_cast_without_temperature(water, tmp_path):
    path = tmp_path / "cast.csv"
    path.write_text("depth,speed\n0,1500\n20,1480\n")
    medium = water(cast=str(path), temperature=4.0, ph=7.7)
    assert medium.profile == SoundSpeedProfile([0, 20], [1500, 1480])
    assert absorption(medium, 50) == pytest.approx(absorption_db(FREQUENCY, 4.0, 35.0, 50, 7.7), rel=1e-12)


def test_cast_with_temperature_and_salinity_sets_absorption(water, tmp_path):
    path = tmp_path / "cast.csv"
    path.write_text(CASTAWAY)
    medium = water(cast=str(path), temperature=30.0, ph=8.1)
    depth = medium.profile.depth
    assert np.array_equal(medium.profile.sound_speed, [1502, 1482])
    wanted = absorption_db(FREQUENCY, [15, 9], [31, 32], depth, 8.1)
    assert absorption(medium, depth) == pytest.approx(wanted, rel=1e-12)


def test_sound_speed_and_extension_of_a_cast(water, tmp_path):
    path = tmp_path / "cast.csv"
    path.write_text(CASTAWAY)
    computed = water(cast=str(path), cast_sound_speed="teos-10").profile
    np.testing.assert_allclose(computed.sound_speed, sound_speed([15, 9], [31, 32], [0.5, 9.9], 44.1, -68.5))
    medium = water(cast=str(path), cast_extension="gradient", ph=8.1)
    assert medium.profile.at(9.9) == 1482 and medium.profile.gradient(1000.0) == pytest.approx(0.0166, abs=1e-4)
    assert absorption(medium, 500) == pytest.approx(absorption_db(FREQUENCY, 9, 32, 500, 8.1), rel=1e-3)


def test_sound_speed_at_the_head_is_a_node_of_the_profile(water, tmp_path):
    head = {"head_sound_speed": 1495.0, "head_depth": 4.0}
    given = water(profile="0:1500, 10:1490, 30:1480", **head).profile
    assert given == SoundSpeedProfile([0, 4, 10, 30], [1500, 1495, 1490, 1480])
    path = tmp_path / "cast.csv"
    path.write_text(CASTAWAY)
    medium = water(cast=str(path), **head)
    assert medium.profile == SoundSpeedProfile([0.5, 4, 9.9], [1502, 1495, 1482])
    # Temperature and salinity are the cast's: the sensor says nothing of absorption.
    depth = [0.5, 5.0, 9.9]
    assert np.array_equal(absorption(medium, depth), absorption(water(cast=str(path)), depth))
    assert water(**head).profile.at(4.0) == 1495 and water(**head).profile.at(500.0) == water().profile.at(500.0)


def test_absorption_given_is_the_same_everywhere(water):
    assert absorption(water(absorption_db_per_km=30), [0, 10, 5000]) == pytest.approx([0.03] * 3, rel=1e-15)
    assert absorption(water(absorption_db_per_km=0), 10) == 0
    table = water(absorption_db_per_km="0:30, 20:50")
    assert absorption(table, [-1, 0, 5, 20, 90]) == pytest.approx([0.03, 0.03, 0.035, 0.05, 0.05], rel=1e-15)
    assert table.mean_absorption(0, 20) is None


@pytest.mark.parametrize("formula", FORMULAS)
def test_sound_speed_formula(water, formula):
    profile = water(sound_speed_formula=formula, temperature=4.0, salinity=34.0).profile
    assert np.array_equal(profile.sound_speed, sound_speed(4.0, 34.0, profile.depth, formula=formula))
    assert profile.depth[-1] == (1000 if formula == "medwin" else 6000)


@pytest.mark.parametrize("formula", ["francois-garrison", "ainslie-mccolm", "thorp"])
def test_absorption_formula(water, tmp_path, formula):
    wanted = absorption_db(FREQUENCY, 4.0, 35.0, 50, 7.7, formula)
    medium = water(absorption_formula=formula, temperature=4.0, ph=7.7)
    assert absorption(medium, 50) == pytest.approx(wanted, rel=1e-12)
    path = tmp_path / "cast.csv"
    path.write_text(CASTAWAY)
    medium = water(cast=str(path), absorption_formula=formula)
    depth = medium.profile.depth
    wanted = absorption_db(FREQUENCY, [15, 9], [31, 32], depth, 8.0, formula)
    assert absorption(medium, depth) == pytest.approx(wanted, rel=1e-12)


def test_noise(water):
    assert water(wind_speed=9.0, shipping=0.1).noise_level_db(FREQUENCY) == ambient_noise_db(FREQUENCY, 9.0, 0.1)
    assert water().noise_level_db(FREQUENCY) == ambient_noise_db(FREQUENCY, 5.0, 0.5)


@pytest.mark.parametrize("one, other", [("profile", "sound_speed"), ("cast", "sound_speed"), ("profile", "cast")])
def test_only_one_kind_of_sound_speed(refusal, tmp_path, one, other):
    (tmp_path / "c.csv").write_text("depth,speed\n0,1500\n9,1490\n", encoding="utf-8")
    values = {"profile": "0:1500, 9:1490", "cast": str(tmp_path / "c.csv"), "sound_speed": 1500.0}
    said = refusal("seawater", **{name: values[name] for name in (one, other)})
    assert said == f"seawater: {one} and {other} are given; give one of them."


@pytest.mark.parametrize("attributes, words", [
    ({"temperature": 41.0}, "temperature is 41 deg C; it must lie in -2..40 deg C"),
    ({"salinity": -1.0}, "salinity is -1 g/kg"),
    ({"ph": 3.0}, "ph is 3; it must lie in 7..9"),
    ({"wind_speed": -1.0}, "wind_speed is the float -1.0; expected a number [m/s] at least 0"),
    ({"shipping": 2.0}, "shipping is the float 2.0; expected a number at least 0 and at most 1"),
    ({"absorption_db_per_km": -1.0}, "absorption must be finite and not negative"),
    ({"absorption_db_per_km": "5:30, 2:40"}, "depths increasing"),
    ({"absorption_db_per_km": "thirty"}, 'a number or a table of finite numbers'),
    ({"sound_speed": 3000.0}, "expected a number [m/s] above 300.0 and below 3000.0"),
    ({"profile": "0:1500, 0:1490"}, "sort the nodes and merge repeated depths"),
    ({"cast_extension": "gradient"}, "cast_extension is given without a cast"),
    ({"cast_sound_speed": "teos10"}, 'expected one of "file", "teos-10" (did you mean "teos-10"?)'),
    ({"cast": "no.csv"}, 'cast names the file "no.csv", which is not there'),
    ({"sound_speed_formula": "makenzie"}, 'did you mean "mackenzie"?'),
    ({"absorption_formula": "thorpe"}, 'expected one of "francois-garrison", "ainslie-mccolm", "thorp" (did you mean'),
    ({"sound_speed_formula": "mackenzie", "salinity": 5.0}, "mackenzie: salinity is 5 g/kg; it must lie in 30.."),
    ({"sound_speed_formula": "medwin", "sound_speed": 1500.0}, "sound_speed and sound_speed_formula are given"),
    ({"absorption_formula": "thorp", "absorption_db_per_km": 30.0}, "absorption_formula and absorption_db_per_km are"),
    ({"head_sound_speed": 1490.0}, "head_sound_speed is given without head_depth; give both."),
    ({"head_depth": 4.0}, "head_depth is given without head_sound_speed; give both."),
    ({"head_depth": 4.0, "head_sound_speed": 1490.0, "sound_speed": 1500.0}, "give a profile or a cast"),
    ({"head_depth": 50.0, "head_sound_speed": 1490.0, "profile": "0:1500, 10:1490"}, "not above the last of the"),
    ({"head_depth": -1.0, "head_sound_speed": 1490.0}, "at least 0"),
    ({"salt": 1.0}, 'did you mean "salinity"?'),
])
def test_refusals(refusal, attributes, words):
    assert words in refusal("seawater", **attributes)


def test_light_passes(water):
    import mitsuba as mi

    medium = water()
    place = mi.MediumInteraction3f()
    for value in (medium.get_majorant(place), *medium.get_scattering_coefficients(place)):
        assert not np.any(np.array(value))
    assert str(medium).startswith("Seawater[")


def test_volume_is_read_as_a_number_a_table_and_layers(make):
    assert make("seawater").volume is None
    np.testing.assert_allclose(make("seawater", volume_strength_db=-70.0).volume.strength_db_at([0, 500]), -70)
    table = make("seawater", volume_strength_db="0:-60, 30:-75", layers="fish 20 35; kelp 5 12 -50").volume
    np.testing.assert_allclose(table.strength_db_at([0.0, 30.0]),
                               [-60, 10 * np.log10(10**-7.5 + 10**-7.0)], rtol=1e-12)
    assert [layer.name for layer in table.layers] == ["fish", "kelp"]


@pytest.mark.parametrize("attributes, said", [
    ({"volume_strength_db": 20.0}, "strength is 20 dB"), ({"layers": "kelp 5"}, 'is not "name top bottom dB"'),
    ({"volume_strength_db": "30:-60, 0:-75"}, "depths must be finite and increase"),
    ({"volume_strength_db": True}, "volume_strength_db is the boolean true; expected a number or a table"),
])
def test_volume_that_makes_no_sense_is_refused(refusal, attributes, said):
    assert said in refusal("seawater", **attributes)
