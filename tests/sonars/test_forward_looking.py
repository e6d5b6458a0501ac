"""A forward-looking sonar: targets where they are, as wide as theory says, boxes with their labels, presets, bad input.

A line of Taylor shading (4, 30 dB), D long, hears a target in beams 1.125 λ / D wide [rad] about broadside (-3 dB), and
ψ off it in 1 / cos ψ times that.
"""
import mitsuba as mi
import numpy as np
import pytest
import xarray as xr
from sonar_scenes import array_sonar, bed, buried_bed, forward_looking, lambert, point_target

import mitsonar
import mitsonar.scene.loading  # tells Dr.Jit its libraries before Mitsuba is imported
from mitsonar.sonar import beam_pattern
from mitsonar.sonar.preset_tables import instruments, presets

SPEED, DEPTH, ELEMENTS, SPACING = 1500.0, 10.0, 48, 0.5
SMALL = {"frequency_khz": 200.0, "receive_elements": ELEMENTS, "element_spacing": SPACING, "beams": 121,
         "fan_deg": 90.0, "tilt_deg": 0.0, "pulse_ms": 0.5, "bandwidth_khz": 20.0, "vertical_beam_width_deg": 180.0}
WIDTH = 1.125 / (ELEMENTS * SPACING)
SILENT = {"bed": buried_bed(12.0, size=4.0)}


def at(bearing, distance, depth=DEPTH):
    """A place ahead of the sonar, which looks north: x, y, z [m]."""
    level = np.sqrt(distance ** 2 - (depth - DEPTH) ** 2)
    return [level * np.sin(bearing), level * np.cos(bearing), -depth]


def rendered(shapes, **changes):
    """The picture of a small sonar at 6 to 15 m."""
    made = forward_looking({**SILENT, **shapes}, depth=DEPTH, sensor={**SMALL, **changes},
                           film={"range": 15.0, "range_min": 6.0}, integrator={"cell": 0.5})
    return mitsonar.render(made)


def half_power_width(place, level):
    """The places on either side of its peak where a level [dB] falls by 3 dB."""
    peak = int(np.argmax(level))
    rise, fall = slice(peak, None, -1), slice(peak, None)
    low, high = (np.interp(-(level[peak] - 3.01), -level[part][:8], place[part][:8]) for part in (rise, fall))
    return low, high


@pytest.mark.parametrize("way", ["beams", "elements"])
@pytest.mark.parametrize("steps, degrees", [("sine", 0.0), ("sine", 35.0), ("angle", -35.0)])
def test_a_target_lies_at_its_bearing_and_range_and_is_as_wide_as_theory_says(variant, steps, degrees, way):
    bearing, distance = np.deg2rad(degrees), 10.37
    image = rendered({"target": point_target(at(bearing, distance))}, beam_spacing=steps, picture=way)
    level = image["level"].values[0]
    beam, sample = np.unravel_index(np.argmax(level), level.shape)
    cell = np.diff(image["bearing"].values)[max(beam - 1, 0)], image.attrs["bin_width"]
    assert float(image["bearing"][beam]) == pytest.approx(bearing, abs=0.5 * cell[0])
    assert float(image["range"][sample]) == pytest.approx(distance, abs=0.5 * cell[1])
    low, high = half_power_width(image["bearing"].values, level[:, sample])
    assert high - low == pytest.approx(WIDTH / np.cos(bearing), rel=0.1)
    assert 0.5 * (low + high) == pytest.approx(bearing, abs=0.1 * WIDTH)


def test_a_pair_is_resolved_where_it_stands_further_apart_than_a_beam(variant):
    for apart, resolved in ((2.0, True), (0.7, False)):
        bearings = np.array([-0.5, 0.5]) * apart * WIDTH
        image = rendered({f"t{k}": point_target(at(b, 10.0)) for k, b in enumerate(bearings)})
        level = image["level"].values[0][:, np.argmin(np.abs(image["range"].values - 10.0))]
        peaks = np.flatnonzero((level[1:-1] > level[:-2]) & (level[1:-1] > level[2:]) & (level[1:-1] > level.max() - 6))
        assert len(peaks) == 1 + resolved
        if resolved:
            np.testing.assert_allclose(image["bearing"].values[1 + peaks], bearings, atol=0.15 * WIDTH)


