"""Arrays as attributes describe them: every kind against its maker in Python, and the sentences about bad ones.

The attributes are given to the reader as Mitsuba gives them to a sensor. Exact but for rounding, 1e-12.
"""
import numpy as np
import pytest

from mitsonar.sonar import cylindrical_array, element_array, line_array, mills_cross, planar_array, spherical_array

mi = pytest.importorskip("mitsuba")
ROUNDING = 1e-12


@pytest.fixture
def read(variant):
    """Read an array of attributes; whatever is left over is refused, as by a sensor."""
    from mitsonar.plugins.attributes import Attributes
    from mitsonar.plugins.sensors.array_attributes import ARRAYS
    from mitsonar.plugins.sensors.array_reading import read_array

    def run(prefix="receive", hint=1500.0, frequency=100e3, **written):
        props = mi.Properties("sonar")
        for name, value in written.items():
            props[name] = value
        return read_array(Attributes(props, (ARRAYS,)), prefix, hint, frequency=frequency)
    return run


@pytest.fixture
def refused(read):
    """Return the sentence about attributes that must be refused; it names the plugin."""
    def run(**written):
        with pytest.raises(ValueError) as caught:
            read(**written)
        said = str(caught.value)
        assert said.startswith("sonar: ") and "\n" not in said
        return said
    return run


def same(array, wanted):
    for name in ("position", "normal", "along", "weight", "delay"):
        np.testing.assert_allclose(getattr(array, name), getattr(wanted, name), atol=ROUNDING, err_msg=name)
    assert [getattr(array, name) for name in ("length", "height", "pattern", "baffle", "layout")] == [
        getattr(wanted, name) for name in ("length", "height", "pattern", "baffle", "layout")]


KINDS = {
    "nothing": ({}, element_array([0, 0, 0])),
    "point": ({"receive": "point", "receive_normal": "starboard"}, element_array([0, 0, 0], normal="starboard")),
    "line": ({"receive": "line", "receive_elements": 64, "receive_pitch": 0.01}, line_array(64, 0.01)),
    "half a wavelength": ({"receive": "line", "receive_elements": 4}, line_array(4, 0.0075)),
    "line that hangs": ({"receive": "line", "receive_elements": 4, "receive_axis": "down"},
                        line_array(4, 0.0075, axis="down", normal="forward")),
    "vectors": ({"receive": "line", "receive_elements": 4, "receive_axis": "1, 1, 0", "receive_normal": "0 -1 2"},
                line_array(4, 0.0075, axis=(1, 1, 0), normal=(0, -1, 2))),
    "planar": ({"receive": "planar", "receive_elements": 5, "receive_rows": 3, "receive_pitch": 0.1,
                "receive_row_pitch": 0.2, "receive_normal": "forward"},
               planar_array(5, 3, 0.1, row_pitch=0.2, normal="forward")),
    "cylindrical": ({"receive": "cylindrical", "receive_elements": 12, "receive_radius": 0.3, "receive_rows": 2,
                     "receive_row_pitch": 0.05, "receive_aperture_deg": 120.0},
                    cylindrical_array(12, 0.3, rows=2, row_pitch=0.05, aperture=np.radians(120))),
    "cylindrical by pitch": ({"receive": "cylindrical", "receive_elements": 12, "receive_pitch": 0.02},
                             cylindrical_array(12, 12 * 0.02 / (2 * np.pi))),
    "spherical": ({"receive": "spherical", "receive_elements": 40, "receive_radius": 0.2, "receive_normal": "up"},
                  spherical_array(40, 0.2, normal="up")),
    "spherical by pitch": ({"receive": "spherical", "receive_elements": 40, "receive_aperture_deg": 180},
                           spherical_array(40, 0.0075 * np.sqrt(40 / (2 * np.pi)), aperture=np.pi)),
}


@pytest.mark.parametrize("kind", KINDS)
def test_kinds(read, kind):
    written, wanted = KINDS[kind]
    same(read(**written), wanted)


def test_every_kind_is_tested(variant):
    from mitsonar.plugins.sensors import array_attributes, array_reading

    assert {written.get("receive", "point") for written, _ in KINDS.values()} == set(array_reading.KINDS) - {"file"}
    assert set(array_reading.KINDS) == set(array_attributes.ALL_KINDS)


