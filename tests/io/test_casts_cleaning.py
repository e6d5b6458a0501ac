"""What is kept of a recording, how a cast goes on below its deepest sample, and the measured files by eye."""
import dataclasses

import cast_samples
import numpy as np
import pytest
from test_casts import MEASURED

from mitsonar.io import casts
from mitsonar.io.casts import completion
from mitsonar.io.casts.records import Samples
from mitsonar.water import sound_speed


def recording(depth, speed=1500.0, **columns):
    depth = np.asarray(depth, float)
    columns = {"depth": depth, "sound speed": np.broadcast_to(speed, depth.shape).astype(float), **columns}
    return Samples(lines=np.arange(depth.size) + 1, columns=columns, state="recorded")


def counts(cleaned):
    samples, counted = cleaned
    values = dataclasses.asdict(counted)
    assert values.pop("read") - sum(values.values()) == samples.lines.size
    return {name: count for name, count in values.items() if count}


def test_a_plain_way_down_is_kept_as_it_is():
    samples = recording(np.arange(1, 9.0), 1500 + np.arange(8))
    after, counted = completion.cleaned(samples)
    assert counted == casts.Cleaning(read=8)
    assert all(np.array_equal(after.columns[what], samples.columns[what]) for what in samples.columns)


def test_way_up_air_and_heave_go():
    depth = [0, 0, 1, 2, 3, 2.9, 3.5, 4, 6, 5, 3, 1, 0]
    speed = [0, 340, *[1500] * 10, 0]
    cleaned = completion.cleaned(recording(depth, speed))
    assert counts(cleaned) == {"in_air": 3, "upcast": 3, "reversals": 1}
    assert list(cleaned[0].columns["depth"]) == [1, 2, 3, 3.5, 4, 6]


def test_the_soak_goes_from_its_last_turn():
    down = np.arange(1, 30.0)
    cleaned = completion.cleaned(recording([0.3, *[1.5] * 20, 1.0, 0.8, 0.6, 0.7, *down]))
    assert counts(cleaned) == {"soak": 23}
    assert list(cleaned[0].columns["depth"]) == [0.6, 0.7, *down]


def test_neither_heave_further_down_nor_one_wrong_pressure_is_a_soak():
    depth = [0.5, 1, 2, 3, 4, 5, 4.6, 4.2, 4.5, 6, 7, 8, 0.1, 9, 10]
    cleaned = completion.cleaned(recording(depth))
    assert counts(cleaned) == {"reversals": 4}
    assert cleaned[0].columns["depth"][0] == 0.5


@pytest.mark.parametrize("wrong", [900.0, -15.0])
def test_a_wrong_pressure_is_neither_the_deepest_sample_nor_a_turn(wrong):
    depth = np.r_[np.arange(1, 30.0), np.arange(29, 0, -1.0)]
    depth[10] = wrong
    cleaned = completion.cleaned(recording(depth))
    assert counts(cleaned) == {"spikes": 1, "upcast": 29}
    assert cleaned[0].columns["depth"].size == 28


def test_a_cell_half_full_of_water_is_in_air_and_a_fresh_layer_is_not():
    conductivity = np.array([1.0, 10, 3, 40, 40, 40])
    cleaned = completion.cleaned(recording([0.1, 0.2, 0.8, 2, 3, 4], conductivity=conductivity))
    assert counts(cleaned) == {"in_air": 2}
    assert cleaned[0].columns["conductivity"][0] == 3


def test_samples_at_one_depth_are_averaged():
    cleaned = completion.cleaned(recording([1, 1.02, 1.04, 1.06, 2, 2, 3], [1500, 1501, 1502, 1510, 1490, 1492, 1488]))
    assert counts(cleaned) == {"merged": 3}
    np.testing.assert_allclose(cleaned[0].columns["depth"], [1.02, 1.06, 2, 3])
    np.testing.assert_allclose(cleaned[0].columns["sound speed"], [1501, 1510, 1491, 1488])


@pytest.mark.parametrize("depth, speed, words", [
    ([9, 7, 5, 3, 1], 1500, r"no way down: before its deepest sample \(line 1\) it has 9..9 m of 1..9 m"),
    ([20, 21, 15, 10, 1], 1500, "no way down"),
    ([0, 1, 2], 0, "all 3 samples were taken in air"),
    ([0, 0.1, 0.2], 1500, "within 0.5 m of the surface"),
])
def test_recordings_of_no_use(depth, speed, words):
    with pytest.raises(ValueError, match=words):
        completion.cleaned(recording(depth, speed))


@pytest.fixture
def sample(tmp_path):
    """Write a sample and read it with choices."""
    def sample(content, **choices):
        path = tmp_path / "cast.any"
        path.write_text(content, encoding="utf-8")
        return casts.read(path, **choices)

    return sample


