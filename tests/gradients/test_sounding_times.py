"""Times of soundings as a function of the water, the bed and the roll.

Closed form: over a level bed in uniform water t = 2 h / (c cos φ), φ from the vertical. Derivatives against
fourth-order differences, 1e-7 of the largest but for the few beams whose sounding crosses an edge between two cells
of the bed within a step, which have no derivative there.
"""
import numpy as np
import pytest

from mitsonar.gradients.soundings.sounding_bed import BedGrid
from mitsonar.gradients.soundings.sounding_times import BED, ROLL, SPEED, SoundingTimes
from mitsonar.hydrography.detection.sounding_beams import SoundingBeams
from mitsonar.water import SoundSpeedProfile

NODES = np.array([0.0, 5, 10, 20, 30, 45, 60, 90])
WATER = SoundSpeedProfile(NODES, 1490 - 15 / (1 + np.exp(-(NODES - 30) / 6)))
X, Y = np.linspace(0, 1000, 21), np.linspace(-300, 300, 9)
BED_SHAPE = BedGrid(x=X, y=Y, depth=20 + 0.04 * X + 3 * np.sin(X / 150) * np.cos(Y[:, None] / 100))


def beams(count=400, head=1490.0, steepest=60, seed=0):
    rng = np.random.default_rng(seed)
    angle, bearing = np.radians(rng.uniform(-steepest, steepest, count)), rng.uniform(0, 2 * np.pi, count)
    return SoundingBeams(
        x=rng.uniform(200, 800, count), y=rng.uniform(-200, 200, count), depth=rng.uniform(1, 2, count),
        east=np.sin(bearing), north=np.cos(bearing), slowness=np.abs(np.sin(angle)) / head,
        travel_time=np.ones(count), head_speed=np.full(count, head), starboard=np.sign(angle))


@pytest.fixture(scope="module")
def model():
    return SoundingTimes(beams(), WATER, BED_SHAPE, (SPEED, BED, ROLL))


def test_times_over_a_level_bed_in_uniform_water_are_those_of_straight_lines():
    some = beams()
    level = BedGrid(x=[0.0], y=[0.0], depth=[[40.0]])
    found = SoundingTimes(some, SoundSpeedProfile.constant(1500.0), level).value({})
    cosine = np.sqrt(1 - (some.slowness * 1500) ** 2)
    np.testing.assert_allclose(found, 2 * (40 - some.depth) / (1500 * cosine), rtol=1e-12)


def test_beams_meet_the_bed_where_their_rays_do(model):
    from mitsonar.propagation import eigenray

    x, y, depth = model.places({}).T
    shares = BED_SHAPE.shares(x, y)
    np.testing.assert_allclose((shares.share * BED_SHAPE.depth.ravel()[shares.node]).sum(1), depth, atol=1e-9)
    ray = eigenray(WATER, model.beams.depth, depth, np.hypot(x - model.beams.x, y - model.beams.y))
    np.testing.assert_allclose(2 * ray.travel_time, model.value({}), rtol=1e-12)


@pytest.mark.parametrize("name", [SPEED, BED, ROLL])
def test_forward_products_are_those_of_differences(model, name):
    direction = np.random.default_rng(1).standard_normal(model.start[name].shape) * (1e-3 if name == ROLL else 1)
    found = model.linearised({}).forward({name: direction})

    def moved(step):
        return model.value({name: model.start[name] + step * direction})

    h = 1e-3
    expected = (8 * (moved(h) - moved(-h)) - moved(2 * h) + moved(-2 * h)) / (12 * h)
    assert np.quantile(np.abs(found - expected), 0.98) < 1e-7 * np.abs(found).max()


def test_forward_and_backward_agree(model):
    rng = np.random.default_rng(2)
    tangents = {name: rng.standard_normal(value.shape) for name, value in model.start.items()}
    weights, line = rng.standard_normal(len(model.beams)), model.linearised({})
    back = line.backward(weights)
    assert sum((back[name] * tangents[name]).sum() for name in tangents) == pytest.approx(
        line.forward(tangents) @ weights, rel=1e-12)
    assert {name: value.shape for name, value in back.items()} == {name: v.shape for name, v in model.start.items()}


def test_a_roll_turns_a_beam_over_the_vertical():
    one = SoundingBeams(x=[0.0], y=[0.0], depth=[0.0], east=[1.0], north=[0.0], slowness=[np.sin(0.01) / 1500],
                        travel_time=[1.0], head_speed=[1500.0], starboard=[1.0])
    level = BedGrid(x=[0.0], y=[0.0], depth=[[40.0]])
    turned = SoundingTimes(one, SoundSpeedProfile.constant(1500.0), level, (ROLL,))
    np.testing.assert_allclose(turned.places({ROLL: np.array([-0.03])})[0], [-40 * np.tan(0.02), 0, 40], atol=1e-9)


def test_water_in_which_beams_turn_back_is_refused(model):
    fast = np.where(NODES > 8, 2500.0, 1490.0)
    with pytest.raises(ValueError, match="beams do not come down to the bed in this water"):
        model.value({SPEED: fast})


@pytest.mark.parametrize(("values", "message"), [
    ({"speed": np.zeros(8)}, "speed is no parameter; there are sound_speed, bed_depth, roll_offset"),
    ({SPEED: np.full(3, 1500.0)}, r"sound_speed has the shape \(3,\); give \(8,\)")])
def test_parameters_that_are_not_there_or_do_not_fit_are_refused(model, values, message):
    with pytest.raises(ValueError, match=message):
        model.value(values)


def test_weights_and_free_names_that_do_not_fit_are_refused(model):
    with pytest.raises(ValueError, match="give 400, one for each time"):
        model.linearised({}).backward(np.zeros(3))
    with pytest.raises(ValueError, match="salinity is no parameter; free may hold sound_speed, bed_depth"):
        SoundingTimes(beams(), WATER, BED_SHAPE, ("salinity",))


@pytest.mark.parametrize(("change", "message"), [
    ({"x": [0.0, 1.0]}, "x places|x must be a list of increasing|rows of"),
    ({"x": [1.0, 0.0], "depth": [[1.0, 2.0]]}, "x must be a list of increasing numbers"),
    ({"depth": [[np.nan]]}, "1 rows of 1 finite numbers")])
def test_beds_that_are_none_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        BedGrid(**{"x": [0.0], "y": [0.0], "depth": [[40.0]], **change})
