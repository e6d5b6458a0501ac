"""One bed has one field of scatterers: different kinds of sonar on one track receive speckle that belongs together.

A sidescan's face and a row of an interferometric sidescan, of the same aperture, at the same places. The complex
speckle g of the sidescan's fine gates, with the compressed pulse χ of the interferometric at the distances of its
samples, Σ_j χ(t - t_j) g_j, is compared with the row's signal y, without the slow fall of its level:

    coherence = |Σ x* y| / √(Σ |x|² Σ |y|²)        over stretches of metres, in which the row's place turns the phase

Beds are seen from so far that the face's beam is that of the far field. With equal apertures the coherence is 1, less
what gates of finite length, the normalisation of gates and the side lobes, which the speckle leaves out, cost: 0.01
together. For apertures L and L' it is

    ∫ b² b'² du / √(∫ b⁴ du ∫ b'⁴ du),     b = sinc(L u / λ)

where the same scatterers take part, and lower by √(m / m') where one sonar has m of the other's m'. With
some 400 resolution cells, chance is 0.01.
"""
import functools
from dataclasses import replace

import numpy as np
import pytest
from scipy import fft
from sonar_scenes import array_sonar, bed as bed_of, forward_looking, interferometric

import mitsonar
from mitsonar.scene.loading import prepare
from mitsonar.signal.reception import band_filter
from mitsonar.sonar.faces.directivity import length_for_beam_width
from mitsonar.survey.interferometric.instrument import both_sides
from mitsonar.survey.sidescan.kind import plan
from mitsonar.survey.sidescan.speckle import SideSpeckle
from mitsonar.validation import scenes
from mitsonar.verbs.images import opened

PINGS, STRETCHES, WAVELENGTH = 1, 5, 0.015
TRACK = {"speed_knots": 3.0, "heading_deg": 25.0, "start": [3.0, -4.0, -20.0], "pings": PINGS, "ping_rate_hz": 4.0}
PROFILES = {"even": None, "summer": {"profile": "0:1508, 8:1507, 14:1494, 40:1490"}}
GLINTING = {**scenes.lambert(), "glints": 5.0, "glint_share": 0.8}
BEDS = {"level": bed_of(40.0, size=500.0), "glinting": bed_of(40.0, GLINTING, size=500.0),
        "rippled": {"type": "seabed", "depth": 40.0, "length": 300.0, "width": 300.0, "spacing": 0.5,
                    "ripple_wavelength": 3.0, "ripple_height": 0.2, "bsdf": {"type": "lambert"}}}
FAR = 59.0, 73.0                   # [m]


@pytest.fixture(scope="module", autouse=True)
def ready():
    prepare()


@functools.cache
def face(bed, water, width, per_cell, bins):
    """Speckle (ping, side, gate) that a sidescan's face receives, and where gates begin and how long they are [s]."""
    scene = scenes.sidescan({"bed": BEDS[bed]}, rays=100, water=PROFILES[water],
                            film={"range_min": FAR[0] - 2, "range": FAR[1] + 2, "bins": bins},
                            sensor={"frequency_khz": 100.0, "pulse_ms": 0.1, "beam_width_deg": width, "speckle": True,
                                    **TRACK}, integrator={"scatterers_per_cell": per_cell})
    survey = plan(scene, scene.sensors()[0], scene.integrator().settings)
    speckle = SideSpeckle(survey)
    start, end = survey.window[:2]
    return speckle.of(np.arange(PINGS))[..., 0], start, (end - start) / speckle.gates


@functools.cache
def interferometric_survey(bed, water, width):
    scene, sensor, path = opened(interferometric(
        {"bed": BEDS[bed]}, water=PROFILES[water], film={"range_min": FAR[0] - 2, "range": FAR[1] + 2, "bins": 100},
        sensor={"frequency_khz": 100.0, "pulse": "cw", "pulse_ms": 0.1, "beam_width_deg": width, "rows": "0, 0.5",
                "face_place": "0, 0, 0", "transmitter_place": "0, 0, 0", "noise": False, "tilt_deg": 20.0, **TRACK}))
    return path.survey(scene, sensor)


def compressed(pulse, rate, time, places, g):
    """Σ_j χ(t - t_j) g_j at times [s]; χ of the pulse, with the receiver's filter."""
    frequency = fft.fftfreq(4096, 1 / rate)
    power = np.abs(pulse.spectrum(rate, 4096)) ** 2 * band_filter(frequency, rate)
    keep = power > 1e-6 * power.max()
    turns = 2j * np.pi * frequency[keep]
    return np.exp(np.multiply.outer(time, turns)) @ (power[keep] * (np.exp(-np.multiply.outer(turns, places)) @ g))


