"""Grids of sound speed in netCDF files: read by CF names, placed in a scene, and used as a field.

A grid that holds the water of a closed form has the form's changes, to the curvature of the form between nodes.
"""
import numpy as np
import pytest
import xarray as xr

from mitsonar.device.earth import Frame
from mitsonar.io.grids import speed_grid
from mitsonar.propagation import eigenray
from mitsonar.propagation.returns.frozen_ray import FrozenLeg, frozen_ray
from mitsonar.water import SoundSpeedProfile, sound_speed
from mitsonar.water.fields import Front

FRONT = Front(x=100.0, y=0.0, sine=0.8, cosine=0.6, change_of_speed=2.0, width=60.0)
PROFILE = SoundSpeedProfile([0.0, 10.0, 20.0, 40.0], [1510.0, 1509.0, 1500.0, 1499.0])
DEPTH, X, Y = np.arange(0, 41, 5.0), np.arange(-300, 301, 10.0), np.arange(-200, 201, 10.0)
TRACK = np.array([[0.0, 0.0], [0.0, 50.0]])
NAMES = {"x": "projection_x_coordinate", "y": "projection_y_coordinate", "depth": "depth", "time": "time",
         "latitude": "latitude", "longitude": "longitude"}


def at(depth):
    """The profile's speed and gradient."""
    return PROFILE.at(depth), PROFILE.gradient(depth)


def written(path, values, dims, **axes):
    """A netCDF file of variables with CF names over axes."""
    data = {f"v{k}": (dims, array, {"standard_name": name}) for k, (name, array) in enumerate(values.items())}
    coords = {name: (name, axis, {"standard_name": NAMES[name]}) for name, axis in axes.items()}
    xr.Dataset(data, coords=coords).to_netcdf(path, engine="h5netcdf")
    return path


def speeds(x, y, depth):
    """The front's sound speed (Z, Y, X)."""
    z, north, east = np.meshgrid(depth, y, x, indexing="ij")
    return PROFILE.at(z) + FRONT.change(east, north, z, at).value


@pytest.fixture
def front(tmp_path):
    """The front as a grid in the scene's metres."""
    return written(tmp_path / "front.nc", {"speed_of_sound_in_sea_water": speeds(X, Y, DEPTH)}, ("depth", "y", "x"),
                   depth=DEPTH, y=Y, x=X)


def test_a_grid_has_the_changes_of_its_form(front, rng):
    field = speed_grid.read(front).placed(None, TRACK, 0.0).at(0.0, 0.0)
    x, y, z = rng.uniform(-250, 250, 200), rng.uniform(-150, 150, 200), rng.uniform(1, 39, 200)
    found, wanted = field.change(x, y, z, at), FRONT.change(x, y, z, at)
    # of a cell of 10 m, 1/8 of its square times the curvature 2 x 0.77 / 30²; slopes by half a cell
    np.testing.assert_allclose(found.value, wanted.value, atol=0.025)
    np.testing.assert_allclose(found.east, wanted.east, atol=0.008)
    np.testing.assert_allclose(found.north, wanted.north, atol=0.008)
    beyond = field.change(np.array([1e4]), np.array([0.0]), np.array([90.0]), at)
    assert beyond.value[0] == pytest.approx(2.0, abs=1e-3) and beyond.east[0] == beyond.down[0] == 0


def test_a_grid_makes_the_times_of_its_form(front):
    field, one = speed_grid.read(front).placed(None, TRACK, 0.0), np.ones(1)
    ray = eigenray(PROFILE, 5.0, 30.0, np.array([200.0]))
    leg = FrozenLeg((0 * one, 0 * one, 5 * one), (0.8 * one, 0.6 * one), 200 * one, 30 * one, ray.arc_length,
                    ray.ray_parameter, np.sin(ray.launch_angle))
    found, wanted = (frozen_ray(leg, one, at) for one in (field, FRONT))
    assert abs(found.later[0] - wanted.later[0]) < 4e-3 * abs(wanted.later[0]) and abs(wanted.later[0]) > 50e-6
    np.testing.assert_allclose(np.ravel(found.slope), np.ravel(wanted.slope), atol=4e-9)


def test_the_device_has_the_numbers_of_the_host(variant, front, rng):
    import mitsuba as mi

    field = speed_grid.read(front).placed(None, TRACK, 0.0)
    places = rng.uniform([-400, -300, 0], [400, 300, 60], (300, 3)).T

    def level(depth):
        return 1500.0 + 0.1 * depth, 0.1 + 0 * depth

    host = field.change(*places, level)
    device = field.on_device(mi.Float64).change(*(mi.Float64(axis) for axis in places), level)
    for one, other in zip(host, device):
        np.testing.assert_allclose(other.numpy(), one, atol=1e-9)