@pytest.fixture(scope="module")
def boxed():
    """A box 5 to 6 m ahead, to starboard of the middle, seen from 3 m above the bed in beams of equal sine steps."""
    mitsonar.scene.loading.prepare()
    place = mi.ScalarTransform4f().translate([3.0, 8.5, -12.5]).scale([0.8, 0.5, 0.5])
    box = {"type": "cube", "id": "box", "to_world": place, "bsdf": lambert(-12.0)}
    made = forward_looking({"seabed": bed(13.0, size=60.0), "box": box}, depth=DEPTH,
                           sensor={**SMALL, "beam_spacing": "sine"}, film={"range": 15.0, "range_min": 6.0},
                           integrator={"cell": 0.2})
    return mitsonar.render(made, seed=0)


def test_a_box_and_its_shadow_stand_where_geometry_puts_them(boxed):
    """The face at y = 8 spans x = 2.2 to 3.8; behind its rear edge, 2 m deeper than the sonar, the bed lies in shadow.

    A label ends where the box brings half of the echo; it is so bright that this is where beams are some 15 dB down.
    """
    label, shadow = boxed["label"].values[0], boxed["object_shadow"].values[0]
    box = next(int(number) for number, name in boxed.attrs["labels"].items() if name == "box")
    sample = np.argmin(np.abs(boxed["range"].values - np.sqrt(8.0 ** 2 + 3.0 ** 2 + 2.5 ** 2)))
    seen = boxed["bearing"].values[np.flatnonzero(label[:, sample] == box)]
    # a line tells directions apart by the sine of the angle off its own broadside
    corners = np.arcsin([x / np.sqrt(x ** 2 + 8.0 ** 2 + 2.5 ** 2) for x in (2.2, 3.8)])
    np.testing.assert_allclose(seen[[0, -1]], corners, atol=1.3 * WIDTH)
    beam = np.argmin(np.abs(boxed["bearing"].values - np.arcsin(3.0 / np.sqrt(3.0 ** 2 + 9.0 ** 2 + 2.0 ** 2))))
    dark = boxed["range"].values[np.flatnonzero(shadow[beam] == box)]
    rear = np.array([3.0, 9.0, 2.0])                      # over a beam's width its range changes by six samples
    np.testing.assert_allclose(dark[[0, -1]], [np.linalg.norm(rear), 1.5 * np.linalg.norm(rear)],
                               atol=6 * boxed.attrs["bin_width"])


def test_shares_add_to_one_where_anything_is_heard(boxed):
    total = boxed["share"].sum("shape").values
    assert np.all(np.isclose(total, 1, atol=1e-5) | (total == 0)) and (total > 0).mean() > 0.9


def test_bearings_are_stored(boxed, tmp_path):
    for name in ("a.exr", "a.nc"):
        mitsonar.write(boxed, tmp_path / name)
        again = mitsonar.read(tmp_path / name)
        assert again["bearing"].dims == ("beam",) and again["bearing"].attrs["units"] == "rad"
        xr.testing.assert_identical(again["bearing"], boxed["bearing"])
    assert boxed.attrs["sonar"] == "forward_looking"
    np.testing.assert_allclose(np.diff(np.sin(boxed["bearing"].values)), np.sin(np.pi / 4) / 60, rtol=1e-9)


