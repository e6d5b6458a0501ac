"""Targets that scatter by a function of their own, through the whole chain.

One omnidirectional element, water without absorption. The spectrum of the echo over that of a point target of 0 dB at
the same place is f, for every frequency of the band: to 0.1 dB, which is what interpolated delays and a sampled record
allow, from the strongest frequency down to 20 dB below it.
"""
import numpy as np
import pytest
from sonar_scenes import array_sonar, buried_bed, forward_looking, sidescan

import mitsonar
from mitsonar.scattering import MATERIALS, SphereBody, sphere_form

mi = pytest.importorskip("mitsuba")
SPEED, CARRIER, BAND, RANGE = 1500.0, 100e3, 40e3, 20.0
PLACE = [0.0, RANGE, -10.0]
BODIES = {"rigid_sphere": "rigid", "soft_sphere": "soft", "elastic_sphere": MATERIALS["tungsten_carbide"]}


def signals(target, sensor=None):
    """Samples (N,) and their rate."""
    scene = array_sonar(
        {"bed": buried_bed(60.0), "ball": {"type": "point_target", "position": PLACE, **target}}, depth=10.0,
        water={"absorption_db_per_km": 0.0, "sound_speed": SPEED}, film={"range": 26.0, "range_min": 18.0},
        sensor={"pulse": "lfm", "pulse_ms": 2.0, "frequency_khz": CARRIER / 1e3, "bandwidth_khz": BAND / 1e3,
                **(sensor or {})})
    found = mitsonar.element_signals(scene)
    return found.values.astype(complex).squeeze(), float(found.attrs["sampling_rate"])


def quotient(target):
    """Frequencies of the band [Hz] and the echo's spectrum over that of a target of 0 dB."""
    (ours, rate), (one, _) = signals(target), signals({"target_strength_db": 0.0})
    frequency = np.fft.fftfreq(len(one), 1 / rate) + CARRIER
    order = np.argsort(frequency)
    within = order[np.abs(frequency[order] - CARRIER) < 0.45 * BAND]
    return frequency[within], (np.fft.fft(ours) / np.fft.fft(one))[within]


@pytest.mark.parametrize("kind", BODIES)
def test_the_echo_of_a_sphere_has_the_spectrum_of_its_series(variant, kind):
    """ka 6.5 to 9.7, level and phase: the phase is that about the middle, so the delay of the front is in it."""
    frequency, got = quotient({"scattering": kind, "radius": 0.01905})
    form = sphere_form(0.01905, frequency, SPEED, body=SphereBody(inside=BODIES[kind]))
    strong = np.abs(form) > 0.1 * np.abs(form).max()
    assert np.max(np.abs(20 * np.log10(np.abs(got / form)[strong]))) < 0.1
    assert np.max(np.abs(np.angle(got / form)[strong])) < 0.02
    assert np.max(np.abs(got - form)) < 0.01 * np.abs(form).max()


def test_an_elastic_sphere_rings_after_its_first_echo(variant):
    """The compressed echo of tungsten carbide has 1 % of its energy 0.15 to 2 ms after its middle; a rigid one less
    than a hundredth of that."""
    late = {}
    for kind in ("elastic_sphere", "rigid_sphere"):
        frequency, got = quotient({"scattering": kind, "radius": 0.01905})
        power = np.abs(np.fft.ifft(got * np.hanning(len(got)))) ** 2
        time = np.arange(len(got)) / (frequency[1] - frequency[0]) / len(got)
        late[kind] = power[(time > 0.15e-3) & (time < 2e-3)].sum() / power.sum()
    print(late)
    assert late["elastic_sphere"] > 0.01 > 100 * late["rigid_sphere"]


def test_strength_against_aspect_is_that_of_the_table(variant, tmp_path):
    """Two points 0.2 m apart in a table, the target turned: the spectrum is the interference of both."""
    degrees, kilohertz = np.arange(0, 181, 5.0), np.arange(68, 132.1, 0.5)
    half = 0.1
    k = 2e3 * np.pi * kilohertz / SPEED
    form = 0.05 * (1 + 0.5 * np.exp(2j * k * 2 * half * np.cos(np.radians(degrees))[:, None]))
    path = tmp_path / "pair.csv"
    path.write_text("frequency_khz,aspect_deg,real,imaginary\n" + "\n".join(
        f"{f},{a},{z.real},{z.imag}" for a, row in zip(degrees, form) for f, z in zip(kilohertz, row)))
    for heading in (60.0, 90.0):
        turned = mi.ScalarTransform4f().translate(PLACE).rotate([0, 0, 1], heading)
        frequency, got = quotient({"scattering": "table", "table": str(path), "position": [0.0, 0.0, 0.0],
                                   "to_world": turned})
        # the x axis points to the east, turned by the heading; the sonar lies to the south
        aspect = np.arccos(-np.sin(np.radians(heading)))
        expected = 0.05 * (1 + 0.5 * np.exp(4j * half * 2 * np.pi * frequency / SPEED * np.cos(aspect)))
        assert np.max(np.abs(got - expected)) < 0.01 * np.abs(expected).max()


@pytest.mark.parametrize("kind", [sidescan, forward_looking])
def test_pictures_show_a_sphere_as_bright_as_its_strength(variant, kind):
    """Rigid, ka above 40: a/2 within 0.1 dB, so the brightest place is that of such a point target, but for where in
    its bin the echo lies: 1.5 dB."""
    place = [12.0, 0.0, -18.0] if kind is sidescan else [0.0, 12.0, -18.0]
    brightest = []
    for target in ({"scattering": "rigid_sphere", "radius": 0.1}, {"target_strength_db": 20 * np.log10(0.05)}):
        shapes = {"bed": buried_bed(60.0), "ball": {"type": "point_target", "position": place, **target}}
        picture = mitsonar.render(kind(shapes, film={"range": 20.0}))
        brightest.append(float(picture["level"].max()))
    assert brightest[0] == pytest.approx(brightest[1], abs=1.5)


@pytest.mark.parametrize("target, said", [
    ({"scattering": "rigid_sphere"}, "radius"), ({"scattering": "table"}, "table is missing"),
    ({"scattering": "fluid_sphere", "radius": 0.1, "density": 900.0}, "give both"),
    ({"scattering": "elastic_sphere", "radius": 0.1, "shear_speed": 6800.0}, "shear waves"),
    ({"scattering": "rigid_sphere", "radius": 0.1, "to_world": 2.0}, "to_world scales"),
    ({"scattering": "rigid_sphere", "radius": 0.1, "target_strength_db": 3.0}, "target_strength_db"),
    ({"radius": 0.1}, 'scattering is "constant"'), ({"scattering": "table", "table": "none.csv"}, "not there")])
def test_what_does_not_fit_is_refused(variant, target, said):
    from mitsonar.scene.errors import plain

    if "to_world" in target:
        target = {**target, "to_world": mi.ScalarTransform4f().scale(target["to_world"])}
    with pytest.raises((ValueError, RuntimeError)) as caught:
        mi.load_dict({"type": "point_target", "position": PLACE, **target})
    assert said in plain(caught.value)
