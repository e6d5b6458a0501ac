"""What all elements of an array hear of a direction: a bound that no element exceeds, near it or turned meanwhile.

Elements 0.6 m about the centre, points 2 to 40 m away, the receivers turned by up to 0.05 rad: the square of every
pattern, by NumPy, towards the point from where the element is. The bound may be exceeded by float32's rounding, 1e-5.
"""
import mitsuba as mi
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from mitsonar.device.arrays import upload
from mitsonar.echoes.scatterers.element_beams import ElementBeams
from mitsonar.sonar import element_array

TURN, WAVELENGTH = 0.05, 0.015


def arrays(rng, pattern, baffle):
    """A transmitter and six receivers whose faces all look one way."""
    sides = {"length": 0.06, "height": 0.03}
    size = {"omni": {}, "circular": {"length": 0.06}, "rectangular": sides, "filled": {**sides, "floor": 0.01}}[pattern]
    face = {**size, "pattern": "rectangular" if pattern == "filled" else pattern, "baffle": baffle,
            "normal": [0.3, 1, 0.2]}
    position = rng.uniform(-0.35, 0.35, (6, 3))
    return element_array(position[:1], **face), element_array(position, **face)


@pytest.mark.parametrize("baffle", ["none", "hard", "soft", "cardioid"])
@pytest.mark.parametrize("pattern", ["omni", "rectangular", "filled", "circular"])
def test_no_element_hears_more_than_the_bound(variant, rng, pattern, baffle):
    transmit, receive = arrays(rng, pattern, baffle)
    towards = rng.normal(size=(4000, 3))
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    distance = rng.uniform(2, 40, len(towards))
    beams, attitude = ElementBeams(transmit, receive, WAVELENGTH, TURN), Rotation.from_rotvec([0.1, 0.4, -0.2])
    bound = beams.bound(mi.Vector3f(*(upload(mi.Float, axis.astype(np.float32)) for axis in towards.T)),
                        upload(mi.Float, distance.astype(np.float32)), attitude.as_matrix())
    loudest = np.zeros(len(towards))
    for array, turned in ((transmit, 0.0), (receive, TURN)):
        heard = []
        for axis in rng.normal(size=(5, 3)):
            there = Rotation.from_rotvec(turned * axis / np.linalg.norm(axis)) * attitude
            for place, normal, along in zip(array.position, array.normal, array.along):
                way = distance[:, None] * towards - attitude.apply(np.array(place))
                way /= np.linalg.norm(way, axis=1, keepdims=True)
                sides = (there.apply(np.array(side)) for side in (normal, along))
                heard.append(array.element_pressure(way, WAVELENGTH, *sides) ** 2)
        loudest = np.maximum(loudest, 1e-30) if not loudest.any() else loudest
        loudest = np.max(heard, axis=0) if array is transmit else loudest * np.max(heard, axis=0)
    bound = np.broadcast_to(bound.numpy(), loudest.shape)
    assert np.all(loudest <= bound * (1 + 1e-5) + 1e-12)
    assert bool(beams) == ((pattern, baffle) != ("omni", "none"))
    if baffle == "hard":
        assert np.any(bound == 0)


def test_what_lies_in_the_centres_null_is_kept(variant):
    """A face of four wavelengths hears nothing at sin ψ = 1/4, its neighbour 0.2 m on does."""
    pair = element_array([[0.1, 0, 0], [-0.1, 0, 0]], length=0.06, pattern="rectangular")
    beams = ElementBeams(pair, pair, WAVELENGTH)
    towards = mi.Vector3f(0.25, 0, float(np.sqrt(1 - 0.0625)))
    assert beams.intensity(towards, np.eye(3)).numpy()[0] < 1e-8
    assert beams.bound(towards, mi.Float(10.0), np.eye(3)).numpy()[0] > 1e-3