def test_it_is_a_sonar_with_that_array(variant):
    """The same line written as an `array_sonar` gives the same levels, the same seed the same bits, another others."""
    shapes, film = {"seabed": bed(13.0, size=30.0)}, {"range": 9.0, "range_min": 7.0}
    fan = {"beams": 31, "fan_deg": 90.0, "pulse_ms": 0.5, "bandwidth_khz": 20.0, "frequency_khz": 200.0, "noise": True}
    width = {"pattern": "rectangular", "baffle": "hard", "normal": "forward"}
    line = {f"receive_{name}": value for name, value in (
        *width.items(), ("elements", 8), ("shading", "taylor 4 30"), ("pitch", 0.00375), ("element_length", 0.00375))}
    face = {f"transmit_{name}": value for name, value in width.items()}
    length = 0.44294647069 * 0.0075 / np.sin(np.pi / 4)
    same = array_sonar(shapes, film=film, integrator={"cell": 0.2}, sensor={
        **fan, **line, **face, "receive": "line", "receive_flaws": 0.2, "self_noise_db": 48.0, "source_level_db": 200.0,
        "transmit_element_length": length})
    images = [mitsonar.render(made, seed) for made, seed in ((same, 1), *((forward_looking(
        shapes, film=film, integrator={"cell": 0.2}, sensor={**SMALL, **fan, "receive_elements": 8,
                                                             "beam_spacing": "angle"}), seed) for seed in (1, 1, 2)))]
    levels = [image["level"].values for image in images]
    np.testing.assert_allclose(levels[0], levels[1], atol=2e-3)
    assert np.array_equal(levels[1], levels[2]) and not np.array_equal(levels[1], levels[3])


RESOLUTION = {"multibeam_750khz": 1.0, "multibeam_1200khz": 0.6, "multibeam_2100khz": 0.4, "multibeam_720khz": 1.0,
              "multibeam_900khz": 1.0, "lens_1800khz": 0.3}                  # published, degrees
RESOLUTION |= {one.name: one.published.get("angular_resolution_deg", RESOLUTION[one.like])
               for one in instruments("forward_looking").values()}


@pytest.mark.parametrize("name", presets("forward_looking"))
def test_a_preset_makes_the_beams_of_its_class(variant, name):
    sensor = forward_looking(SILENT, sensor={"preset": name}).sensors()[0]
    wavelength, looks = SPEED / sensor.frequency, sensor.receive.normal[0]
    across = np.array([0.0, 1.0, 0.0])
    assert looks == pytest.approx([np.cos(sensor.tilt), 0, np.sin(sensor.tilt)])

    def turned(angle):
        angle = np.atleast_1d(angle)[:, None]
        return np.cos(angle) * looks + np.sin(angle) * across

    half = np.deg2rad(0.5 * RESOLUTION[name])
    level = 20 * np.log10(np.abs(beam_pattern(sensor.receive, turned([0.0, half]), wavelength)))
    assert level[1] - level[0] == pytest.approx(-3.0, abs=0.35)
    below = np.cos(np.deg2rad(0.5 * presets("forward_looking")[name]["vertical_beam_width_deg"]))
    down = np.cross(looks, across)
    edge = below * looks + np.sqrt(1 - below ** 2) * down
    for array in (sensor.transmit, sensor.receive):
        assert 20 * np.log10(np.abs(beam_pattern(array, edge, wavelength))) == pytest.approx(-3.0, abs=0.05)
    # steered to one edge, the line hears nothing like a main lobe from anywhere else in the fan
    rim = 0.5 * sensor.fan_width
    steered = sensor.receive.steered(turned(rim)[0], SPEED)
    elsewhere = beam_pattern(steered, turned(np.linspace(-rim, rim - 3 * half / np.cos(rim), 4001)), wavelength, SPEED)
    assert 20 * np.log10(np.abs(elsewhere)).max() < -20


@pytest.mark.parametrize("farthest", [2.0, 120.0])
def test_ranges_of_such_instruments_are_planned(variant, farthest):
    made = forward_looking({"seabed": bed(14.0, size=300.0)}, film={"range": farthest})
    survey = made.integrator().survey(made, made.sensors()[0])
    end = 0.5 * SPEED * survey.time[-1]
    assert end == pytest.approx(farthest, abs=2 * 0.5 * SPEED / survey.sampling_rate)


