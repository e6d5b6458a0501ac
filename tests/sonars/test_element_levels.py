"""Levels of element responses and signals against closed forms.

An omnidirectional element at altitude h above a flat Lambert bed, σ = μ sin² θ, α the absorption. In water of one speed
sin θ = h/R, and rings dA = 2π R dR bring

    <|h|²> per metre of slant range = 2π R μ (h/R)² R^-4 10^(-2 α R / 10)

In water of layers it is 2π x dx σ(θ) (c_h/c_0)² 10^(-2 α L / 10) / A², of the exact eigenrays. A kernel that puts each
echo into one sample keeps Σ |e|² of that sample as <|h|²>.

Known bias: none of level. Energies are told without chance in the amplitudes (|g| = 1) and still scatter, because a
cell's point lies anywhere in it: about 0.01 dB in gates of 1000 cells, hence the tolerances of 0.02 to 0.05 dB. Echoes
with speckle need many independent samples: 0.2 dB is more than 3 standard errors, 4.34 / √samples dB. Beds of other ids
are other seabeds.
"""
import numpy as np
import pytest
from scipy.integrate import quad, trapezoid
from summer import SUMMER_TEXT

import mitsonar
from mitsonar.echoes.ensonification import Ensonification
from mitsonar.echoes.scatterers.scatterers import Scatterers
from mitsonar.propagation import eigenray
from mitsonar.signal.impulses import BandLimited
from mitsonar.signal.reception import band_filter
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, point_target

MU, ALPHA, ALTITUDE = 10 ** -2.7, 0.030, 10.0
EDGES = np.arange(11.0, 29.0)                                         # of gates of slant range [m]
ENSONIFICATIONS = {"scatterers": {"cell": 0.1}, "rays": {"cell": 0.1, "ensonification": "rays", "rays": 400_000}}


def flat(r, altitude=ALTITUDE):
    """Energy per metre of slant range above a flat bed."""
    return 2 * np.pi * r * MU * (altitude / r) ** 2 * r ** -4.0 * 10 ** (-0.2 * ALPHA * r)


def gates(density, edges=EDGES):
    return np.array([quad(density, *some)[0] for some in zip(edges, edges[1:])])


def db(ratio):
    return 10 * np.log10(ratio)


@pytest.fixture
def sure(monkeypatch):
    """Amplitudes without chance: |g| = 1."""
    monkeypatch.setattr("mitsonar.echoes.scatterers.scatterers.gaussian", lambda lib, *_: (lib.Float(1), lib.Float(0)))


def echoes(scene, key=7):
    """Half the two-way time [s], energy and place (R, 3) of all echoes of the first ping, element patterns apart."""
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    geometry, water = survey.surroundings
    light = Ensonification(Scatterers(geometry, survey.cell_size), water, frequency=survey.frequency,
                           window=(survey.start, survey.time[-1]), margin=0.0,
                           method=survey.ensonification, rays=survey.rays, beams=None)
    origin, rotation = survey.track.position[0], survey.track.rotation()[0]
    found = [(block.out.travel_time.numpy(), sum(part.numpy().astype(float) ** 2 for part in block.amplitude),
              origin + block.out.offset.numpy().T)
             for block in light.echoes(origin, rotation, float(survey.depth_below[0]), key)]
    return (np.concatenate(column) for column in zip(*found))


def gated(scene, edges=EDGES, speed=1500.0, **options):
    """Energy of the echoes in gates of slant range."""
    time, energy, _ = echoes(scene, **options)
    return np.histogram(speed * time, edges, weights=energy)[0]


# ------------------------------------------------------------------------------------------- energies, no speckle
@pytest.mark.parametrize("ensonification", ENSONIFICATIONS)
def test_flat_bed_closes_within_hundredths_of_a_decibel(variant, sure, ensonification):
    energy = gated(array_sonar({"bed": bed(20.0, size=60.0)}, integrator=ENSONIFICATIONS[ensonification]))
    assert np.abs(db(energy / gates(flat))).max() < 0.03
    assert abs(db(energy.sum() / gates(flat).sum())) < 0.005