def coherence(bed="level", water="even", widths=(3.0, 3.0), per_cell=20.0, bins=1000, denser=1.0):
    g, start, gate = face(bed, water, widths[0], per_cell, bins)
    survey = interferometric_survey(bed, water, widths[1])
    pulse, rate = survey.sides[0].pulse, survey.sides[0].sampling_rate
    # as many scatterers over the same ground: 1 / 2B against half a gate
    many = per_cell / (pulse.bandwidth * gate) * denser
    rows = both_sides(replace(survey, sides=tuple(replace(side, per_cell=many) for side in survey.sides)))
    time = survey.sides[0].time[survey.sides[0].lead:]
    inside = (time > FAR[0] / 750.0) & (time < FAR[1] / 750.0)
    places = start + (np.arange(g.shape[-1]) + 0.5) * gate
    together, own, other = 0.0, 0.0, 0.0
    for ping in range(PINGS):
        for side in (0, 1):
            y = rows[side].signals(ping, 0)[0][inside].astype(complex)
            # without the slow fall of the level
            y *= np.exp(-0.5 * np.polyval(np.polyfit(time[inside], np.log(np.abs(y) ** 2), 1), time[inside]))
            speckle = compressed(pulse, rate, time[inside], places, g[ping, side])
            for x, row in zip(*(np.array_split(part, STRETCHES) for part in (speckle, y))):
                together += abs(np.vdot(x, row))
                own, other = own + np.vdot(x, x).real, other + np.vdot(row, row).real
    return together / np.sqrt(own * other)


def test_a_face_and_a_row_of_one_aperture_receive_the_same_speckle():
    assert coherence(water="summer", per_cell=40.0) > 0.99


def test_so_they_do_over_ripples():
    """Half as many scatterers: 0.01 more of what costs coherence."""
    assert coherence("rippled", bins=500) > 0.975


def test_glints_of_both_are_the_same():
    """With glints that each count for more than the rest of a cell; others in each would leave some 0.6."""
    assert coherence("glinting", bins=500) > 0.975


@pytest.mark.parametrize("width", [2.0, 6.0])
def test_other_apertures_share_what_their_beams_share(width):
    lengths = np.array([length_for_beam_width(np.deg2rad(value), WAVELENGTH) for value in (3.0, width)])
    u = np.linspace(-0.3, 0.3, 20001)
    b, other = (np.sinc(length * u / WAVELENGTH) ** 2 for length in lengths)
    expected = np.sum(b * other) / np.sqrt(np.sum(b ** 2) * np.sum(other ** 2))
    same_number = lengths[0] / lengths[1]
    assert coherence(widths=(3.0, width), bins=500, denser=same_number) == pytest.approx(expected, abs=0.03)
    # by themselves, the denser set has scatterers that the other lacks
    assert coherence(widths=(3.0, width), bins=500) == pytest.approx(
        expected * np.sqrt(min(same_number, 1 / same_number)), abs=0.03)


@pytest.mark.parametrize("seeds, alike", [((1, 1), True), ((1, 2), False)])
def test_the_seed_draws_the_ground_of_all_kinds_unless_the_scene_does(exact, seeds, alike):
    """Elements, a beam and a face; `ground_seed` of the scene comes first."""
    film, ground = {"range": 30.0}, {"bed": bed_of(30.0, size=120.0)}
    makes = (lambda **more: mitsonar.element_signals(array_sonar(
                 ground, film=film, integrator={"cell": 0.5, **more.pop("path", {})}), **more),
             lambda **more: mitsonar.render(forward_looking(
                 ground, film=film, integrator=more.pop("path", {})), **more)["level"],
             lambda **more: mitsonar.render(scenes.sidescan(
                 ground, pings=1, rays=2000, sensor={"speckle": True}, film={**film, "bins": 100},
                 integrator=more.pop("path", {})), **more)["level"])
    for make in makes:
        first, other = (np.ravel(make(seed=seed)) for seed in seeds)
        assert np.array_equal(first, other) == alike
    held = [np.ravel(makes[0](seed=seed, path={"ground_seed": 7})) for seed in (1, 2)]
    np.testing.assert_array_equal(*held)
