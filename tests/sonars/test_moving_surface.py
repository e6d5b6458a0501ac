"""The sea surface with waves, from its mesh to what sonars hear.

Independent of the device: heights and velocities of `water.sea_waves`, summed in NumPy, whose statistics
`tests/water/test_sea_waves.py` holds to the spectrum. Sound at 1500 m/s without refraction, but where a profile is
named.

    mesh        vertices stand where sound meets them, to 1e-5 m; points of a facet lie on it
    mirror      a ghost by way of it is later by 2 η sin θ / c; the mean over the sea is exp(-2 (k h sin θ)²) for
                Gaussian η of a deviation h (Eckart 1953), without any free number
    Doppler     an echo from straight above is shifted by 2 f w / c, w the vertical velocity of the water; its deviation
                over the sea by 2 f σ_w / c, σ_w² = Σ a² ω²/2
    flat limit  waves of a millimetre, by the level of a surface without waves
"""
import numpy as np
import pytest
import sonar_scenes
from summer import SUMMER

import mitsonar
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, point_target, sidescan
from mitsonar.water import SoundSpeedProfile

SOUND = 1500.0
JONSWAP = {"type": "sea_surface", "waves": "jonswap", "wave_height": 0.8, "wave_period": 4.0, "wave_heading_deg": 30.0}


def sea_of(variant, height_of_the_wind=False, **attributes):
    """The sea of a shape, and the shape."""
    import mitsuba as mi

    from mitsonar.scene.sea import Sea, wavy_surface

    shape = wavy_surface(mi.load_dict({**({"type": "sea_surface"} if height_of_the_wind else JONSWAP), **attributes}))
    return Sea(shape, 1, mirrors=attributes.get("wind_speed") == 0), shape


def test_vertices_stand_where_sound_meets_them(variant):
    sea, shape = sea_of(variant)
    sonar, profile = np.array([3.0, -4.0, -6.0]), SoundSpeedProfile([0, 50], [1490, 1510])
    stand = sea.stand(9.0, sonar, profile)
    inner = (slice(shape.border + 16, -shape.border - 16),) * 2                   # beside, the waves end
    rest = shape.rest.reshape(*stand.vertices.shape)[inner]
    met = np.linalg.norm(rest - sonar, axis=-1) * np.mean(1 / profile.at(np.linspace(0, 6, 17)))
    some = slice(None, None, 16), slice(None, None, 16)
    moved, velocity = shape.waves.displaced(rest[some][..., :2], 9.0 + met[some])
    np.testing.assert_allclose(stand.vertices[inner][some] - rest[some], moved, atol=1e-5)
    np.testing.assert_allclose(stand.velocity[inner][some], velocity, atol=1e-5)
    assert not stand.moved[0].any() and not stand.moved[:, -1].any()              # the border


def test_points_of_the_level_surface_come_to_lie_on_facets(variant):
    sea, shape = sea_of(variant)
    stand = sea.stand(2.0, np.array([0, 0, -5.0]), SoundSpeedProfile([0, 50], [1500, 1500]))
    faces = np.asarray(mitsuba_faces(shape))
    rng = np.random.default_rng(2)
    chosen, weight = faces[rng.integers(len(faces), size=200)], rng.dirichlet([1, 1, 1], 200)
    moved = stand.vertices.reshape(-1, 3)
    wanted = np.einsum("nc,nci->ni", weight, moved[chosen])
    level = np.einsum("nc,nci->ni", weight, shape.rest[chosen])
    np.testing.assert_allclose(stand.placed(level), wanted, atol=1e-6)
    normal = np.cross(moved[chosen[:, 1]] - moved[chosen[:, 0]], moved[chosen[:, 2]] - moved[chosen[:, 0]])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    turned = stand.turned(np.tile([0, 0, 1.0], (200, 1)), level)
    growth = np.linalg.norm(turned, axis=1)
    np.testing.assert_allclose(turned / growth[:, None], normal, atol=1e-5)
    np.testing.assert_allclose(growth, area_of(moved[chosen]) / area_of(shape.rest[chosen]), rtol=5e-5)


