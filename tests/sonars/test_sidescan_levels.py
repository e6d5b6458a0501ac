"""Echo levels of a sidescan against closed forms and brute-force integrals.

Flat Lambert bed, one sound speed, faces omnidirectional in elevation. With h the altitude, sin θ = h/R, the level of
a gate at slant range R is (Jackson & Richardson 2007; sonar equation)

    RL = SL - 40 log R - 2 α R + S_b(θ) + 10 log A,    A = Φ_ψ R (c τ / 2) / cos θ,   Φ_ψ = ∫ b_t² b_r² dψ

Here the integral over the gate and over azimuth is done numerically, so that no approximation is left: dA = R dR dφ,
the pattern taken at sin ψ = cos θ sin φ. Levels are compared as mean intensities over pings; the tolerances are the
Monte-Carlo errors, estimated from the pings themselves, and 0.02 dB where rays are plenty.
"""
import mitsuba as mi
import numpy as np
import pytest
from mean_intensity import render
from scipy.integrate import trapezoid

from mitsonar.survey.sidescan.kind import sonar_at
from mitsonar.validation.scenes import bed, lambert, sidescan

ALPHA = 0.030
OMNI = {"vertical_beam_width_deg": 180.0}


def flat_level(scene, dataset, altitude, bins, mu_db=-27.0):
    """Intensity [µPa²] of the bins by the sonar equation integrated over range and azimuth."""
    sonar = sonar_at(scene.sensors()[0], 20.0)
    azimuth = np.linspace(0, 1, 8001) ** 3 * np.pi / 2               # dense where the beam is
    width = dataset.attrs["bin_width"]
    found = []
    for centre in dataset["range"].values[bins]:
        r = centre + width * np.linspace(-0.5, 0.5, 9)
        cosine = np.sqrt(1 - (altitude / r) ** 2)
        pattern = sonar.along_intensity(cosine[:, None] * np.sin(azimuth))
        ring = 2 * trapezoid(pattern, azimuth, axis=1) * r
        gate = trapezoid(ring * 10 ** (mu_db / 10) * (altitude / r) ** 2 * r ** -4.0 * 10 ** (-0.2 * ALPHA * r), r)
        found.append(gate * min(1.0, sonar.resolution / width))      # bins longer than the pulse hold the mean level
    return 10 ** (sonar.source_level_db / 10) * np.array(found)


def db(ratio):
    return 10 * np.log10(ratio)


@pytest.mark.parametrize("face", [{}, {"sidelobe_db": -25.0}])
def test_flat_bed_closes_within_hundredths_of_a_decibel_per_bin(face):
    """With plenty of rays every bin is within 0.02 dB; standard errors are 0.004 dB, so this is five of them."""
    scene = sidescan({"seabed": bed(40.0)}, sensor={**OMNI, "pings": 10, **face}, rays=3_000_000)
    dataset, intensity, _ = render(scene)
    bins = np.arange(215, 1000, 20)
    expected = flat_level(scene, dataset, 20.0, bins)
    assert np.abs(db(intensity.mean(0)[bins] / expected)).max() < 0.02


@pytest.mark.parametrize("first_pass", [0.0, 0.15])
def test_few_rays_are_noisy_but_unbiased(first_pass):
    """Three rays a bin: the mean over 400 pings and 40 bins must agree within 3 standard errors, about 0.05 dB."""
    scene = sidescan({"seabed": bed(40.0)}, pings=400, rays=6000, sensor=OMNI, integrator={"first_pass": first_pass})
    dataset, intensity, error = render(scene)
    bins = np.arange(215, 1000, 20)
    expected = flat_level(scene, dataset, 20.0, bins)
    ratio = intensity.mean(0)[bins] / expected
    spread = np.sqrt((error[:, bins] ** 2).sum(0)) / 2 / expected
    z = (ratio - 1) / spread
    assert abs(ratio.mean() - 1) < 3 * np.sqrt((spread ** 2).sum()) / len(bins)
    assert 0.4 < np.mean(z ** 2) < 2.0                               # chi² / 40 degrees of freedom, 4 sigma either way