@pytest.mark.parametrize("ensonification", ENSONIFICATIONS)
def test_level_follows_refraction(variant, sure, ensonification):
    """Thermocline; gates of 1 m of mean speed, integrated over the eigenrays of 4000 ranges."""
    scene = array_sonar({"bed": bed(30.0, size=70.0)}, water={"profile": SUMMER_TEXT},
                        integrator=ENSONIFICATIONS[ensonification], film={"range": 35.0})
    profile = scene.sensors()[0].water.profile
    x = np.linspace(1e-3, 33, 4000)
    ray = eigenray(profile, 10.0, 30.0, x)
    ratio = profile.at(30.0) / profile.at(10.0)
    per_x = (2 * np.pi * x * MU * np.sin(ray.arrival_angle) ** 2 * ratio ** 2 * 10 ** (-0.2 * ALPHA * ray.arc_length)
             / ray.spreading_area ** 2)
    within = np.concatenate([[0], np.cumsum(0.5 * (per_x[1:] + per_x[:-1]) * np.diff(x))])
    edges = np.arange(21.0, 36.0)
    expected = np.diff(np.interp(edges / 1500.0, ray.travel_time, within))
    assert np.abs(db(gated(scene, edges) / expected)).max() < 0.03


@pytest.mark.parametrize("finer", [{"cell": 0.1}, {"cell": 0.2, "ensonification": "rays", "rays": 300_000},
                                   {"cell": 0.2, "ensonification": "rays", "rays": 600_000}])
def test_neither_cells_nor_rays_move_the_level(variant, sure, finer):
    coarse, fine = (gated(array_sonar({"bed": bed(20.0, size=60.0)}, integrator=some), np.arange(11.0, 29.0, 2.0))
                    for some in ({"cell": 0.2}, finer))
    assert np.abs(db(fine / coarse)).max() < 0.05
    assert abs(db(fine.sum() / coarse.sum())) < 0.01


@pytest.mark.parametrize("ensonification, within", [("scatterers", 0.03), ("rays", 0.1)])
def test_tilted_bed(variant, sure, ensonification, within):
    """All rings about the foot of the perpendicular are those of a flat bed at that distance, to the edges of it. Rays
    are spread for a level bed and get rare uphill."""
    import mitsuba as mi

    tilt, T = 20.0, mi.ScalarTransform4f
    shape = {**bed(0.0, size=200.0), "to_world": T().translate([0, 0, -20]).rotate([0, 1, 0], tilt).scale([25, 25, 1])}
    altitude = 10 * np.cos(np.radians(tilt))
    edges = np.arange(10.0, 23.0)
    expected = gates(lambda r: flat(r, altitude), edges)
    energy = gated(array_sonar({"bed": shape}, integrator=ENSONIFICATIONS[ensonification]), edges)
    assert np.abs(db(energy / expected)).max() < within


UNEVEN = {
    "rippled": {"length": 20.0, "width": 70.0, "spacing": 0.1, "ripple_wavelength": 1.0, "ripple_height": 0.3,
                "ripple_heading_deg": 90.0},
    "rough": {"length": 30.0, "width": 70.0, "spacing": 0.25, "fractal_rms": 0.2},
}


@pytest.mark.parametrize("name", UNEVEN)
def test_both_ways_to_ensonify_see_the_same_uneven_bed(variant, sure, name):
    """Slopes and shadows through a thermocline: rays, and ways to cells, know nothing of each other."""
    shape = {"type": "seabed", "depth": 20.0, "bsdf": {"type": "lambert"}, **UNEVEN[name]}
    by_cells, by_rays = (gated(array_sonar({"bed": shape}, water={"profile": SUMMER_TEXT}, integrator=some,
                                           film={"range": 32.0}), np.arange(12.0, 30.0, 2.0))
                         for some in ({"cell": 0.1}, {"cell": 0.1, "ensonification": "rays", "rays": 1_000_000}))
    assert np.abs(db(by_cells / by_rays)).max() < 0.05


# ------------------------------------------------------------------------------------------- shadow, point target
FRONT, BACK, TOP, BEHIND = 10.0, 11.0, -18.0, 13.75                   # of a box across a strip of bed [m]


def boxed(**integrator):
    """A strip of bed to the east, 6 m wide, and a box 2 m high that fills it; the bed is seen again from BEHIND on."""
    import mitsuba as mi

    T = mi.ScalarTransform4f
    strip = {**bed(0.0, size=200.0), "to_world": T().translate([13, 0, -20]).scale([15, 3, 1])}
    box = {"type": "cube", "to_world": T().translate([0.5 * (FRONT + BACK), 0, TOP - 1]).scale([0.5, 4, 1]),
           "bsdf": strip["bsdf"]}
    return array_sonar({"bed": strip, "box": box}, integrator=integrator, film={"range": 27.0})