def test_constant_extension_adds_nothing(sample):
    cast = sample(cast_samples.CASTAWAY)
    assert cast.extension == "constant" and cast.measured == cast.profile.depth.size == 3
    assert cast.profile.at(5000) == cast.profile.sound_speed[-1]


def test_gradient_extension_is_mixed_water_at_rising_pressure(sample):
    plain, cast = (sample(cast_samples.CASTAWAY, extension=extension) for extension in ("constant", "gradient"))
    assert cast.measured == 3 and cast.profile.depth[-1] == 12000
    assert np.array_equal(cast.profile.depth[:3], plain.profile.depth)
    below = np.array([20.0, 137.0, 900.0, 5100.0, 12000.0])
    water = sound_speed(9.0, 34.0, np.r_[8.9, below], 54.175, -7.5)
    np.testing.assert_allclose(cast.profile.at(below), 1486.2 + water[1:] - water[0], atol=0.005)
    assert set(cast.temperature[3:]) == {9.0} and set(cast.salinity[3:]) == {34.0}
    assert cast.temperature.shape == cast.salinity.shape == cast.profile.depth.shape


def test_gradient_extension_without_temperature_and_salinity(sample):
    cast = sample(cast_samples.HYPACK, extension="gradient")
    assert cast.temperature is None and cast.salinity is None
    assert cast.profile.gradient(100.0) == pytest.approx(0.0164, abs=1e-4)


def test_extension_of_a_cast_that_reaches_the_deepest_sea(sample):
    cast = sample(cast_samples.KONGSBERG.replace("9.00 1486", "12000.00 1670"), extension="gradient")
    assert cast.measured == cast.profile.depth.size == 3


@pytest.mark.parametrize("choice", [{"sound_speed": "guess"}, {"extension": "slope"}])
def test_unknown_choices(sample, choice):
    with pytest.raises(ValueError, match="is unknown; use one of"):
        sample(cast_samples.CARIS, **choice)


# name, nodes, first and last depth, first and last speed, and what the cleaning took; counted in the files by eye
MEASURED_CASTS = [
    ("20120321_224205.asvp", 35, 0.0, 12000.0, 1531.40, 1675.82, {}),
    ("2020_036_182635.svp", 24, 0.031, 23.031, 1487.619, 1491.519, {}),
    ("hypack_20190819.vel", 35, 0.0, 54.2, 1504.92, 1510.04, {"merged": 1}),
    ("castaway_11E101663_20120821.csv", 75, 0.150, 22.357, 1512.630, 1491.746, {}),
    ("castaway_10M100491_20120222.csv", 80, 0.149, 23.764, 1489.101, 1489.698, {}),
    # 24 rows: one in air, deepest 12.24 dbar in row 13
    ("aml_025485_2019-04-29.csv", 12, 1.062, 12.142, 1468.07, 1469.80, {"in_air": 1, "upcast": 11}),
    # 629 rows: 6 with sound speed 0, deepest 40.602 m in row 216
    ("valeport_minisvp_V000056.txt", 211, 0.1355, 40.582, 1522.570, 1511.2595,
     {"in_air": 6, "upcast": 410, "merged": 2}),
    # 261 rows: soak at 1.1 dbar, up again to 0.86, deepest 8.645 dbar
    ("seabird_SBE19Plus_2013_192.cnv", 46, 0.868, 8.575, 1515.861, 1514.890,
     {"in_air": 37, "upcast": 59, "soak": 99, "merged": 20}),
]


@pytest.mark.parametrize("name, nodes, top, bottom, first, last, taken", MEASURED_CASTS,
                         ids=[row[0] for row in MEASURED_CASTS])
def test_measured_files(name, nodes, top, bottom, first, last, taken):
    if not MEASURED.is_dir():
        pytest.skip(f"the measured casts are not beside the checkout ({MEASURED})")
    cast = casts.read(MEASURED / name)
    assert cast.profile.depth.size == nodes
    np.testing.assert_allclose(cast.profile.depth[[0, -1]], [top, bottom], atol=1e-3)
    np.testing.assert_allclose(cast.profile.sound_speed[[0, -1]], [first, last], atol=1e-3)
    counted = dataclasses.asdict(cast.cleaning)
    assert {what: count for what, count in counted.items() if count and what != "read"} == taken
    assert counted["read"] == nodes + sum(taken.values())
    if cast.temperature is not None and cast.salinity is not None:
        # Instruments compute it by Chen and Millero, which TEOS-10 follows within 0.1 m/s in shallow water.
        teos = casts.read(MEASURED / name, sound_speed="teos-10").profile.sound_speed
        np.testing.assert_allclose(teos, cast.profile.sound_speed, atol=0.1)