def test_two_arrays_of_one_sensor(read):
    written = {"transmit": "line", "transmit_elements": 8, "transmit_axis": "forward", "receive": "line",
               "receive_elements": 16, "receive_axis": "starboard"}
    from mitsonar.plugins.attributes import Attributes
    from mitsonar.plugins.sensors.array_attributes import ARRAYS
    from mitsonar.plugins.sensors.array_reading import read_array

    props = mi.Properties("sonar")
    for name, value in written.items():
        props[name] = value
    attributes = Attributes(props, (ARRAYS,))
    found = [read_array(attributes, prefix, frequency=100e3) for prefix in ("transmit", "receive")]
    for array, wanted in zip(found, mills_cross(8, 16, 0.0075), strict=True):
        same(array, wanted)


def test_file(read, tmp_path):
    path = tmp_path / "hull.csv"
    path.write_text("x,y,z,weight\n0,0.1,0,1\n0,0.3,0.1,0.5\n")
    same(read(receive="file", receive_file=str(path), receive_normal="starboard", receive_pattern="circular",
              receive_element_length=0.02),
         element_array([[0, 0.1, 0], [0, 0.3, 0.1]], normal="starboard", weight=[1, 0.5], pattern="circular",
                       length=0.02))


def test_faces(read):
    face = {"receive_element_length": 0.1, "receive_element_height": 0.02, "receive_baffle": "hard"}
    same(read(**face), element_array([0, 0, 0], length=0.1, height=0.02, pattern="rectangular", baffle="hard"))
    same(read(receive_element_length=0.1, receive_pattern="circular"),
         element_array([0, 0, 0], length=0.1, pattern="circular"))


LINE = {"receive": "line", "receive_elements": 16}
PLAIN = line_array(16, 0.0075)


def test_shading_and_failures(read):
    same(read(**LINE, receive_shading="chebwin 30", receive_failed="3, 15"),
         PLAIN.shaded(("chebwin", 30)).failing([3, 15]))
    same(read(receive="planar", receive_elements=16, receive_rows=8, receive_shading="taylor 4 35, hamming"),
         planar_array(16, 8, 0.0075).shaded(("taylor", 4, 35), "hamming"))


def test_steering_and_focus(read):
    """Azimuth 90, depression 30 is (0, cos 30, sin 30), sin 30 = 1/2."""
    towards = np.array([0, np.sqrt(0.75), 0.5])
    same(read(**LINE, receive_steer_deg="90, 30", hint=1480.0, receive_pitch=0.0075), PLAIN.steered(towards, 1480.0))
    same(read(**LINE, receive_steer_deg="90, 30", receive_focus=5.0), PLAIN.focused(5 * towards, 1500.0))
    same(read(**LINE, receive_focus=5.0), PLAIN.focused([0, 0, 5], 1500.0))


def test_jitter_is_unknown_to_the_steering_and_differs_between_arrays(read):
    jittered = {"elements": 16, "jitter": 1e-3, "steer_deg": "90, 30"}
    arrays = [read(prefix=prefix, **{prefix: "line"}, **{f"{prefix}_{name}": value for name, value in jittered.items()})
              for prefix in ("receive", "transmit")]
    moves = [array.position - PLAIN.position for array in arrays]
    assert np.std(moves) == pytest.approx(1e-3, rel=0.2) and not np.allclose(*moves)
    for array in arrays:
        np.testing.assert_allclose(array.delay, PLAIN.steered([0, np.sqrt(0.75), 0.5], 1500.0).delay)
    numbered = [read(**LINE, receive_jitter=1e-3, receive_jitter_seed=seed).position for seed in (1, 1, 2)]
    assert np.array_equal(numbered[0], numbered[1]) and not np.allclose(numbered[0], numbered[2])


def test_offset_leaves_the_steering_as_it_is(read):
    offset = mi.ScalarPoint3f(0.5, -0.25, 0.125)
    same(read(**LINE, receive_offset=offset, receive_focus=5.0),
         PLAIN.focused([0, 0, 5], 1500.0).moved([0.5, -0.25, 0.125]))


