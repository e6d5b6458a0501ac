"""Beam patterns through the whole chain: a point target, rays, element signals, beams.

A line of N elements at pitch d, a target 300 m away (far field: 2 L²/λ = 20 m; curvature left 8e-3 rad), a pulse so
long that the array is crossed in 1 % of it: b = |sin Nu / (N sin u)|, u = (πd/λ)(sin ψ - sin ψ0); first side lobe of
32 elements -13.236 dB, grating lobes at sin ψ_g = sin ψ0 - λ/d. Within 0.1 dB where b > -30 dB, and 0.1°.
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.signal import beamforming
from mitsonar.validation.scenes import array_sonar, buried_bed, point_target

RANGE, WAVELENGTH, ELEMENTS = 300.0, 0.015, 32


def heard(target_deg, pitch, **receive):
    """Signals of a line across the bow, heading north, from a target at its depth."""
    east, north = RANGE * np.sin(np.radians(target_deg)), RANGE * np.cos(np.radians(target_deg))
    scene = array_sonar(
        {"bed": buried_bed(200.0), "buoy": point_target([east, north, -10.0])},
        sensor={"pulse": "cw", "pulse_ms": 20.0, "pulse_window": "hann", "receive": "line", "receive_normal": "forward",
                "receive_elements": ELEMENTS, "receive_pitch": pitch, **receive},
        film={"range": RANGE + 20, "range_min": RANGE - 10})
    signals = mitsonar.element_signals(scene)
    middle = 2 * RANGE / 1500 + 0.010
    return signals, int(np.abs(signals["time"].values - middle).argmin())


def closed_form(sine, target_deg, pitch):
    turns = (sine - np.sin(np.radians(target_deg))) * pitch / WAVELENGTH
    return np.abs(np.exp(2j * np.pi * np.multiply.outer(turns, np.arange(ELEMENTS))).mean(axis=-1))


@pytest.mark.parametrize("method", ["delay_and_sum", "fft_beams", "fan_beams"])
@pytest.mark.parametrize("target_deg", [0.0, 20.0])
def test_main_lobe_and_side_lobes(method, target_deg):
    pitch = WAVELENGTH / 2
    signals, sample = heard(target_deg, pitch)
    if method == "delay_and_sum":
        sine = np.sin(np.radians(np.arange(-70, 70.01, 0.05)))
        beams = beamforming.delay_and_sum(signals, beamforming.directions(np.arcsin(sine)))
    else:
        size = {"size": 2048} if method == "fft_beams" else {"beams": 2001}
        beams = getattr(beamforming, method)(signals, "forward", **size)
        sine = beams["sine"].values
    found = np.abs(beams.values[0, :, sample])
    assert np.degrees(np.arcsin(sine[found.argmax()])) == pytest.approx(target_deg, abs=0.1)
    expected = closed_form(sine, target_deg, pitch)
    lobes = expected > 10 ** (-30 / 20)
    apart = 20 * np.log10(found[lobes] / found.max() / expected[lobes])
    assert np.abs(apart).max() < 0.1
    side = np.abs(sine - np.sin(np.radians(target_deg))) > WAVELENGTH / (ELEMENTS * pitch)
    assert 20 * np.log10(found[side].max() / found.max()) == pytest.approx(-13.236, abs=0.1)


def test_grating_lobe():
    pitch = 0.8 * WAVELENGTH
    signals, sample = heard(20.0, pitch)
    angle = np.arange(-75, -55, 0.02)
    found = np.abs(beamforming.delay_and_sum(signals, beamforming.directions(np.radians(angle))).values[0, :, sample])
    main = np.abs(beamforming.delay_and_sum(signals, beamforming.directions(np.radians([20.0]))).values[0, 0, sample])
    assert angle[found.argmax()] == pytest.approx(np.degrees(np.arcsin(np.sin(np.radians(20)) - 1 / 0.8)), abs=0.1)
    assert 20 * np.log10(found.max() / main) == pytest.approx(0, abs=0.1)
