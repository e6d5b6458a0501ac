"""Jitter of a sidescan's faces: what pings from one place have in common, against theory.

A sonar at rest would receive the same speckle at every ping. Faces that turn by δ and lose phase by σ keep

    <g(p) g*(q)> = e^{-2σ²} ρ(δ_p - δ_q),      ρ(δ) = ∫ b(u) b(u - δ) du / ∫ b² du

b the two-way pressure, that of the far field at 150 m and more of a face of 0.4 degrees at 400 kHz. 2 x 1600 gates of
16 pings: values differ from theory, for the errors that were drawn, by 0.001; 0.01 is allowed.
"""
from dataclasses import replace

import numpy as np
import pytest

import mitsonar
from mitsonar.scene.loading import prepare
from mitsonar.survey.sidescan.jitter import Jitter
from mitsonar.survey.sidescan.kind import plan
from mitsonar.survey.sidescan.speckle import speckle_of
from mitsonar.validation.scenes import bed, sidescan

PINGS, SEED = 16, 5
BED = {"bed": bed(40.0, size=2000.0)}
FILM = {"range": 300.0, "range_min": 150.0, "bins": 800}


@pytest.fixture(scope="module", autouse=True)
def ready():
    prepare()


def scene_of(**sensor):
    return sidescan(BED, rays=100, film=FILM, sensor={
        "preset": "towed_400khz", "pings": PINGS, "speckle": True, "speed_knots": 0.0, **sensor})


def spoken(**sensor):
    """The speckle of a sonar at rest, (ping, side, gate), its sensor and its survey."""
    scene = scene_of(**sensor)
    sonar = scene.sensors()[0]
    survey = plan(scene, sonar, replace(scene.integrator().settings, seed=1))
    return speckle_of(survey, sonar.jitter, SEED)(np.arange(PINGS), 1)[..., 0], sonar, survey


def common(speckle):
    """The mean of <g(p) g*(q)> over pairs of pings."""
    total = np.sum(np.abs(speckle.sum(0)) ** 2) - np.sum(np.abs(speckle) ** 2)
    return float(total / (PINGS - 1) / np.sum(np.abs(speckle) ** 2))


def overlap(sonar, error):
    """ρ of errors (P,) [rad], the mean over pairs."""
    u = np.linspace(-0.05, 0.05, 20001)
    b = np.sqrt(sonar.along_intensity(u))
    pairs = np.abs(np.subtract.outer(error, error))[np.triu_indices(len(error), 1)]
    return float(np.mean([np.interp(u - one, u, b) @ b for one in pairs]) / (b @ b))


def errors_of(jitter, pings):
    """The errors of heading of pings [rad]."""
    turned = jitter.turned(np.tile(np.eye(3), (pings, 1, 1)), np.arange(pings), SEED)
    return np.arctan2(turned[:, 1, 0], turned[:, 0, 0])


@pytest.mark.parametrize(("yaw_deg", "phase_deg"), [(0.05, 0.0), (0.12, 0.0), (0.0, 20.0), (0.08, 15.0)])
def test_pings_have_in_common_what_theory_says(yaw_deg, phase_deg):
    speckle, sensor, survey = spoken(yaw_jitter_deg=yaw_deg, phase_jitter_deg=phase_deg)
    expected = np.exp(-2 * np.deg2rad(phase_deg) ** 2) * overlap(survey.sonar, errors_of(sensor.jitter, PINGS))
    assert common(speckle) == pytest.approx(expected, abs=0.01)
    assert expected < 0.98
    # of circular Gaussians: <|g|⁴> is 2, and the power stays 1
    assert np.mean(np.abs(speckle) ** 2) == pytest.approx(1, abs=0.02)
    assert np.mean(np.abs(speckle) ** 4) == pytest.approx(2, abs=0.1)


def test_errors_are_gaussian_and_a_gaussian_beam_keeps_the_closed_form():
    """<ρ> = 1/√(1 + ε²/s²) of b = e^{-u²/2s²}; the mean over 2e5 pairs of 4000 draws errs by 2 %."""
    rms, s = 0.002, 0.003
    error = errors_of(Jitter(yaw=rms), 4000)
    assert error.std() == pytest.approx(rms, rel=0.03) and abs(error.mean()) < 3 * rms / np.sqrt(4000)
    gaps = np.concatenate([error[lag:] - error[:-lag] for lag in range(1, 51)])
    assert np.mean(np.exp(-gaps ** 2 / (4 * s ** 2))) == pytest.approx(1 / np.sqrt(1 + rms ** 2 / s ** 2), rel=0.02)


def test_steady_faces_receive_the_same_and_blocks_change_nothing():
    steady, _, _ = spoken()
    assert np.array_equal(steady[0], steady[-1])
    jitter = {"yaw_jitter_deg": 0.1, "phase_jitter_deg": 10.0}
    whole, sonar, survey = spoken(**jitter)
    assert np.array_equal(speckle_of(survey, sonar.jitter, SEED)(np.arange(3, 7), 1)[..., 0], whole[3:7])
    assert not np.array_equal(speckle_of(survey, sonar.jitter, SEED + 1)(np.arange(3, 7), 1)[..., 0], whole[3:7])
    # mean levels are those of steady faces
    images = [mitsonar.render(scene_of(noise=False, **more), 2) for more in ({}, jitter)]
    assert np.array_equal(images[0]["mean_level"], images[1]["mean_level"])
    assert not np.array_equal(images[0]["level"], images[1]["level"])