def test_the_surface_stands_at_every_ping_by_the_same_kernel(variant):
    import drjit as dr

    sea, _ = sea_of(variant)
    hashes = []
    for number in range(3):
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            sea.stand(2.0 + number, np.array([0.3 * number, 0.1, -5.0 - number]),
                      SoundSpeedProfile.constant(1500.0 + number))
            hashes.append({entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])})
    assert hashes[0] and hashes[0] == hashes[1] == hashes[2]


def area_of(corners):
    return 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)


@pytest.mark.parametrize("attributes", [{}, {"wind_speed": 10.0, "waves": "pierson_moskowitz", "size": 60.0},
                                        {"wave_height": 0.9, "wave_period": 3.0, "size": 20.0}])
def test_facets_stretch_no_more_than_lists_of_scatterers_allow_for(variant, attributes):
    """Also beside the edge of the waves, where 2 m of water over squares of 0.2 m were a cliff, folded over."""
    sea, shape = sea_of(variant, attributes.get("waves") == "pierson_moskowitz", **attributes)
    stand, faces = sea.stand(3.0, np.array([0, 0, -5.0]), SoundSpeedProfile.constant(SOUND)), mitsuba_faces(shape)
    moved, level = stand.vertices.reshape(-1, 3)[faces], shape.rest[faces]
    radius = [np.linalg.norm(corner - corner.mean(1)[:, None], axis=-1).max(1) for corner in (moved, level)]
    assert np.max(radius[0] / radius[1]) < sea.stretch < 4
    normal = np.cross(moved[:, 1] - moved[:, 0], moved[:, 2] - moved[:, 0])
    assert normal[:, 2].min() > 0


def test_a_surface_wider_than_the_border_has_one_of_two_squares(variant):
    _, shape = sea_of(variant, size=6000.0, wave_height=5.0, wave_period=12.0)
    assert shape.border >= 2                         # velocities are asked for up to a square beyond the waves


@pytest.mark.parametrize("height, size", [(0.4, 60.0), (0.9, 40.0)])
def test_the_scatterers_of_a_ping_hold_the_area_of_the_waves(variant, height, size):
    """Every scatterer stands for the share of its facet; 3 and 9 % were lost where facets are longer than at rest."""
    import mitsuba as mi

    from mitsonar.echoes.scatterers.scatterers import Scatterers
    from mitsonar.echoes.scatterers.thinned_scatterers import Density, ThinnedScatterers
    from mitsonar.scene.geometry import Geometry

    geometry = Geometry(mi.load_dict({"type": "scene", "bed": buried_bed(60.0), "sea": {
        **JONSWAP, "wave_height": height, "wave_period": 3.0, "wind_speed": 5.0, "size": size}}))
    sonar, farthest = np.array([0, 0, -6.0]), 14.0
    stand = geometry.sea.stand(3.0, sonar, SoundSpeedProfile.constant(SOUND))
    geometry.stand([stand])
    scatterers = ThinnedScatterers(Scatterers(geometry, 1e3), farthest=farthest, places=sonar[None])
    density = Density(origin=sonar, axis=np.array([1.0, 0, 0]), per_cell=4.0, range_cell=0.05, sine_cell=0.02,
                      nearest=0.0, farthest=farthest)
    cells, exist = scatterers.at(*scatterers.candidates(density, lambda sight, distance, wider=0.0: mi.Bool(True)),
                                 density)
    point, corner = cells.point.numpy().T, stand.vertices.reshape(-1, 3)[mitsuba_faces(geometry.movers[0].part)]
    near = np.linalg.norm(point - sonar, axis=1) < farthest - 1
    own = np.linalg.norm(corner.mean(1) - sonar, axis=1) < farthest - 1
    assert np.sum(cells.area.numpy()[near & exist.numpy()]) / area_of(corner[own]).sum() == pytest.approx(1, abs=0.01)


def mitsuba_faces(shape):
    import mitsuba as mi

    return mi.traverse(shape)["faces"].numpy().reshape(-1, 3)


