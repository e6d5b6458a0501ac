"""Bed strength of soundings and snippets: a known one returns, and areas end where the pulse or the beam ends them."""
import numpy as np
import pytest
from swath_echoes import SOUND_SPEED, Sounder, bed, halves, head_of, lambertian

from mitsonar.hydrography.detection.bottom_backscatter import DB_MEAN_BIAS, ensonified_area, strength_db
from mitsonar.hydrography.detection.detection import detect
from mitsonar.hydrography.detection.snippets import snippets


def areas(sounder, found):
    """Ranges, and what an area is of."""
    return 750 * found.time, dict(
        pulse_length=sounder.pulse, transmit_width=np.sqrt(2 * np.pi) * sounder.along_sigma,
        receive_width=sounder.pattern_integral / np.sqrt(1 - sounder.sines ** 2), sound_speed=SOUND_SPEED)


@pytest.mark.parametrize("sounder, depth, pings", [
    (Sounder(duration=0.09, taper=0.8), 20.0, 18),
    (Sounder(beam_deg=1.5, taper=0.8, pulse=5e-4, along_deg=1.5, duration=0.23), 50.0, 24),
], ids=["pulse-limited aside", "beam-limited"])
def test_a_known_strength_returns_across_the_swath(sounder, depth, pings):
    # Bands of 20 degrees hold some 500 soundings of one to ten echoes: the mean is known to 0.2 dB or better.
    chance, strengths, cut = np.random.default_rng(2), [], []
    for _ in range(pings):
        ping = halves(sounder, *bed(sounder, chance, depth=depth, strength=lambertian), chance)
        found = detect(ping, time=sounder.time, sines=sounder.sines, head=head_of(sounder))
        slant, about = areas(sounder, found)
        step = sounder.time[1] - sounder.time[0]
        area = ensonified_area(slant, found.incidence, stretch=(found.end - found.begin) * step, **about)
        loss = 40 * np.log10(slant)
        strengths.append(strength_db(found.intensity, source_level_db=0.0, loss_db=loss, area=area))
        cut.append(snippets(ping, time=sounder.time, detected=found.time, begin=found.begin, end=found.end, samples=60,
                            incidence=found.incidence, slant_range=slant, loss_db=loss, source_level_db=0.0,
                            absorption_db=0.0, **about).strength_db)
    angle = np.degrees(np.arcsin(sounder.sines))
    truth = lambertian(np.radians(angle))
    for low in range(-70, 70, 20):
        band = (angle >= low) & (angle < low + 20) & (np.abs(angle) < 68)
        mean = np.nanmean(10 ** (np.array(strengths) / 10) / truth, axis=0)[band].mean()
        assert abs(10 * np.log10(mean)) < 0.5, (low, 10 * np.log10(mean))
        sampled = np.nanmean(10 ** (np.array(cut) / 10) / truth[:, None], axis=(0, 2))[band].mean()
        assert abs(10 * np.log10(sampled)) < 0.7, (low, 10 * np.log10(sampled))


def test_the_area_is_the_pulses_aside_and_the_beams_below():
    slant, transmit, receive, pulse = 50.0, 0.02, 0.015, 1e-4
    about = dict(pulse_length=pulse, transmit_width=transmit, receive_width=receive, sound_speed=1500.0)
    aside, below = np.radians(65), 0.0
    by_pulse = slant * transmit * 1500 * pulse / 2 / np.sin(aside)
    by_beam = slant ** 2 * transmit * receive
    assert ensonified_area(slant, aside, **about) == pytest.approx(by_pulse, rel=0.01)
    assert ensonified_area(slant, below, **about) == pytest.approx(by_beam, rel=0.01)
    # Between both 1/A² is the sum of theirs.
    angle = np.radians(8)
    pulse_area = slant * transmit * 1500 * pulse / 2 / np.sin(angle)
    beam_area = by_beam / np.cos(angle)
    between = 1 / np.hypot(1 / pulse_area, 1 / beam_area)
    assert ensonified_area(slant, angle, **about) == pytest.approx(between, rel=0.01)


def test_every_correction_has_its_sign():
    about = dict(source_level_db=200.0, loss_db=np.array([80.0]), area=np.array([1.0]))
    level = strength_db(np.array([1e10]), **about)
    assert level == pytest.approx(100.0 - 200.0 + 80.0)
    assert strength_db(np.array([1e10]), transmit_pattern_db=-3.0, receive_pattern_db=-2.0, **about) == pytest.approx(
        level + 5.0)
    assert np.isnan(strength_db(np.array([0.0]), **about))


def test_decibels_of_speckle_average_two_and_a_half_lower():
    speckle = np.random.default_rng(1).exponential(size=200_000)
    assert np.mean(10 * np.log10(speckle)) == pytest.approx(DB_MEAN_BIAS, abs=0.05)


def test_snippets_start_where_they_say_and_end_with_the_footprint():
    time = 0.01 + 1e-4 * np.arange(400)
    record = np.full((2, 400), 1.0 + 0j)
    record[0, 210] = 10.0
    made = snippets((record, record), time=time, detected=np.array([time[210], np.nan]), begin=np.array([205, 0]),
                    end=np.array([216, 9]), samples=31, incidence=np.full(2, 0.5), slant_range=np.full(2, 20.0),
                    loss_db=np.full(2, 60.0), pulse_length=2e-4, transmit_width=0.02, receive_width=0.1,
                    sound_speed=1500.0, source_level_db=0.0, absorption_db=0.1)
    assert made.strength_db.shape == (2, 31) and np.isfinite(made.strength_db[0]).sum() == 11
    place = np.nanargmax(made.strength_db[0])
    assert made.start[0] + place * 1e-4 == pytest.approx(time[210])
    assert np.isnan(made.start[1]) and np.isnan(made.strength_db[1]).all()