@pytest.mark.parametrize("ensonification", ["scatterers", "rays"])
def test_a_box_casts_its_shadow(variant, sure, ensonification):
    """What is heard stands in the light: of rays that find cells, up to a cell off. Energies of face, top and bed by
    a sum over 1 cm patches."""
    cell = 0.05
    _, energy, place = echoes(boxed(cell=cell, ensonification=ensonification, rays=400_000))
    slack = 2e-2 if ensonification == "scatterers" else cell
    on_bed = place[:, 2] < -20 + 1e-3
    hidden = (place[:, 0] > FRONT + slack) & (place[:, 0] < BEHIND - slack) & on_bed
    assert not hidden.any()
    assert not ((place[:, 0] > BACK - 1e-3) & ~on_bed & (place[:, 2] < TOP - 1e-3)).any()          # nor its back
    distance = np.linalg.norm(place - [0, 0, -10], axis=1)
    edges = np.array([10.5, 11.5, 12.5, 13.5, 14.8, 16.9, 18.0, 20.0, 22.0, 24.0])
    total = np.histogram(distance, edges, weights=energy)[0]
    expected = brute_force(edges)
    dark = expected == 0
    assert dark.sum() == 1 and total[dark] == 0
    assert np.abs(db(total[~dark] / expected[~dark])).max() < (0.05 if ensonification == "scatterers" else 0.1)


def brute_force(edges, step=0.01):
    """Energies of what is lit of the box and its bed, in gates."""
    def centres(first, last):
        return np.arange(first + step / 2, last, step)

    total = 0
    strip, face = centres(-3, 3), centres(-4, 4)
    for x, y, z, axis in ((centres(-2, FRONT), strip, -20.0, 2), (centres(BEHIND, 28), strip, -20.0, 2),
                          (centres(FRONT, BACK), face, TOP, 2), (FRONT, face, centres(-20, TOP), 0)):
        place = np.stack(np.broadcast_arrays(*np.ix_(*map(np.atleast_1d, (x, y, z)))), -1).reshape(-1, 3) + [0, 0, 10.0]
        r = np.linalg.norm(place, axis=1)
        power = MU * (place[:, axis] / r) ** 2 * r ** -4 * 10 ** (-0.2 * ALPHA * r) * step ** 2
        total = total + np.histogram(r, edges, weights=power)[0]
    return total


def test_nothing_is_heard_from_the_shadow(variant):
    response = mitsonar.impulse_response(boxed(cell=0.1), kernel="nearest")
    slant_range = 750.0 * response["time"].values
    power = np.abs(response.values[0, 0, 0]) ** 2
    dark = (slant_range > 14.75) & (slant_range < 16.9)         # the lowest corner of the face lies at 14.697 m
    assert (power[dark] == 0).all()
    assert (power[(slant_range > 17.3) & (slant_range < 24)] > 0).all()


@pytest.mark.parametrize("water", [{"sound_speed": 1500.0}, {"profile": SUMMER_TEXT}], ids=["uniform", "summer"])
@pytest.mark.parametrize("strength_db", [0.0, -30.0])
def test_level_of_a_point_target(variant, water, strength_db):
    """h = 10^(TS/20) 10^(-2 α L / 20) (c_h/c_0) / A, to float32."""
    scene = array_sonar({"bed": buried_bed(40.0), "ball": point_target([12.0, 20.0, -25.0], strength_db)}, water=water,
                        integrator={"cell": 5.0})
    profile = scene.sensors()[0].water.profile
    ray = eigenray(profile, 10.0, 25.0, np.hypot(12, 20))
    expected = (10 ** (strength_db / 20) * 10 ** (-0.1 * ALPHA * ray.arc_length) * profile.at(25.0) / profile.at(10.0)
                / ray.spreading_area)
    found = np.abs(mitsonar.impulse_response(scene, kernel="nearest").values).max()
    assert 2 * db(found / expected) == pytest.approx(0, abs=2e-3)


# ------------------------------------------------------------------------------------------- with speckle
def test_mean_intensity_of_responses(variant):
    """Six beds and samples of 7.5 mm, each on its own: gates of 6 m have 4800, 0.063 dB, together 0.036 dB."""
    total, edges, per_sample = 0, np.array([11.0, 17.0, 23.0, 29.0]), 750.0 / 100e3
    for number in range(6):
        scene = array_sonar({f"bed {number}": bed(20.0, size=60.0)}, integrator={"cell": 0.2},
                            film={"sample_rate_khz": 100.0, "range_min": 10.5})
        response = mitsonar.impulse_response(scene, kernel="nearest")
        r = 750.0 * response["time"].values
        total = total + np.histogram(r, edges, weights=np.abs(response.values[0, 0, 0]) ** 2 / flat(r))[0]
    samples = np.histogram(r, edges)[0] * 6
    assert np.abs(db(total / samples / per_sample)).max() < 0.2
    assert abs(db(total.sum() / samples.sum() / per_sample)) < 0.1


