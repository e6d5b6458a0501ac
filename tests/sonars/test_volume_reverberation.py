"""Reverberation of the water, through the chains of a sidescan and of an array.

Uniform water: RL = SL - 20 log R - 2 α R + S_v + 10 log(ψ ΔR) (Urick 1983, chapter 8), ψ the two-way beam [sr]. A
layer: s_v by direction, at depth z = z_0 + R sin(depression), integrated over the beam,

    p²(R) = 10^(SL/10) R^-2 10^(-2 α R/10) ∫∫ B(u, φ) s_v(z) du dφ ΔR

Means over pings; tolerance 0.05 dB for uniform water and 0.2 dB in gates of the layer, several standard errors either.
"""
import numpy as np
from scipy.integrate import trapezoid
from sonar_scenes import array_sonar, bed, buried_bed, forward_looking, lambert, multibeam, sidescan

import mitsonar
from mitsonar.imaging import fan
from mitsonar.signal.matched_filtering import compression
from mitsonar.survey.beam_domain.frames import Frames
from mitsonar.survey.multibeam.beams import sector_beams
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.verbs.images import opened
from mitsonar.water.volume import volume_reverberation_db

ALPHA = 0.030


def rendered(water, pings=20, rays=40_000):
    scene = sidescan({"seabed": bed(400.0, lambert(-60.0), size=200.0)}, rays=rays, water=water,
                     sensor={"pings": pings, "start": [0.0, 0.0, -200.0]}, film={"bins": 400, "range": 100.0})
    dataset = mitsonar.render(scene)
    sonar = sonar_at(scene.sensors()[0], 200.0)
    width = dataset.attrs["bin_width"]
    share = min(1.0, sonar.resolution / width)
    power = 10 ** (dataset["path_level"].sel(path_name="v").values.astype(float) / 10) / share
    return dataset, sonar, power.mean(0), width


def test_uniform_water(variant):
    dataset, sonar, power, width = rendered({"volume_strength_db": -60.0})
    r = dataset["range"].values
    expected = volume_reverberation_db(sonar.source_level_db, r, -60.0, sonar.solid_angle(), 2 * width / 1500, ALPHA)
    off = 10 * np.log10(power.mean(0))[20:] - expected[20:]
    assert abs(off.mean()) < 0.01
    assert np.abs(off.reshape(-1, 20).mean(1)).max() < 0.05
    assert dataset.attrs["labels"]["2"] == "water"
    assert not dataset["label"].values[..., :300].any()          # no ray of the main lobe comes back from the water


def test_a_layer(variant):
    """From 20 to 40 m below the sonar: heard from 20 m on, most where the beam looks into it."""
    dataset, sonar, power, width = rendered({"layers": "fish 220 240 -60"}, pings=60)
    r = dataset["range"].values
    phi = np.linspace(-np.pi / 2, np.pi / 2, 20001)
    u = np.linspace(-1, 1, 4001)
    across = sonar.across_intensity(np.sin(phi - sonar.depression_angle))
    # v = w sin(φ - δ): across the beam w is 1 within 1e-4
    along = trapezoid(sonar.along_intensity(u), u)
    for side in (0, 1):
        for gate in range(90, 390, 30):
            some = slice(gate, gate + 30)
            inside = [trapezoid(across * ((R * np.sin(phi) > 20) & (R * np.sin(phi) < 40)), phi) for R in r[some]]
            expected = 10 ** (sonar.source_level_db / 10 - 6) * along * np.array(inside) * width * r[some] ** -2 * (
                10 ** (-0.2 * ALPHA * r[some]))
            assert abs(10 * np.log10(power[side, some].sum() / expected.sum())) < 0.2
    assert power[:, :79].max() < 1e-6 * power.max()              # nothing nearer than the layer