def test_the_material_has_the_slopes_that_the_mesh_leaves_out(variant):
    """Of a developed sea both together have the law's slope variance."""
    from mitsonar.scattering.laws.sea_surface import roughness

    longest = 4 * 150.0 / 256
    kept = roughness(8.0, longest).slope_variance
    _, developed = sea_of(variant, height_of_the_wind=True, waves="pierson_moskowitz", wind_speed=8.0, size=150.0)
    assert developed.bsdf().longest_wave == pytest.approx(longest)
    own = 0.5 * np.sum((developed.waves.amplitude * developed.waves.wavenumber) ** 2)
    assert kept + own == pytest.approx(roughness(8.0).slope_variance, rel=1e-3)


# ---- the mirror

def test_a_ghost_by_way_of_waves_is_later_by_the_height_of_the_mirror(variant):
    """Arrival of the target's ghosts at three pings, against a mirror at rest; the response's kernel is linear."""
    where, sonar = np.array([3.0, 24.0, -9.0]), np.array([0, 0, -10.0])
    mirror = {"type": "sea_surface", "wind_speed": 0.0}
    still = {"film": {"range": 30.0}, "integrator": {"max_depth": 2, "cell": 4.0, "rays": 16},
             "sensor": {"pings": 3, "ping_rate_hz": 0.7}}
    waves = {**JONSWAP, "wind_speed": 0.0, "wave_height": 0.02, "wave_period": 3.0}
    level, wavy = (mitsonar.impulse_response(array_sonar({"bed": buried_bed(60.0), "sea": sea,
                                                          "ball": point_target(where)}, **still), ping=[0, 1, 2])
                   for sea in (mirror, waves))
    _, shape = sea_of(variant, **waves)
    time = level["time"].values
    way = where - sonar
    folded = np.array([*way[:2], -where[2] - sonar[2]])
    arrival = (np.linalg.norm(way) + np.linalg.norm(folded)) / SOUND
    window = abs(time - arrival) < 1e-4
    share, sine = 10.0 / 19.0, 19.0 / np.linalg.norm(folded)
    for ping in range(3):
        sent = float(level["ping_time"][ping]) if "ping_time" in level.coords else ping / 0.7
        height = shape.waves.height(sonar[:2] + share * way[:2], sent + share * np.linalg.norm(folded) / SOUND)
        ratio = np.vdot(level.values[ping, 0, 0][window], wavy.values[ping, 0, 0][window])
        turned = np.angle(ratio * np.exp(2j * np.pi * 100e3 * 2 * height * sine / SOUND))
        assert abs(height) > 1e-4                    # or the test would say nothing
        assert abs(turned) / (2 * np.pi) < 2e-3


@pytest.mark.parametrize("water", [None, "summer"])
@pytest.mark.parametrize("kh", [0.5, 1.2])
def test_the_mean_pressure_of_ghosts_falls_as_eckarts(variant, water, kh):
    """20,000 sonars that share a range and a depth, over 4 km of sea: some 3,000 waves apart, 1 % of the mean."""
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of, upload
    from mitsonar.scene.geometry import Geometry
    from mitsonar.scene.tracing.connection import Connector
    from mitsonar.scene.tracing.water import DeviceWater

    frequency, height = 30e3, 4 * kh / (2 * np.pi * 30e3 / SOUND)
    profile, lib = SoundSpeedProfile.constant(SOUND) if water is None else SUMMER, arrays_of(mi.Float)
    times, rng = [], np.random.default_rng(7)
    start = np.column_stack([rng.uniform(-2000, 2000, (20000, 2)), np.full(20000, -12.0)])
    turn = rng.uniform(0, 2 * np.pi, 20000)
    end = start + np.column_stack([20 * np.sin(turn), 20 * np.cos(turn), np.full(20000, 4.0)])
    for waves in ({}, {**JONSWAP, "wave_height": height, "wave_period": 2.0, "size": 50.0}):
        geometry = Geometry(mi.load_dict({"type": "scene", "bed": buried_bed(60.0), "sea": {
            "type": "sea_surface", **waves, "wind_speed": 0.0}}))
        connector = Connector(geometry, DeviceWater(profile))
        first, last = (lib.Array3f64(*(upload(mi.Float64, column) for column in points.T)) for points in (start, end))
        nothing = mi.Vector3f(0, 0, 0)
        way = connector.join(first, nothing, last, nothing, folded=True, occlusion=False)
        times.append(way.travel_time.numpy())
    speed, waves = float(profile.at(0.0)), geometry.sea.waves
    sine = np.sqrt(1 - (way.ray_parameter.numpy() * speed) ** 2)
    mean = np.mean(np.exp(2j * np.pi * frequency * (times[1] - times[0])))
    deviation = waves.variance**0.5
    wanted = np.exp(-2 * (2 * np.pi * frequency / speed * deviation * np.mean(sine)) ** 2)
    assert abs(mean - wanted) < 0.03
    assert wanted < 0.95