def test_level_follows_refraction_by_the_ray_tube_in_a_constant_gradient():
    """Gradient -1 1/s. Closed form of one linear layer: A = (c_r sinh(g t)/g)², t from cosh(g t) = 1 + g² d²/(2 c0 c1);
    grazing angle from p = X-derivative of t. Rings dA = 2π x dx, weighted as on the flat bed; 0.03 dB for the noise."""
    g, c0 = -1.0, 1500.0
    c1 = c0 + 20 * g
    water = {"profile": "0:1520, 60:1460"}
    scene = sidescan({"seabed": bed(40.0)}, sensor={**OMNI, "pings": 10, "sound_speed": 1500.0},
                     water=water, rays=3_000_000, film={"bins": 200})
    dataset, intensity, _ = render(scene)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    x = np.linspace(1e-3, 110, 400_001)
    d2 = x * x + 400
    t = np.arccosh(1 + g * g * d2 / (2 * c0 * c1)) / abs(g)
    p = np.gradient(t, x)
    sine1 = np.sqrt(1 - (p * c1) ** 2)
    returning = (c0 * np.sinh(g * t) / g) ** 2
    arc = np.sqrt(d2)                                                # bending lengthens the arc by under 1e-4
    outgoing = (c1 * np.sinh(g * t) / g) ** 2
    azimuth = np.linspace(0, 1, 4001) ** 3 * np.pi / 2
    some = np.linspace(0, len(x) - 1, 400).astype(int)
    rings = [2 * trapezoid(sonar.along_intensity(p[i] * c0 * np.sin(azimuth)), azimuth) for i in some]
    ring = np.interp(x, x[some], rings)
    per_x = ring * x * 10 ** -2.7 * sine1 ** 2 * 10 ** (-0.2 * ALPHA * arc) / (outgoing * returning)
    time = dataset["time"].values
    half = 0.5 * (time[1] - time[0])
    cumulative = np.concatenate([[0], np.cumsum(0.5 * (per_x[1:] + per_x[:-1]) * np.diff(x))])
    total = np.interp(time + half, 2 * t, cumulative) - np.interp(time - half, 2 * t, cumulative)
    expected = 10 ** (sonar.source_level_db / 10) * total * sonar.pulse_length / (2 * half)
    bins = np.arange(45, 190, 5)
    assert np.abs(db(intensity.mean(0)[bins] / expected[bins])).max() < 0.03


def patches(triangles, sonar, source, mu, window):
    """Brute force: the sonar equation summed over small triangles, no rays: (side, bin) intensity of a straight-ray
    sea."""
    a, b, c = (triangles[:, i] for i in range(3))
    normal = 0.5 * np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    to = (a + b + c) / 3 - source
    distance = np.linalg.norm(to, axis=1)
    sine = np.abs((normal * to).sum(1)) / (area * distance)
    u = to[:, 1] / distance                                          # body x is north at heading 0
    phi = np.arctan2(-to[:, 2], np.abs(to[:, 0]))
    v = np.sqrt(1 - u * u) * np.sin(phi - sonar.depression_angle)
    pattern = sonar.along_intensity(u) * sonar.across_intensity(v)
    power = pattern * mu * sine ** 2 * area * distance ** -4.0 * 10 ** (-0.2 * ALPHA * distance)
    bins = ((distance - window[0]) / (window[1] - window[0]) * window[2]).astype(int)
    sums = np.zeros((2, window[2]))
    inside = (bins >= 0) & (bins < window[2])
    np.add.at(sums, ((to[:, 0] > 0).astype(int)[inside], bins[inside]), power[inside])
    width = (window[1] - window[0]) / window[2]
    return 10 ** (sonar.source_level_db / 10) * sums * min(1.0, sonar.resolution / width)


def grid(x, y, z):
    """Triangles (T, 3, 3) of a surface given on a grid, z(x, y)."""
    x, y = np.meshgrid(x, y)
    p = np.stack([x, y, z(x, y)], -1)
    low, high = (p[:-1, :-1], p[:-1, 1:], p[1:, :-1]), (p[:-1, 1:], p[1:, 1:], p[1:, :-1])
    return np.concatenate([np.stack(part, 2).reshape(-1, 3, 3) for part in (low, high)])


def mesh(triangles):
    """A Mitsuba mesh of triangles."""
    shape = mi.Mesh("faces", 3 * len(triangles), len(triangles), props=_material())
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = triangles.astype(np.float32).ravel()
    parameters["faces"] = np.arange(3 * len(triangles), dtype=np.uint32)
    parameters.update()
    return shape


def _material():
    props = mi.Properties()
    props["bsdf"] = mi.load_dict(lambert())
    return props


