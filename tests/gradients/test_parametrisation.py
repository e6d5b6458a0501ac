"""Other numbers for parameters: against differences, forward against backward, and what cannot be."""
import numpy as np
import pytest

from mitsonar.gradients import Heights, InDecibels, Log, Offset, OnNodes, Pose, parametrised

VERTICES = np.random.default_rng(0).uniform(-2, 2, (15, 3)) + [10, 5, -20]


class _Squares:
    """y = A p + (A p)², of ``bed.vertex_positions`` and ``mu`` together."""

    shape = (4, 5)

    def __init__(self):
        self.start = {"bed.vertex_positions": VERTICES, "mu": np.array([0.5, 2.0])}
        self.units = {"bed.vertex_positions": "m", "mu": "1"}
        rng = np.random.default_rng(1)
        self.matrix = {name: 0.05 * rng.standard_normal((20, value.size)) for name, value in self.start.items()}

    def _sum(self, values):
        return sum(self.matrix[name] @ np.ravel(values.get(name, start)) for name, start in self.start.items())

    def value(self, values):
        total = self._sum(values)
        return total + total ** 2

    def linearised(self, values):
        return _Line(self, self._sum(values))


class _Line:
    def __init__(self, model, total):
        self.model, self.value, self.slope = model, total + total ** 2, 1 + 2 * total

    def forward(self, tangents):
        return self.slope * sum(self.model.matrix[name] @ np.ravel(value) for name, value in tangents.items())

    def backward(self, cotangent):
        return {name: (self.model.matrix[name].T @ (self.slope * cotangent)).reshape(start.shape)
                for name, start in self.model.start.items()}


BED = "bed.vertex_positions"
MODELS = {
    "heights": (Heights(BED),), "pose": (Pose(BED),), "in decibels": (InDecibels("mu"),), "log": (Log("mu"),),
    "offset": (Offset(BED),), "offset by column": (Offset(BED, by_column=True),),
    "nodes of heights": (Heights(BED), OnNodes(key="bed.heights", places=VERTICES[:, :2], spacing=1.5)),
    "splines of heights": (Heights(BED), OnNodes(key="bed.heights", places=VERTICES[:, :2], spacing=1.5, cubic=True)),
    "two": (Heights(BED), InDecibels("mu")),
}


@pytest.mark.parametrize("kind", MODELS)
def test_derivatives_are_those_of_differences_and_transposes(kind):
    # central differences at 1e-5 in float64: 1e-8
    rng = np.random.default_rng(2)
    model = parametrised(_Squares(), *MODELS[kind])
    at = {name: value + 0.3 * rng.standard_normal(value.shape) for name, value in model.start.items()}
    line = model.linearised(at)
    np.testing.assert_allclose(line.value, model.value(at))
    for name, value in model.start.items():
        direction, weights = rng.standard_normal(value.shape), rng.standard_normal(20)
        moved = line.forward({name: direction})
        ends = [model.value({**at, name: at[name] + sign * 1e-5 * direction}) for sign in (1, -1)]
        np.testing.assert_allclose(moved, (ends[0] - ends[1]) / 2e-5, rtol=1e-6, atol=1e-6)
        assert weights @ moved == pytest.approx(np.sum(line.backward(weights)[name] * direction), rel=1e-10)


@pytest.mark.parametrize("kind", MODELS)
def test_the_start_is_the_model_s_own(kind):
    model = parametrised(_Squares(), *MODELS[kind])
    np.testing.assert_allclose(model.value(model.start), _Squares().value({}), rtol=1e-12)
    np.testing.assert_allclose(model.value({}), _Squares().value({}), rtol=1e-12)
    assert model.shape == (4, 5)


def test_names_and_units_are_told():
    model = parametrised(_Squares(), Heights(BED), InDecibels("mu"))
    assert list(model.start) == ["bed.heights", "mu_in_db"]
    assert model.units == {"bed.heights": "m", "mu_in_db": "dB"}
    assert parametrised(_Squares(), Pose(BED)).units["bed.pose"] == "m, rad"
    np.testing.assert_allclose(model.start["mu_in_db"], [10 * np.log10(0.5), 10 * np.log10(2)])


