"""The fan an array's picture is made of: where it looks, and where echoes land in it."""
import numpy as np
import pytest
import xarray as xr

from mitsonar.imaging import fan
from mitsonar.imaging.energy_record import EnergyRecord
from mitsonar.imaging.truth import BinTruth
from mitsonar.signal import received
from mitsonar.sonar import cylindrical_array, element_array, lfm, line_array, planar_array

ARRAYS = {
    "bow": (line_array(16, 0.01, axis="starboard", normal="forward"), [1, 0, 0], [0, 1, 0]),
    "hull": (line_array(16, 0.01, axis="starboard", normal="down"), [0, 0, 1], [0, 1, 0]),
    "side": (line_array(16, 0.01, axis="forward", normal="starboard"), [0, 1, 0], [1, 0, 0]),
    "tilted": (line_array(16, 0.01, axis="port", normal=[1, 0, 1]), [0.5 ** 0.5, 0, 0.5 ** 0.5], [0, 1, 0]),
    "plane": (planar_array(16, 3, 0.01, normal="forward"), [1, 0, 0], [0, 1, 0]),
    "drum": (cylindrical_array(16, 0.1, aperture=np.pi), [1, 0, 0], [0, 1, 0]),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_where_it_looks(name):
    array, normal, axis = ARRAYS[name]
    angle, direction = fan.fan_directions(array, 5, np.pi / 2)
    assert np.degrees(angle) == pytest.approx([-45, -22.5, 0, 22.5, 45])
    assert direction[2] == pytest.approx(normal, abs=1e-9)
    assert direction[4] == pytest.approx((np.array(normal) + axis) / 2 ** 0.5, abs=1e-9)


def test_beams_have_equal_steps_of_the_angle_or_of_its_sine():
    line = ARRAYS["bow"][0]
    angle, direction = fan.fan_directions(line, 5, np.pi / 2, "sine")
    np.testing.assert_allclose(np.sin(angle), np.array([-1, -0.5, 0, 0.5, 1]) * 0.5 ** 0.5)
    np.testing.assert_allclose(direction[:, 1], np.sin(angle), atol=1e-12)
    assert fan.fan_directions(line, 1, np.pi, "sine")[0].tolist() == [0]
    for steps, width in (("sines", 1.0), ("sine", 4.0)):
        with pytest.raises(ValueError, match="has no equal steps of"):
            fan.fan_directions(line, 5, width, steps)


def test_a_single_element_makes_a_single_beam():
    angle, direction = fan.fan_directions(element_array([[0.1, 0, 0]], normal="starboard"), 99, 1.0)
    assert angle.tolist() == [0] and direction.tolist() == [[0, 1, 0]]


@pytest.mark.parametrize("steered", [False, True])
def test_an_echo_lands_in_its_beam_at_its_range(steered):
    array, pulse, rate, speed = ARRAYS["bow"][0], lfm(75e3, 10e3, 2e-3), 40e3, 1500.0
    towards, distance = np.array([np.cos(0.5), np.sin(0.5), 0]), 30.0
    way = distance + np.linalg.norm(distance * towards - array.position, axis=1)
    time = 0.02 + np.arange(2000) / rate
    delay = array.position @ [0, 0.3, 0] / speed if steered else np.zeros(16)
    impulses = np.zeros((16, 2000), complex)
    for element, late in enumerate(way / speed + delay):
        sample = (late - 0.02) * rate
        impulses[element] = np.sinc(np.arange(2000) - sample) * np.exp(-2j * np.pi * 75e3 * late)
    signals = xr.DataArray(received(impulses, pulse, rate)[None, None], dims=("ping", "tx", "rx", "sample"), coords={
        "ping": [0], "time": ("sample", time), "rx_delay": ("rx", delay),
        **{f"rx_{axis}": ("rx", column) for axis, column in zip("xyz", array.position.T)}},
        attrs={"frequency": 75e3, "sampling_rate": rate, "sound_speed": speed, "seed": 0, "source_level_db": 0.0})
    none = {name: np.zeros((1, 121, 2000), np.uint32) for name in ("label", "object_shadow", "layover")}
    truth = BinTruth(**none, share=np.zeros((1, 121, 1, 2000)), hidden=np.zeros((1, 121, 2000)),
                     seabed_place=np.zeros((1, 121, 2000, 3)))
    rays = np.zeros((1, 121, 2000), np.uint32)
    record = EnergyRecord(intensity=rays, depth=rays, rays=rays, rays_in_beam=rays, truth=truth)
    directions = fan.fan_directions(array, 121, np.pi)
    about = xr.Dataset(coords={"ping": [0], "time": ("sample", time)}, attrs=signals.attrs)
    image = fan.image(about, fan.levels(fan.formed(signals, pulse, directions[1])), *directions, record=record,
                      depth_below=np.array([10.0]), labels={1: "seabed"}, class_of={1: 1})
    beam, sample = np.unravel_index(np.argmax(image["level"].values[0]), image["level"].shape[1:])
    assert float(image["beam"][beam]) == pytest.approx(0.5, abs=np.pi / 240)
    assert float(image["range"][sample]) == pytest.approx(distance, abs=750 / rate)
    # the matched filter's unit gain, less what falls between samples and beams
    assert float(image["level"].max()) == pytest.approx(0, abs=0.5)