SLOPE = np.deg2rad(12.0)
FACES = {
    # surface z(x, y) that the sonar at 20 m depth sees without shadow between the slant ranges given
    "tilted": (lambda x, y: -40 - np.tan(SLOPE) * x, (26.0, 60.0)),
    "rippled": (lambda x, y: -40 + 0.05 * np.sin(2 * np.pi * x / 1.5), (24.0, 56.0)),
}


@pytest.mark.parametrize("name", FACES)
def test_uneven_beds_match_a_brute_force_integral_within_a_tenth_of_a_decibel(name):
    """Straight rays, Lambert in the facet's frame. The triangles of the sum are 0.01 m across track, the bins 0.5 m:
    what a triangle adds to the wrong bin is below 0.02 dB; the rest of the 0.1 dB is Monte-Carlo noise (0.01 dB) and
    room."""
    surface, ranges = FACES[name]
    # along track the beam is 1 degree wide: fine patches in the main lobe, coarse ones out to the far sidelobes
    y = np.concatenate([np.arange(-25, -2, 0.25), np.arange(-2, 2, 0.05), np.arange(2, 25.1, 0.25)])
    traced = grid(np.arange(-90, 90, 0.02), np.array([-90.0, 90.0]), surface)
    scene = sidescan({"seabed": mesh(traced)}, sensor={"pings": 8}, rays=1_000_000, film={"bins": 200})
    dataset, intensity, _ = render(scene)
    sonar = sonar_at(scene.sensors()[0], 20.0)
    expected = sum(patches(grid(np.arange(x, x + 5.005, 0.01), y, surface), sonar, np.array([0, 0, -20.0]), 10 ** -2.7,
                           (0.0, 100.0, 200)) for x in np.arange(-65.0, 65.0, 5.0))
    R = dataset["range"].values
    inside = (R > ranges[0]) & (R < ranges[1])
    assert np.abs(db(intensity[:, inside] / expected[:, inside])).max() < 0.1


def test_vertical_face_matches_a_brute_force_integral_within_a_tenth_of_a_decibel():
    """A wall 20 m to starboard, 12 m high, 30 m long, alone in the water but for a patch below the sonar."""
    x, (y0, y1), (z0, z1) = 20.0, (-15.0, 15.0), (-34.0, -22.0)
    corner = np.array([[x, y0, z0], [x, y1, z0], [x, y1, z1], [x, y0, z1]])
    scene = sidescan({"wall": mesh(corner[[[0, 1, 2], [0, 2, 3]]]), "floor": bed(80.0, size=4.0)},
                     sensor={"pings": 8}, rays=1_000_000, film={"range": 40.0, "bins": 160})
    dataset, intensity, _ = render(scene)
    v, w = np.arange(y0, y1 + 1e-9, 0.02), np.linspace(z0, z1, 1201)
    fine = grid(v, w, lambda a, b: 0 * a)[..., [2, 0, 1]] + np.array([x, 0, 0])
    sonar = sonar_at(scene.sensors()[0], 20.0)
    expected = patches(fine, sonar, np.array([0, 0, -20.0]), 10 ** -2.7, (0.0, 40.0, 160))[1]
    R = dataset["range"].values
    inside = (R > np.hypot(20, 2) + 0.3) & (R < np.hypot(20, 14) - 0.3)
    assert inside.sum() > 12
    assert np.abs(db(intensity[1, inside] / expected[inside])).max() < 0.1


def test_absorption_of_hundreds_of_decibels_only_shifts_the_level():
    """The same rays with 100 dB/km and with none, to 1000 m: they differ by 2 α R, within the 0.01 dB by which a bin
    of 5 m is no point and the 0.02 dB of float32 arc lengths times α."""
    def level(absorption):
        scene = sidescan({"seabed": bed(40.0, size=4000.0)}, water={"absorption_db_per_km": absorption},
                         sensor={"preset": "towed_400khz", "pings": 2}, film={"range": 1000.0, "bins": 200},
                         rays=200_000)
        dataset, _, _ = render(scene, 5)
        return dataset["mean_level"].values.astype(float), dataset["range"].values

    (lossy, slant_range), (clear, _) = level(100.0), level(0.0)
    far = slant_range > 100
    shift = lossy[..., far] - clear[..., far] + 0.2 * slant_range[far]
    assert np.abs(shift).max() < 0.1