def test_a_pose_turns_about_the_middle_of_the_object():
    # a quarter turn about z takes east to north
    seen = []

    class Looking(_Squares):
        def value(self, values):
            seen.append(values[BED])
            return super().value(values)

    parametrised(Looking(), Pose(BED)).value({"bed.pose": np.array([1, 2, 3, 0, 0, np.pi / 2])})
    centre = (VERTICES.min(0) + VERTICES.max(0)) / 2
    arms = VERTICES - centre
    wanted = centre + np.stack([-arms[:, 1], arms[:, 0], arms[:, 2]], 1) + [1, 2, 3]
    np.testing.assert_allclose(seen[-1], wanted, atol=1e-12)


def test_a_transform_has_a_pose_about_its_origin():
    # motion and turn of the transform are those of any point on its shape; derivatives to central differences' 1e-8
    rng = np.random.default_rng(5)
    start = np.vstack([rng.standard_normal((3, 4)), [0, 0, 0, 1]])
    bound, x, dx = Pose("ball.to_world").bound(start, "m"), rng.standard_normal(6), rng.standard_normal(6)
    assert bound.name == "ball.pose" and np.array_equal(bound.inner(np.zeros(6)), start)
    quarter = bound.inner(np.array([1, 2, 3, 0, 0, np.pi / 2]))
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(quarter[:3, :3], turn @ start[:3, :3], atol=1e-12)
    np.testing.assert_allclose(quarter[:3, 3], start[:3, 3] + [1, 2, 3], atol=1e-12)
    ends = [bound.inner(x + sign * 1e-5 * dx) for sign in (1, -1)]
    np.testing.assert_allclose(bound.push(x, dx), (ends[0] - ends[1]) / 2e-5, atol=1e-8)
    weights = rng.standard_normal((4, 4))
    assert bound.pull(x, weights) @ dx == pytest.approx(np.sum(weights[:3] * bound.push(x, dx)[:3]), rel=1e-10)


@pytest.mark.parametrize("cubic", [False, True])
def test_nodes_follow_a_plane_exactly(cubic):
    # B-splines of both degrees reproduce linear functions of their nodes' places, and weights sum to one
    from mitsonar.gradients.parameters.node_weights import node_weights

    weights, shape = node_weights(VERTICES[:, :2], 0.7, cubic)
    middle = (VERTICES[:, :2].max(0) + VERTICES[:, :2].min(0)) / 2
    x, y = np.meshgrid(*(middle[axis] + 0.7 * (np.arange(shape[axis]) - (shape[axis] - 1) / 2) for axis in (0, 1)),
                       indexing="ij")
    np.testing.assert_allclose(weights.sum(1), 1)
    np.testing.assert_allclose(weights @ (3 + 2 * x - y).ravel(), 3 + 2 * VERTICES[:, 0] - VERTICES[:, 1], atol=1e-9)


@pytest.mark.parametrize("make, words", [
    (lambda m: parametrised(m, Heights("bed.vertex_position")), "did you mean"),
    (lambda m: parametrised(m, Heights("mu")), "not the vertices"),
    (lambda m: parametrised(m, Pose("mu")), "not the vertices"),
    (lambda m: parametrised(m, InDecibels(BED)), "not above zero"),
    (lambda m: parametrised(m, Offset("mu", by_column=True)), "no columns"),
    (lambda m: parametrised(m, OnNodes(key="mu", places=np.zeros((3, 2)), spacing=1.0)), "one place for each"),
    (lambda m: parametrised(m, OnNodes(key="mu", places=np.zeros((2, 2)), spacing=0.0)), "above zero"),
    (lambda m: parametrised(m, OnNodes(key="mu", places=np.array([[0.0], [1e9]]), spacing=1.0)), "space them wider"),
    (lambda m: parametrised(m, Heights(BED)).value({"bed.heights": np.zeros(3)}), "give \\(15,\\)"),
    (lambda m: parametrised(m, Heights(BED)).value({BED: VERTICES}), "none of the model's parameters"),
    (lambda m: parametrised(m, Heights(BED)).linearised({}).forward({BED: VERTICES}), "by 'bed.heights' here"),
    (lambda m: parametrised(m, Heights(BED)).value({"bed.heights": np.full(15, np.nan)}), "not finite"),
])
def test_what_cannot_be_is_told(make, words):
    with pytest.raises(ValueError, match=words):
        make(_Squares())
