"""Targets by way of the bed, of a flat surface, and of both, in a sidescan's record and in responses of an array.

A point target of strength T over a flat Lambert bed, one sound speed, both ways round together, R distances to the
sonar and D from bed to target:

    e² = 2 Σ_bed T B_b B_t μ (sin θ_in / R_b²) (sin θ_out / D²) 10^(-α (R_b + D + R_t) / 10) / R_t²

in gates of (R_b + D + R_t)/2, over a fine grid of the bed, whose own error is below 0.01 dB. By way of a mirror at
z = 0 the sonar stands at its image, R' away, and the echo turns its sign:

    bs: 2 f / (R R'),    sbs: f / R'²

f = √T, or a/2 of a rigid sphere, whose ranges end at its glints. Tolerances: rays 0.1 dB, closed forms 0.02 dB of
points and 0.5 dB of a sphere (physical optics, and near field).
"""
import numpy as np
import pytest

import mitsonar
from mitsonar.survey.pressure.pressure import PressureRecord
from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, lambert, point_target, sidescan

MIRROR = {"type": "sea_surface", "wind_speed": 0.0, "size": 400.0}


def by_bed(sonar, where, depth, edges, *, mu, alpha, beam=lambda towards: 1.0, one_side=False):
    """Energies of both orders in gates of half the way: mean squares per unit of target strength."""
    x, y = np.meshgrid(np.arange(-120, 120, 0.1) + 0.05, np.arange(-120, 120, 0.1) + 0.05)
    patch = np.stack([x.ravel(), y.ravel(), np.full(x.size, -depth)], 1)
    if one_side:
        patch = patch[patch[:, 0] > 0]
    to_bed, to_target, between = patch - sonar, where - sonar, where - patch
    r, d, t = (np.linalg.norm(way, axis=-1) for way in (to_bed, between, to_target))
    energy = 2 * mu * (-to_bed[:, 2] / r) * (between[:, 2] / d) / (r * d * t) ** 2 * 0.1 ** 2
    energy *= beam(to_bed / r[:, None]) * beam(to_target[None] / t) * 10 ** (-0.1 * alpha * (r + d + t))
    return np.histogram((r + d + t) / 2, edges, weights=energy)[0]


@pytest.mark.parametrize("targets", [1, 3])
def test_elements_hear_point_targets_by_way_of_the_bed(variant, targets):
    where, edges = np.array([0.0, 12.0, -14.0]), np.array([15.0, 17.0, 20.0, 25.0])
    # of three targets each brings a share: they stand in one place
    balls = {f"ball{i}": point_target(where, -10 * np.log10(targets)) for i in range(targets)}
    scene = array_sonar({"bed": bed(20.0, lambert(-10.0), size=200.0), **balls}, film={"range": 40.0},
                        integrator={"max_depth": 2, "cell": 3.0, "rays": 100_000})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    ensonification = PressureRecord(survey).ensonification(0)
    found, keys = 0, 4
    for key in range(keys):
        for echoes in ensonification.random_echoes(survey.track.position[0], survey.track.rotation()[0], 10.0, key):
            assert echoes.path == "bb"
            half = 0.75e3 * (echoes.arrival + echoes.back.travel_time).numpy()
            found = found + np.histogram(half, edges, weights=echoes.energy.numpy().astype(float))[0] / keys
    expected = by_bed(np.array([0, 0, -10.0]), where, 20.0, edges, mu=0.1, alpha=0.030)
    assert np.abs(10 * np.log10(found / expected)).max() < 0.1


@pytest.mark.parametrize("height", [0.5, 10.0])
def test_a_sidescan_hears_point_targets_by_way_of_the_bed(variant, height):
    where = np.array([30.0, 0.0, -40.0 + height])
    scene = sidescan({"bed": bed(40.0, lambert(-10.0)),
                      "ball": {"type": "point_target", "position": list(where), "target_strength_db": -5.0}},
                     sensor={"vertical_beam_width_deg": 180.0, "beam_width_deg": 20.0, "pings": 6}, rays=100_000,
                     film={"bins": 100, "range": 80.0}, integrator={"max_depth": 2})
    image = mitsonar.render(scene)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    power = 10 ** (image["path_level"].sel(path_name="bb").values.astype(float) / 10)
    # a flat bed does not light itself, and on the other side there is nothing
    assert power[:, 0].max() < 1e-15
    first = int(36 / 0.8) if height < 5 else int(32 / 0.8)
    found = power[:, 1, first:first + 16].mean(0).reshape(2, 8).sum(1)
    waves = sonar.transmit.length / sonar.wavelength
    expected = by_bed(np.array([0, 0, -20.0]), where, 40.0, 0.8 * (first + np.array([0, 8, 16])), mu=0.1, alpha=0.030,
                      beam=lambda towards: np.sinc(waves * towards[..., 1]) ** 2, one_side=True)
    expected *= 10 ** ((sonar.source_level_db - 5) / 10) * sonar.resolution / 0.8
    assert np.abs(10 * np.log10(found / expected)).max() < 0.1