def test_latitudes_and_longitudes_are_placed_by_the_frame(tmp_path):
    frame = Frame.in_zone(54.0, 8.0)
    latitude, longitude, _ = frame.on_globe(np.array([[-2500.0, -2500.0], [2500.0, 2500.0]]))
    longitude, latitude = np.linspace(*longitude, 101), np.linspace(*latitude, 101)
    east = frame.places(np.full(101, latitude[50]), longitude)[:, 0]
    path = written(tmp_path / "model.nc", {"speed_of_sound_in_sea_water": np.broadcast_to(
        1500 + 0.01 * east, (9, 101, 101))}, ("depth", "latitude", "longitude"), depth=DEPTH, latitude=latitude,
        longitude=longitude)
    grid = speed_grid.read(path)
    change = grid.placed(frame, TRACK, 0.0).change(np.array([-500.0, 0.0, 700.0]), np.zeros(3), np.full(3, 20.0),
                                                   lambda z: (1500 + 0 * z, 0 * z))
    np.testing.assert_allclose(change.value, [-5.0, 0.0, 7.0], atol=0.2)     # meridians converge
    with pytest.raises(ValueError, match="the scene has no place on Earth"):
        grid.placed(None, TRACK, 0.0)
    with pytest.raises(ValueError, match="spans latitude 53.* give a grid of this sea"):
        grid.placed(Frame.in_zone(20.0, 8.0), TRACK, 0.0)


def test_a_section_of_temperature_and_salinity_holes_and_times(tmp_path):
    """Sound speed by TEOS-10, a hole filled from beside, and half the way between two times."""
    shape = (2, len(DEPTH), len(X))
    temperature = np.broadcast_to(10.0 + 0.01 * X, shape) + np.array([0.0, 1.0])[:, None, None]
    salinity = np.full(shape, 35.0)
    salinity[:, :, -1] = np.nan
    path = written(tmp_path / "section.nc", {"sea_water_temperature": temperature, "sea_water_salinity": salinity},
                   ("time", "depth", "x"), depth=DEPTH, x=X,
                   time=np.array(["2020-01-01T00:00", "2020-01-01T01:00"], "datetime64[ns]"))
    grid = speed_grid.read(path)
    start = np.datetime64("2020-01-01T00:30", "s").astype(float)
    field = grid.placed(None, TRACK, start)
    assert field.moves and grid.profile.depth.tolist() == DEPTH.tolist()
    now = field.at(start, start)
    found = now.change(np.array([100.0, 300.0]), np.array([0.0, 5e5]), np.full(2, 20.0), lambda z: (0 * z, 0 * z)).value
    wanted = sound_speed(np.array([11.5, 13.4]), 35.0, 20.0)
    np.testing.assert_allclose(found, wanted, atol=0.02)         # the mean of two speeds, not of two temperatures
    with pytest.raises(ValueError, match="has 2 times, and the track has no dates"):
        grid.placed(None, TRACK, 0.0)


@pytest.mark.parametrize("name, values, message", [
    ("salinity_of_nothing", 1500.0, "no variable has the standard_name speed_of_sound_in_sea_water"),
    ("speed_of_sound_in_sea_water", 15.0, "it has a sound speed of 15 m/s; check its variable and units"),
    ("speed_of_sound_in_sea_water", np.nan, "it has a time without any sound speed")])
def test_what_is_no_sound_speed_is_refused(tmp_path, name, values, message):
    path = written(tmp_path / "bad.nc", {name: np.full((len(DEPTH), len(X)), values)}, ("depth", "x"), depth=DEPTH, x=X)
    with pytest.raises(ValueError, match=message):
        speed_grid.read(path)


def test_times_that_run_back_and_other_seas_are_refused(tmp_path, front):
    path = written(tmp_path / "back.nc", {"speed_of_sound_in_sea_water": np.full((2, len(DEPTH), len(X)), 1500.0)},
                   ("time", "depth", "x"), depth=DEPTH, x=X, time=[3600.0, 0.0])
    with pytest.raises(ValueError, match="its times run back"):
        speed_grid.read(path)
    with pytest.raises(ValueError, match="spans x = -300 to 300 m, and the track lies elsewhere"):
        speed_grid.read(front).placed(None, TRACK + 9000.0, 0.0)


def test_a_scene_reads_a_grid(variant, front):
    from tests.inputs.sonar_scenes import bed, sidescan

    scene = sidescan({"bed": bed(30.0, size=300.0)}, depth=5.0, rays=2000, film={"range": 60.0, "bins": 50},
                     sensor={"pings": 1}, water={"field": "grid", "field_file": str(front)})
    survey = scene.integrator().survey(scene, scene.sensors()[0])
    column = survey.waters.only
    assert column.field.change(np.array([200.0]), np.array([100.0]), np.array([10.0]), lambda z: (
        column.profile.at(z), column.profile.gradient(z))).value[0] > 0.5
    assert column.profile == speed_grid.read(front).profile