# ---- the rough surface

def test_scatterers_ride_on_the_water(variant):
    """The first return of the surface, from within 2 m of straight above, at two pings 50 ms apart.

    Swell of 23 m and more moves them alike: their echoes turn by -4π f (η_2 - η_1) / c.
    """
    swell = {**JONSWAP, "wave_height": 1.5, "wave_period": 8.0, "wind_speed": 5.0, "size": 1500.0}
    response = mitsonar.impulse_response(array_sonar(
        {"bed": buried_bed(60.0), "sea": swell}, film={"range": 14.0}, integrator={"cell": 0.05},
        sensor={"frequency_khz": 12.0, "pings": 2, "ping_rate_hz": 20.0}, water={"absorption_db_per_km": 0.0}),
        ping=[0, 1])
    _, shape = sea_of(variant, **swell)
    met = np.array([0.0, 0.05]) + 10 / SOUND
    first, second = shape.waves.height(np.zeros((2, 2)), met)
    assert abs(second - first) > 2e-3
    time = response["time"].values
    window = time < 2 * (10 + first + 0.2) / SOUND
    product = np.vdot(response.values[0, 0, 0][window], response.values[1, 0, 0][window])
    turned = np.angle(product * np.exp(4j * np.pi * 12e3 * (second - first) / SOUND))
    assert abs(turned) / (2 * np.pi) < 0.02
    assert abs(product) > 0.8 * np.prod([np.linalg.norm(response.values[ping, 0, 0][window]) for ping in (0, 1)])


def test_the_doppler_of_the_surfaces_echoes_is_that_of_the_water(variant):
    """Seen from straight below: -2 w / c, with the deviation of the orbits' velocities over the sea."""
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of, upload
    from mitsonar.echoes.body_motion import BodyMotion
    from mitsonar.scene.geometry import Geometry

    geometry = Geometry(mi.load_dict({"type": "scene", "bed": buried_bed(60.0), "sea": {
        **JONSWAP, "wind_speed": 5.0, "wave_period": 7.0, "size": 800.0}}))
    sonar, profile = np.array([0, 0, -400.0]), SoundSpeedProfile.constant(SOUND)
    motion = BodyMotion.of(geometry)
    geometry.stand([geometry.sea.stand(5.0, sonar, profile)])
    rest = np.column_stack([np.random.default_rng(4).uniform(-350, 350, (5000, 2)), np.zeros(5000)])
    point = arrays_of(mi.Float).Array3f64(*(upload(mi.Float64, column) for column in geometry.stands[0].placed(rest).T))
    up, label = mi.Vector3f(0, 0, 1), mi.UInt32(geometry.surface_label)
    shift = motion.shift(label, point, up, up, mi.Float(SOUND)).numpy()
    met = np.linalg.norm(rest - sonar, axis=1) / SOUND
    w = geometry.sea.waves.displaced(rest[:, :2], 5.0 + met)[1][:, 2]
    assert np.corrcoef(shift, -2 * w / SOUND)[0, 1] > 0.99             # linear between nodes of 3 m
    waves = geometry.sea.waves
    deviation = np.sqrt(np.sum(waves.amplitude**2 * waves.rate**2) / 2)
    # between nodes velocities are linear, as places are: a few percent less of the shortest waves
    assert np.std(shift) == pytest.approx(2 * deviation / SOUND, rel=0.05)
    time = mi.Float64(np.full(5000, 0.3))
    assert not np.any(motion.later(label, mi.Float(shift), time).numpy())


