"""Micronavigation beside the true trajectory, displaced phase centres beside the theorem of van Cittert and Zernike.

A level bed of random scatterers is seen at 25 to 32 m by 300 kHz, 30 kHz, elements of 4 cm. Closed form: phase centres
d apart have the coherence T(d) of `aperture_coherence`, the mean of K pairs the spread (1 - T²) / √(2 N K); N is 240
looks of two windows, four pairs in effect. Where pings overlap to the millimetre the coherence is above 0.998, and the
bound for the way to the bed is 0.3 to 2 µm; the window holds three times that, for speckle is shared by all pings.
"""
from functools import cache

import numpy as np
import pytest
from inputs.bed_strip import SOUND_SPEED, bed_strip, rough_bed, straight

from mitsonar.synthetic_aperture.focusing.poses import poses_of
from mitsonar.synthetic_aperture.micronavigation.micronavigation import Trust, micronavigate, straightened
from mitsonar.synthetic_aperture.micronavigation.track import compare
from mitsonar.synthetic_aperture.products.coherence import aperture_coherence

HEADING, ELEMENT, SPEED = 0.6, 0.04, 1.5


def swung(frequency, amplitude, phase=0.0):
    return lambda time: amplitude * np.sin(2 * np.pi * frequency * time + phase)


@cache
def strip(pings=3, receivers=6, shared=4, further=0.0, noise=0.0, swing=0.02, port=False):
    """Raw echoes of pings that share receivers' places, to `further` metres."""
    step = ((receivers - shared) * ELEMENT / 2 + further) / SPEED
    pose = straight(SPEED, HEADING, 5.0, sway=swung(2.0, swing / 4), yaw=swung(0.7, swing / 4, 1.0),
                    heave=swung(0.4, swing / 20))
    rx = np.zeros((receivers, 3))
    rx[:, 0] = (np.arange(receivers) - 0.5 * (receivers - 1)) * ELEMENT
    place, strength = rough_bed(6000, (-4.5, 5.5), (21, 31), HEADING, 15.0)
    if port:
        place[:, :2] *= -1
    raw = bed_strip(pose, 0.5 + step * np.arange(pings), rx=rx, element=ELEMENT, ranges=(25, 32.2), scatterers=place,
                    strength=strength, noise=noise)
    return raw.assign_attrs(look=[0.0, -0.94, 0.34]) if port else raw


@pytest.mark.parametrize("port", [False, True])
def test_the_way_to_the_bed_is_told_to_micrometres(port):
    raw = strip(port=port)
    believed = straightened(raw)
    found = micronavigate(raw, believed, window=3.0, trust=Trust(heave=0.05))
    error = compare(found, raw, believed)
    assert np.abs(found["slant"]).max() > 3e-4                       # what was to be found
    assert np.sqrt(np.mean(error["slant_error"] ** 2)) < 3e-6
    assert np.all(np.abs(error["slant_error"]) < 5 * found["slant_deviation"] + 1e-6)
    assert np.all(np.abs(error["yaw_error"]) < 4 * found["yaw_deviation"])
    assert np.all(np.abs(error["surge_error"]) < 3 * found["surge_deviation"])
    assert np.all(found["coherence"] > 0.997)


def test_steps_add_up_to_the_true_trajectory():
    raw = strip(pings=5)
    believed = straightened(raw)
    found = micronavigate(raw, believed, window=3.0)
    after = compare(found, raw, believed)["track_error"]
    before = compare(found.assign({name: believed[name] for name in believed.variables}), raw, believed)["track_error"]
    assert np.abs(before).max() > 5e-5
    assert np.abs(after).max() < 0.15 * np.abs(before).max()
    again = micronavigate(raw, found, window=3.0)
    assert np.abs(again["slant"]).max() < 3e-6


@pytest.mark.parametrize(("shared", "further"), [(4, 0.0), (4, 0.005), (2, 0.01)])
def test_displaced_phase_centres_are_as_coherent_as_theory_says(shared, further):
    raw = strip(pings=2, shared=shared, further=further, swing=0.0)
    found = micronavigate(raw, straightened(raw), window=3.0)
    error = compare(found, raw, straightened(raw))["surge_error"].values[0]
    apart, coherence = found["pair_apart"].values[0] - error, found["pair_coherence"].values[0]
    theory = aperture_coherence(apart, ELEMENT, ELEMENT, SOUND_SPEED / 300e3)
    for place in np.unique(np.round(apart, 4)):
        alike = np.abs(apart - place) < 5e-4
        spread = (1 - theory[alike].mean() ** 2) / np.sqrt(2 * 240 * min(alike.sum(), 4))
        assert coherence[alike].mean() == pytest.approx(theory[alike].mean(), rel=0.005, abs=3 * abs(spread))


def test_noise_lowers_coherence_and_raises_what_is_predicted():
    raw = strip(pings=2, noise=0.05, swing=0.0)
    found, clear = (micronavigate(one, straightened(one), window=3.0) for one in (raw, strip(pings=2, swing=0.0)))
    assert 0.94 < float(found["coherence"].mean()) < 0.995
    assert float(found["slant_deviation"].mean()) > 3 * float(clear["slant_deviation"].mean())
    error = compare(found, raw, straightened(raw))
    assert np.all(np.abs(error["slant_error"]) < 4 * found["slant_deviation"])


def test_the_believed_trajectory_is_what_is_corrected():
    raw = strip()
    moved = straightened(raw)
    moved = moved.assign(motion_x=moved["motion_x"] + 3.0, motion_y=moved["motion_y"] - 2.0)
    found = micronavigate(raw, moved, window=3.0)
    assert poses_of(found).position(np.array(0.55))[:2] == pytest.approx(
        poses_of(raw).position(np.array(0.55))[:2] + [3.0, -2.0], abs=0.03)


@pytest.mark.parametrize(("change", "said"), [
    (lambda raw: micronavigate(raw, window=50.0), "does not fit"),
    (lambda raw: micronavigate(raw, window=-1.0), "window is -1"),
    (lambda raw: micronavigate(raw, search=np.nan), "search is nan"),
    (lambda raw: micronavigate(raw.isel(ping=[0])), "two or more"),
    (lambda raw: micronavigate(raw.assign(ping_time=raw["ping_time"] * 40)), "overlap"),
    (lambda raw: micronavigate(raw.assign(signal=raw["signal"] * np.nan)), "no numbers"),
    (lambda raw: micronavigate(raw, raw.drop_vars("motion_x")), "motion_x"),
    (lambda raw: Trust(yaw=0.0), "yaw")])
def test_what_cannot_be_navigated_is_refused(change, said):
    with pytest.raises(ValueError, match=said):
        change(strip(pings=2, swing=0.0))