def test_an_array_hears_as_much(variant):
    """Energies of the echoes that an omnidirectional element hears: ψ = 4π less what lies above the surface."""
    scene = array_sonar({"bed": buried_bed(60.0)}, sensor={"start": [0.0, 0.0, -30.0]},
                        water={"volume_strength_db": -60.0}, film={"range": 28.0},
                        integrator={"cell": 5.0, "rays": 100_000})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ensonification = PressureRecord(survey).ensonification(0)
    edges = np.arange(4.0, 28.0, 4.0)
    found = np.zeros(len(edges) - 1)
    for echoes in ensonification.echoes(survey.track.position[0], survey.track.rotation()[0], 30.0, 3):
        if echoes.path == "v":
            energy = echoes.energy.numpy().astype(float)
            found += np.histogram(1500 * echoes.out.travel_time.numpy(), edges, weights=energy)[0]
            amplitude = np.hypot(*(part.numpy() for part in echoes.amplitude)) ** 2 / energy
    fine = [np.linspace(a, b, 201) for a, b in zip(edges[:-1], edges[1:])]
    expected = [trapezoid(4 * np.pi * 1e-6 * r ** -2 * 10 ** (-0.2 * ALPHA * r), r) for r in fine]
    assert np.abs(10 * np.log10(found / expected)).max() < 0.05
    assert abs(amplitude.mean() - 1) < 4 / np.sqrt(len(amplitude))
    assert mitsonar.impulse_response(scene, paths=["v"]).values.any()


def test_the_water_in_the_beams_of_a_long_transmitting_line_is_speckle(variant):
    """Where a line sends narrowly enough points are drawn: variance over squared mean is 1, and the mean is

        10^(SL/10) s_v (c/2) ∫|χ|² dt ∫∫ |b_t b_r|² dΩ R^-2 10^(-2 α R/10)

    Over 6000 independent cells chance leaves 0.06 dB and 0.04. Points of a few a cell add up to 0.15 to the latter; it
    is 90 where directions follow the elements' beams alone.
    """
    scene = multibeam({"seabed": bed(400.0)}, depth=100.0, water={"volume_strength_db": -60.0}, film={"range": 30.0},
                      sensor={"beams": 24, "swath_deg": 100.0, "transmit_beam_width_deg": 1.0, "pings": 1,
                              "receive_beam_width_deg": 3.0, "receive_flaws": 0.0, "pulse_ms": 0.1})
    scene, sensor, integrator = opened(scene, 0)
    beams, = sector_beams(integrator.survey(scene, sensor))
    run, t = beams.run, beams.time
    r = 750.0 * t
    some = (r > 10) & (r < 29)
    arrays, wavelength = (run.survey.transmit, run.survey.receive), run.survey.wavelength
    forward, starboard = np.linspace(-0.2, 0.2, 1601), np.linspace(-0.999, 0.999, 1001)
    f, s = np.meshgrid(forward, starboard, indexing="ij")
    inside = f ** 2 + s ** 2 < 0.9999
    down = np.sqrt(np.where(inside, 1 - f ** 2 - s ** 2, 1))
    solid = np.where(inside, 1 / down, 0)
    for array in arrays:
        solid *= array.element_pressure(np.stack([f, s, down], -1), wavelength, array.normal[0], array.along[0]) ** 2

    def power(array, axis, sines):
        place = array.position[:, axis] / wavelength
        return np.abs(np.exp(2j * np.pi * np.multiply.outer(sines, place)) @ array.weight / array.weight.sum()) ** 2

    sent = power(arrays[0], 0, forward)
    length = compression(run.survey.pulse, run.survey.sampling_rate)[0]
    intensity = np.abs(beams.halves(0, 1).whole[:, some]) ** 2
    ratio = []
    for sine, found in zip(run.sines[0], intensity):
        beam = sent @ solid @ power(arrays[1], 1, starboard - sine) * np.diff(forward)[0] * np.diff(starboard)[0]
        ratio.append(found / (10 ** (run.survey.source_level_db / 10 - 6) * 750.0 * length * beam
                              * r[some] ** -2 * 10 ** (-0.2 * ALPHA * r[some])))
    ratio = np.array(ratio)
    assert abs(10 * np.log10(ratio.mean())) < 0.3
    assert 0.8 < ratio.var() / ratio.mean() ** 2 < 1.3