LENGTH, WAVELENGTH, TOW, LOSS, DURATION, RATE = 0.5, 0.015, 20.0, 0.03339952697, 5e-5, 200e3


def line_energy(r):
    """Per metre of slant range, of both sides together, for lines of LENGTH along the track as source and receiver."""
    cosine, azimuth = np.sqrt(1 - (TOW / r) ** 2), np.linspace(0, 1, 4001) ** 3 * np.pi / 2     # dense in the beam
    beam = 4 * trapezoid(np.sinc(LENGTH / WAVELENGTH * cosine * np.sin(azimuth)) ** 4, azimuth)
    return beam * r * MU * (TOW / r) ** 2 * r ** -4.0 * 10 ** (-0.2 * LOSS * r)


@pytest.mark.parametrize("r, level_db", [(25.0, 121.48029), (40.0, 108.65570), (75.0, 92.19240), (100.0, 84.20113)])
def test_closed_form_of_lines(r, level_db):
    """Values computed elsewhere by two-dimensional integration: one side, 220 dB, gate of 0.1 ms before 2 r / c."""
    gate = quad(line_energy, r - 0.075, r)[0]
    assert 220 + db(gate / 2) == pytest.approx(level_db, abs=2e-5)


def test_mean_intensity_of_signals_with_patterns(variant):
    """CW of 0.05 ms from a 0.5 m line to a 0.5 m line: the sonar equation's gate of c τ / 2, times the share of the
    pulse's energy that the record's band lets through. Ten beds of 14 m hold 3700 gates: 0.07 dB."""
    fine = np.linspace(29.0, 44.0, 1501)
    density, gate = np.array([line_energy(r) for r in fine]), 750.0 * DURATION
    within = np.concatenate([[0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
    frequency = np.linspace(-0.5, 0.5, 20_001) * RATE
    let_through = BandLimited().response(frequency / RATE) * band_filter(frequency, RATE)
    share = trapezoid(DURATION * np.sinc(frequency * DURATION) ** 2 * let_through ** 2, frequency)
    assert db(share) == pytest.approx(-0.113, abs=1e-3)
    ratio = []
    for number in range(10):
        strip = {"type": "seabed", "depth": 40.0, "length": 16.0, "width": 90.0, "spacing": 8.0,
                 "bsdf": {"type": "lambert", "mu_db": -27.0}}
        line = {f"{which}{name}": value for which in ("transmit", "receive") for name, value in
                (("", "line"), ("_elements", 1), ("_element_length", LENGTH), ("_axis", "forward"))}
        scene = array_sonar({f"bed {number}": strip}, integrator={"cell": 0.075},
                            sensor={"start": [0.0, 0.0, -TOW], "pulse": "cw", "pulse_ms": 1e3 * DURATION,
                                    "source_level_db": 220.0, **line},
                            water={"absorption_db_per_km": 1e3 * LOSS},
                            film={"range": 44.0, "range_min": 30.0, "sample_rate_khz": RATE / 1e3})
        signals = mitsonar.element_signals(scene)
        r = 750.0 * signals["time"].values
        expected = 1e22 * share * (np.interp(r, fine, within) - np.interp(r - gate, fine, within))
        ratio.append(np.mean(np.abs(signals.values[0, 0, 0]) ** 2 / expected))
    assert abs(db(np.mean(ratio))) < 0.2


def test_energy_of_a_response_is_that_of_the_echo_times_the_kernels(variant):
    """A point target at 20 m, default kernel: Σ|h|² = 0.7921 / R⁴ within 0.06 dB, and the response says so."""
    scene = array_sonar({"bed": buried_bed(30.0), "buoy": point_target([3.0, 19.7, -10.0])}, integrator={"cell": 4.0},
                        water={"absorption_db_per_km": 0.0})
    response = mitsonar.impulse_response(scene)
    found = float(np.sum(np.abs(response.values) ** 2)) * np.hypot(3.0, 19.7) ** 4
    assert response.attrs["kernel_energy"] == pytest.approx(0.7921, abs=1e-4)
    assert 10 * np.log10(found / response.attrs["kernel_energy"]) == pytest.approx(0, abs=0.06)