@pytest.mark.parametrize("kind", ["sidescan", "array_sonar"])
def test_waves_of_a_millimetre_are_a_level_surface(variant, kind):
    """Their material is the same; levels of the surface's return then differ by the noise of rays and scatterers."""
    windy = {"type": "windy_sea", "wind_speed": 6.0}
    level = {"type": "sea_surface", "bsdf": windy, "size": 300.0}
    wavy = {**level, "waves": "jonswap", "wave_height": 1e-3, "wave_period": 4.0}
    powers = []
    for sea in (level, wavy):
        shapes = {"bed": buried_bed(200.0, size=600.0), "sea": sea}
        if kind == "sidescan":
            image = mitsonar.render(sidescan(shapes, depth=10.0, pings=4, sensor={"start": [0.0, 0.0, -10.0]}))
            powers.append(10 ** (image["level"].sel(range=slice(12, 80)).mean(["ping"]).values / 10))
        else:
            response = mitsonar.impulse_response(array_sonar(shapes, integrator={"cell": 0.1},
                                                             sensor={"frequency_khz": 50.0}))
            late = response["time"].values > 2 * 12 / SOUND
            powers.append(abs(response.values[0, 0, 0][late]) ** 2)
    ratio = 10 * np.log10(np.sum(powers[1]) / np.sum(powers[0]))
    assert abs(ratio) < (0.05 if kind == "sidescan" else 0.4)           # 400 cells of a range of 15 cm: 0.2 dB


@pytest.mark.parametrize("attributes, message", [
    ({"wave_height": 3.0}, "steeper than a sea can be"),
    ({"waves": "none"}, "wave_height is given without waves"),
    ({"waves": "pierson_moskowitz", "peak_enhancement": 2.0}, "only waves jonswap have it"),
    ({"size": 40000.0}, "no wave of the spectrum is longer than 625 m"),
])
def test_waves_that_cannot_be_are_refused(variant, attributes, message):
    with pytest.raises((ValueError, RuntimeError), match=message):
        sea_of(variant, **attributes)


@pytest.mark.parametrize("start, message", [
    ([0.0, 300.0, -5.0], "reach 99.9 m from the origin .* give sea_surface a size of 660 m or more"),
    ([0.0, 0.0, -0.05], "ping \\d+: the sonar is 0.* m above the sea surface"),
])
def test_a_sonar_out_of_the_waves_is_refused(variant, start, message):
    scene = array_sonar({"bed": buried_bed(60.0, size=900.0), "sea": {**JONSWAP, "wind_speed": 5.0}},
                        sensor={"start": start, "pings": 20, "ping_rate_hz": 1.0})
    with pytest.raises(ValueError, match=message):
        mitsonar.impulse_response(scene)


# ---- all kinds of sonar