@pytest.mark.parametrize("name, farthest", [("multibeam_750khz", 100.0), ("lens_1800khz", 60.0)])
def test_a_preset_has_longer_pulses_for_long_ranges(variant, name, farthest):
    """2000 resolution cells: c / 2B of a sweep, c T / 2 of a cw pulse; what is written stays."""
    def pulse(**written):
        return forward_looking(SILENT, sensor={"preset": name, **written}, film={"range": farthest}).sensors()[0].pulse

    usual, length = presets("forward_looking")[name], 2 * farthest / SPEED / 2000
    found, ms = pulse(), usual["pulse_ms"] / 1000
    if usual["pulse"] == "cw":
        assert found.duration == pytest.approx(length) and found.duration > 2 * ms
    else:
        assert found.bandwidth == pytest.approx(1 / length)
        assert found.duration * found.bandwidth == pytest.approx(ms * 1000 * usual["bandwidth_khz"])
    assert pulse(pulse_ms=usual["pulse_ms"]).duration == ms
    near = forward_looking(SILENT, sensor={"preset": name}, film={"range": 4.0}).sensors()[0].pulse
    assert near.duration == pytest.approx(ms)


def test_rows_share_the_height_and_elements_fail(variant):
    sensor = forward_looking(SILENT, sensor={**SMALL, "receive_rows": 3, "receive_vertical_beam_width_deg": 20.0,
                                             "receive_failed": "0, 5", "receive_jitter": 1e-4}).sensors()[0]
    assert sensor.receive.elements == 3 * ELEMENTS and np.flatnonzero(sensor.receive.weight == 0).tolist() == [0, 5]
    height = 0.44294647069 * 0.0075 / np.sin(np.deg2rad(10.0))
    assert sensor.receive.height == pytest.approx(height / 3)
    assert np.ptp(sensor.receive.position[:, 2]) == pytest.approx(2 * height / 3, abs=1e-3)


@pytest.mark.parametrize("written, sentence", [
    ({"preset": "multibeam_700khz"}, 'preset is the string "multibeam_700khz"; expected one of'),
    ({"beam_spacing": "cosine"}, 'expected one of "angle", "sine"'),
    ({"receive_rows": 2, "vertical_beam_width_deg": 180.0}, "no height to share"),
    ({"pulse": "cw", "bandwidth_khz": 10.0}, "a cw pulse has the bandwidth of its length"),
    ({"receive_shading": "hammock"}, 'window is "hammock"'), ({"receive_failed": "48000"}, "receive: "),
    ({"receive": "line"}, 'unknown attribute "receive"'), ({"fan_deg": 200.0}, "at most 180")])
def test_what_makes_no_such_sonar_is_refused(variant, written, sentence):
    with pytest.raises((ValueError, RuntimeError), match=sentence.replace("(", r"\(")):
        forward_looking(SILENT, sensor=written)


def test_frames_are_the_picture_where_the_sonar_sinks_through_warm_water(variant, tmp_path):
    """Elements' beams are steered at the sound speed where each ping is: 1516 m/s and 1489 here, 4 dB of a point."""
    track = tmp_path / "sinking.csv"
    track.write_text("time,x,y,z,roll,pitch,heading\n0,0,0,-2,0,0,0\n1,1,0,-10,0,0,0\n")
    scene = forward_looking({"bed": bed(20.0), "buoy": point_target([0.5, 9, -12], 10.0)},
                            water={"profile": "0:1520, 5:1510, 12:1480, 25:1478"}, integrator={"cell": 2.0},
                            sensor={"picture": "elements", "receive_elements": 16, "beams": 16, "noise": False,
                                    "track": str(track), "pings": 2, "ping_rate_hz": 1.0}, film={"range": 14.0})
    together = mitsonar.render(scene, 3)["level"].values
    assert np.array_equal(np.concatenate([frame["level"].values for frame in mitsonar.frames(scene, 3)]), together)