def nothing(*_, **__):
    return iter(())


def total_db(image, side, path):
    """Level of an echo from all bins of a ping."""
    share = image.attrs["pulse_length"] / (2 * image.attrs["bin_width"] / 1500.0)
    level = image["path_level"].sel(path_name=path).values[0, side].astype(float)
    return 10 * np.log10(np.sum(10 ** (level / 10)) / share)


def where_heard(image, side, path):
    return image["range"].values[image["path_level"].sel(path_name=path).values[0, side].argmax()]


def test_a_sidescan_hears_targets_by_way_of_the_mirror(variant, monkeypatch):
    """To port a point, to starboard a sphere."""
    monkeypatch.setattr("mitsonar.echoes.bounces.multipath.Bounces.follow", nothing)  # of rays: a silent bed
    centre, radius, sonar = np.array([36.0, 0.0, -12.0]), 0.4, np.array([0.0, 0.0, -20.0])
    strength_db = 20 * np.log10(radius / 2)
    scene = sidescan({"bed": buried_bed(200.0, size=800.0), "sea": MIRROR,
                      "point": point_target(centre * [-1, 1, 1], strength_db),
                      "ball": {"type": "sphere", "center": list(centre), "radius": radius, "bsdf": {"type": "rigid"}}},
                     sensor={"vertical_beam_width_deg": 180.0, "pings": 1, "frequency_khz": 50.0}, rays=400,
                     integrator={"max_depth": 3})
    image = mitsonar.render(scene)
    ends = [centre - sonar, centre * [1, 1, -1] - sonar]
    # a glint lies where the normal halves the angle between both ways
    towards = [end / np.linalg.norm(end) for end in (centre - sonar, centre - sonar * [1, 1, -1])]
    for path, (i, j), both_db in (("b", (0, 0), 0), ("bs", (0, 1), 20 * np.log10(2)), ("sbs", (1, 1), 0)):
        normal = -(towards[i] + towards[j]) / np.linalg.norm(towards[i] + towards[j])
        for side, tolerance in ((0, 0.02), (1, 0.5)):
            r, s = (np.linalg.norm(ends[k] + side * radius * (normal * [1, 1, -1 if k else 1])) for k in (i, j))
            assert where_heard(image, side, path) == pytest.approx((r + s) / 2, abs=image.attrs["bin_width"])
            expected = image.attrs["source_level_db"] + strength_db + both_db - 20 * np.log10(r * s) - 0.030 * (r + s)
            assert total_db(image, side, path) == pytest.approx(expected, abs=tolerance)


@pytest.mark.parametrize("roll", [0.0, 10.0])
def test_a_flat_surface_straight_above_is_heard_half_from_either_side(variant, roll):
    scene = sidescan({"bed": buried_bed(200.0, size=800.0), "sea": MIRROR}, rays=400,
                     sensor={"vertical_beam_width_deg": 180.0, "pings": 1, **({"roll_deg": roll} if roll else {})})
    image = mitsonar.render(scene)
    share = image.attrs["pulse_length"] / (2 * image.attrs["bin_width"] / 1500.0)
    power = 10 ** (image["mean_level"].values[0].astype(float) / 10)
    whole = image.attrs["source_level_db"] - 20 * np.log10(2 * 20) - 0.030 * 40
    found = 10 * np.log10(power.sum(-1) / share) - whole
    if roll:
        assert sorted(found) == pytest.approx([-20, 0], abs=8)          # the waves' zone ends a little beyond
    else:
        assert found == pytest.approx(20 * np.log10(0.5), abs=0.02)
    bin = int(power[1].argmax())
    assert image["range"].values[bin] == pytest.approx(20, abs=image.attrs["bin_width"])
    assert image.attrs["labels"][str(image["label"].values[0, 1, bin])] == "sea"