@pytest.mark.parametrize(("written", "words"), [
    ({"receive": "ring"}, 'receive is the string "ring"; expected one of "point", "line"'),
    ({"receive": "line"}, "attribute receive_elements is missing; expected an integer at least 1"),
    ({"receive": "line", "receive_elements": 0}, "receive_elements is the integer 0"),
    ({**LINE, "receive_pitch": -0.1}, "receive_pitch is the float -0.1; expected a number [m] above 0"),
    ({**LINE, "frequency": None}, "attribute receive_pitch is missing"),
    ({**LINE, "receive_axis": "sideways"}, 'receive_axis is "sideways"; give one of forward, aft, starboard'),
    ({**LINE, "receive_normal": "1, 2"}, "receive_normal is [1.0, 2.0]; give three finite numbers"),
    ({**LINE, "receive_radius": 1.0}, 'receive_radius is written, but receive is "line", which takes receive_elements'),
    ({"receive_elements": 4}, 'receive_elements is written, but receive is "point"'),
    ({"receive": "cylindrical", "receive_elements": 4, "receive_radius": 1.0, "receive_pitch": 1.0},
     "receive_radius and receive_pitch are both given"),
    ({"receive": "cylindrical", "receive_elements": 4, "receive_aperture_deg": 400}, "above 0 and at most 360"),
    ({"receive": "planar", "receive_elements": 4, "receive_axis": "down"}, "axis and normal are parallel"),
    ({"receive": "file"}, "attribute receive_file is missing"),
    ({"receive": "file", "receive_file": "no.csv"}, 'names the file "no.csv", which is not there'),
    ({**LINE, "receive_shading": "hanning"}, 'receive: window is "hanning" (did you mean "hann"?); give one of boxcar'),
    ({"receive": "spherical", "receive_elements": 4, "receive_shading": "hann"}, "stand in no regular order"),
    ({**LINE, "receive_failed": "16"}, "receive: array: element 16 is to fail, but there are 16"),
    ({**LINE, "receive_failed": "1.5"}, "give whole numbers from 0"),
    ({**LINE, "receive_failed": "one"}, "expected a list of numbers separated by commas"),
    ({**LINE, "receive_jitter": -1.0}, "receive_jitter is the float -1.0"),
    ({**LINE, "receive_jitter_seed": 3}, "receive_jitter_seed is written, but receive_jitter is not"),
    ({**LINE, "receive_steer_deg": "90"}, "expected 2 numbers [degrees]"),
    ({**LINE, "receive_steer_deg": "30, 100"}, "a depression of 100 degrees"),
    ({"receive": "spherical", "receive_elements": 400, "receive_focus": 3.0}, "elements look everywhere"),
    ({**LINE, "receive_pattern": "square"}, 'expected one of "omni", "rectangular", "circular"'),
    ({**LINE, "receive_pattern": "omni", "receive_element_length": 0.1}, "elements are omni, but their length"),
    ({**LINE, "receive_element_height": -0.1}, "expected a number [m] at least 0"),
    ({**LINE, "receive_element_length": 1e20}, "expected a number [m] at least 0 and at most 10000"),
    ({**LINE, "receive_element_height": 1e308}, "expected a number [m] at least 0 and at most 10000"),
    ({**LINE, "receive_pitch": 1e20}, "expected a number [m] above 0 and at most 10000"),
    ({**LINE, "receive_pitch": 9e3}, "receive: array: position of element 0 is"),
    ({"receive_offset": [0.0, 1e20, 0.0]}, "give places within 10000 m"),
    ({**LINE, "receive_jitter": 1e308}, "expected a number [m] at least 0 and at most 1000"),
    ({**LINE, "receive_focus": 1e308}, "expected a number [m] above 0 and at most 1000000000"),
    ({**LINE, "receive_baffle": "steel"}, 'expected one of "none", "hard", "soft", "cardioid"'),
    ({**LINE, "receive_colour": "red"}, 'unknown attribute "receive_colour"'),
    ({**LINE, "transmit": "line"}, "attribute transmit_elements is missing"),
])
def test_refusals(refused, written, words):
    assert words in refused(**written)


def test_file_that_lacks_a_column(refused, tmp_path):
    path = tmp_path / "hull.csv"
    path.write_text("x,y\n0,1\n")
    assert "the column z is missing" in refused(receive="file", receive_file=str(path))