def test_the_water_in_the_beams_of_a_receiving_line_is_speckle(variant):
    """In all beams of a frame, near and far, under a surface 6 m above: as above, over directions that are still in the
    water, with dΩ = du dφ about the line.

    Gates of 2 m have 4000 independent cells, which leave 0.08 dB and 0.06; points of a few a cell add up to 0.3 to the
    latter. It is 4 to 17 where directions follow the elements' beams alone.
    """
    scene = forward_looking({"seabed": bed(400.0)}, depth=6.0, film={"range": 24.0},
                            water={"volume_strength_db": -60.0},
                            sensor={"beams": 96, "receive_flaws": 0.0, "noise": False, "pings": 1})
    scene, sensor, integrator = opened(scene, 0)
    survey = integrator.survey(scene, sensor)
    direction = fan.fan_directions(survey.receive, sensor.beams, sensor.fan_width, sensor.beam_steps)[1]
    frames = Frames(survey, direction, per_cell=survey.per_cell)
    line, rotation = frames.line, survey.track.rotation()[0]
    u, turn = np.linspace(-0.9995, 0.9995, 2001), np.linspace(-np.pi, np.pi, 361)[1:]
    aside = np.cross(line.axis, line.normal)
    towards = (u[:, None, None] * line.axis + np.sqrt(1 - u ** 2)[:, None, None]
               * (np.cos(turn)[:, None] * line.normal + np.sin(turn)[:, None] * aside))
    solid = np.full(towards.shape[:2], (u[1] - u[0]) * (turn[1] - turn[0]))
    for array in (survey.transmit, survey.receive):
        solid *= array.element_pressure(towards, survey.wavelength, array.normal[0], array.along[0]) ** 2
    sent = survey.transmit.position / survey.wavelength
    sent = np.exp(2j * np.pi * (towards @ sent.T)) @ (survey.transmit.weight / survey.transmit.weight.sum())
    solid *= np.abs(sent) ** 2
    place, weight = line.place / survey.wavelength, line.weight / line.weight.sum()
    t = survey.time[survey.lead:]
    r = 750.0 * t
    length = compression(survey.pulse, survey.sampling_rate)[0]
    intensity = np.abs(frames.frame(0, 1)[0]) ** 2
    rise = (towards @ rotation.T)[..., 2]
    for first in np.arange(6.0, 23.0, 2.0):
        some = (r >= first) & (r < first + 2)
        inside = (solid * (rise * (first + 1) < 6.0)).sum(1)
        beam = np.abs((np.exp(2j * np.pi * np.multiply.outer(direction @ line.axis, place)) * weight)
                      @ np.exp(-2j * np.pi * np.multiply.outer(place, u))) ** 2 @ inside
        ratio = intensity[:, some] / (10 ** (survey.source_level_db / 10 - 6) * 750.0 * length * beam[:, None]
                                      * r[some] ** -2 * 10 ** (-0.2 * ALPHA * r[some]))
        assert abs(10 * np.log10(ratio.mean())) < 0.3
        assert 0.8 < ratio.var() / ratio.mean() ** 2 < 1.45


def test_the_water_that_elements_hear_is_speckle_in_their_beams(variant):
    """As above, in beams formed of element signals: p² R² 10^(2 α R/10) of a beam does not hang on the range."""
    scene = forward_looking({"seabed": bed(300.0)}, depth=100.0, film={"range": 16.0}, integrator={"cell": 2.0},
                            water={"volume_strength_db": -60.0},
                            sensor={"beams": 64, "receive_flaws": 0.0, "noise": False,
                                    "pings": 1, "picture": "elements", "recorder": "none"})
    image = mitsonar.render(scene, seed=1).isel(ping=0)
    r = image.range.values[image.range.values > 4]
    even = 10 ** (0.1 * image.level.sel(range=r).values.reshape(-1, len(r)) + 0.2 * ALPHA * r) * r ** 2
    even /= even.mean(1, keepdims=True)
    assert abs(10 * np.log10(even[:, r < 8].mean() / even[:, r > 12].mean())) < 0.2
    assert 0.8 < even.var() < 1.45