def test_elements_hear_a_sphere_by_way_of_the_mirror(variant, monkeypatch):
    """As a point of its strength where both ways halve their angle, and no element hears another level or sign."""
    monkeypatch.setattr("mitsonar.echoes.ensonification.Ensonification.random_echoes", nothing)
    centre, radius, sonar = np.array([0.0, 36.0, -12.0]), 0.4, np.array([0.0, 0.0, -20.0])
    ball = {"type": "sphere", "center": list(centre), "radius": radius, "bsdf": {"type": "rigid"}}
    line = {"receive": "line", "receive_elements": 3, "receive_pitch": 0.2, "start": list(sonar)}
    scene = array_sonar({"bed": buried_bed(200.0), "sea": MIRROR, "ball": ball}, sensor={**line, "frequency_khz": 50.0},
                        water={"absorption_db_per_km": 0.0}, film={"range": 60.0},
                        integrator={"max_depth": 3, "rays": 16, "cell": 20.0})
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    towards = [end / np.linalg.norm(end) for end in (centre - sonar, centre - sonar * [1, 1, -1])]
    elements = survey.receive.position @ survey.track.rotation()[0].T + sonar
    wave = 2 * np.pi * 50e3 / 1500
    for path, ways in (("bs", ((0, 1), (1, 0))), ("sbs", ((1, 1),))):
        got = PressureRecord(survey, paths=(path,)).at(0).responses()[0].astype(complex).sum(-1)
        wanted = 0
        for i, j in ways:
            normal = -(towards[i] + towards[j]) / np.linalg.norm(towards[i] + towards[j])
            glint = centre + radius * normal
            r = np.linalg.norm(glint - sonar * [1, 1, -1 if i else 1])
            s = np.linalg.norm(glint - elements * [1, 1, -1 if j else 1], axis=1)
            wanted = wanted + 0.5 * radius * (-1) ** (i + j) * np.exp(-1j * wave * (r + s)) / (r * s)
        assert np.abs(got - wanted).max() < 0.1 * np.abs(wanted).max()


def pressures(scene):
    """Complex sums of the echoes of scatterers, by path and by which of the ways out and back go by the mirror."""
    survey = scene.integrator().array_survey(scene, scene.sensors()[0])
    out, ensonification = {}, PressureRecord(survey).ensonification(0)
    for echoes in ensonification.scatterer_echoes(survey.track.position[0], np.eye(3), 10.0, 0):
        cycles = survey.frequency * (echoes.arrival + echoes.back.travel_time).numpy()
        z = (echoes.amplitude[0].numpy() + 1j * echoes.amplitude[1].numpy()) * np.exp(-2j * np.pi * cycles)
        kind = echoes.path, echoes.out.folded, echoes.back.folded
        out[kind] = out.get(kind, 0) + z.sum()
    return out


def test_a_corner_by_way_of_the_mirror_is_as_from_the_image(variant):
    """The sonar at its image, all 30 m deeper and without a surface; and one way out, the other back, either way round.

    Mirrored tubes are the same both ways where facets shine; beside it, within 3 % of the strongest echo.
    """
    import mitsuba as mi

    def corner(middle, start, **more):
        shapes, side = {"bed": buried_bed(200.0), **more}, np.sqrt(0.5) * np.array([[0, -1, 1], [0, -1, -1]])
        for i in range(2):
            matrix = np.eye(4)
            matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = 0.3 * side[i], [0.3, 0, 0], side[1 - i]
            matrix[:3, 3] = middle + 0.3 * side[i]
            shapes[f"plate{i}"] = {"type": "rectangle", "to_world": mi.ScalarTransform4f(matrix),
                                   "bsdf": {"type": "impedance", "density": 1500.0, "sound_speed": 1700.0}}
        return pressures(array_sonar(shapes, film={"range": 45.0}, integrator={"max_depth": 4, "cell": 20.0},
                                     sensor={"start": start, "frequency_khz": 20.0}))

    mirrored = corner(np.array([0, 30, -3]), [0, 0, -10.0], sea=MIRROR)
    image = corner(np.array([0, 30, -33]), [0, 0, -20.0])
    strongest = max(map(abs, mirrored.values()))
    for path in ("b", "bb"):
        straight = image[path, False, False]
        assert abs(mirrored[f"s{path}s", True, True] - straight) < 0.002 * abs(straight)
        assert abs(mirrored[f"{path}s", True, False] - mirrored[f"{path}s", False, True]) < 0.03 * strongest
        assert mirrored[f"{path}s", True, False] != 0