SEA = {**JONSWAP, "wind_speed": 5.0, "wave_height": 0.3, "wave_period": 3.0, "size": 70.0}
FLOOR = {"bed": bed(14.0, size=60.0), "ball": point_target([4.0, 3.0, -9.0], 0.0)}
PINGS = {"pings": 2, "speed_knots": 2.0}
KINDS = {
    "sidescan": lambda sea: sonar_scenes.sidescan({**FLOOR, "sea": sea}, depth=6.0, rays=4000, sensor=PINGS,
                                                  film={"range": 25.0, "bins": 100}, integrator={"max_depth": 2}),
    "array_sonar": lambda sea: sonar_scenes.array_sonar({**FLOOR, "sea": sea}, depth=6.0, film={"range": 12.0}, sensor={
        **PINGS, "receive": "line", "receive_elements": 8, "beams": 8}, integrator={"cell": 0.3}),
    "array_sonar by rays": lambda sea: sonar_scenes.array_sonar(
        {**FLOOR, "sea": sea}, depth=6.0, film={"range": 12.0}, integrator={"cell": 0.3, "max_depth": 2, "rays": 2000},
        sensor={**PINGS, "picture": "elements", "receive": "line", "receive_elements": 4, "beams": 4}),
    "forward_looking": lambda sea: sonar_scenes.forward_looking({**FLOOR, "sea": sea}, depth=6.0, film={"range": 11.0},
                                                                sensor={**PINGS, "beams": 16}),
    "multibeam": lambda sea: sonar_scenes.multibeam({**FLOOR, "sea": sea}, depth=6.0, film={"range": 20.0},
                                                    sensor={**PINGS, "beams": 32}),
    "interferometric": lambda sea: sonar_scenes.interferometric({**FLOOR, "sea": sea}, depth=6.0, sensor=PINGS,
                                                                film={"range": 20.0, "bins": 200}),
    "echo_sounder": lambda sea: sonar_scenes.echo_sounder({**FLOOR, "sea": sea}, depth=6.0, sensor=PINGS,
                                                          film={"range": 20.0}, integrator={"max_depth": 3}),
    "sector_scan": lambda sea: sonar_scenes.sector_scan({**FLOOR, "sea": sea}, depth=6.0, sensor={"pings": 2},
                                                        integrator={"rays": 4000, "cell": 0.2, "max_depth": 2}),
}


@pytest.fixture
def coarse(variant, monkeypatch):
    """A mesh of a sixteenth of the squares, 1.1 m where waves of the peak are 14 m long, and a tenth of the patches."""
    from mitsonar.echoes.scatterers import thinned_scatterers
    from mitsonar.plugins.shapes import sea_surface

    monkeypatch.setattr(thinned_scatterers, "MOST_PATCHES", 200_000)
    monkeypatch.setattr(sea_surface, "WAVY_SQUARES", 64)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_sonar_sees_waves(coarse, kind):
    first, other = (mitsonar.render(KINDS[kind]({**SEA, "wave_seed": seed}), seed=3)["level"].values for seed in (0, 1))
    assert np.isfinite(first).all()
    assert kind == "multibeam" or np.mean(first != other) > 0.02                 # which looks down alone


@pytest.mark.parametrize("kind", ["sidescan", "array_sonar"])
def test_a_scene_has_the_same_waves_again(coarse, kind):
    scene = KINDS[kind](SEA)
    first = mitsonar.render(scene, seed=3)["level"].values
    mitsonar.render(KINDS[kind]({**SEA, "wave_seed": 1}), seed=3)                # another sea in between
    np.testing.assert_array_equal(mitsonar.render(scene, seed=3)["level"].values, first)


@pytest.mark.parametrize("wind", [0.0, 5.0])
def test_steps_of_planned_poses_have_the_waves_of_their_times(coarse, wind):
    scene = KINDS["forward_looking"]({**SEA, "wind_speed": wind})
    frames = list(mitsonar.frames(scene, seed=3))
    with mitsonar.Sonar(scene, seed=3) as sonar:
        for frame in frames:
            position, attitude = ([float(frame[name].values[0]) for name in names]
                                  for names in (("x", "y", "z"), ("roll", "pitch", "heading")))
            # planned velocity: 2 knots to the north
            step = sonar.ping(position=position, attitude=attitude, time=float(frame["ping_time"].values[0]),
                              velocity=(0, 2 * 1852 / 3600, 0))
            np.testing.assert_array_equal(step["level"].values, frame["level"].values)


def test_focused_images_and_gradients_refuse_waves(variant):
    strip = sonar_scenes.synthetic_aperture({**FLOOR, "sea": SEA}, sensor={"pings": 4, "receivers": 4})
    with pytest.raises(ValueError, match="the sea surface has waves; leave them out"):
        mitsonar.render(strip)
    with pytest.raises(ValueError, match="the sea surface has waves; leave them out"):
        mitsonar.gradient(KINDS["sidescan"]({**SEA, "size": 60.0}), ["bed.bsdf.strength"], lambda level: level)
