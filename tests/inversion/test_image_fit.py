"""Unknowns from a speckled image, on models in closed form.

Of a linear model with many looks the answer is that of least squares with the prior, z = (AᵀWA + I)⁻¹ AᵀW r, and the
information is the spectrum of AᵀWA: to 1e-3 here, what is left of the deviance's third order with 1e8 looks.
"""
import numpy as np
import pytest
import xarray as xr

from mitsonar.inversion import Prior
from mitsonar.inversion.images.heights import grid_of
from mitsonar.inversion.images.image_fit import Stage, fit_image
from mitsonar.inversion.images.image_record import ImageRecord

SHAPE = (6, 2, 40)
MANY = 1e8


class Line:
    """A record that moves evenly with three numbers."""
    units = {"a": "1"}

    def __init__(self):
        draw = np.random.default_rng(3)
        self.matrix = draw.standard_normal((np.prod(SHAPE), 3)) * 1e-3
        self.start = {"a": np.zeros(3)}
        self.middle = 1 + 0.1 * np.cos(np.arange(np.prod(SHAPE)))

    def value(self, values):
        return self.middle + self.matrix @ values["a"]

    def linearised(self, values):
        class About:
            value = self.value(values)

            def forward(_, tangents):
                return self.matrix @ tangents["a"]

            def backward(_, cotangent):
                return {"a": self.matrix.T @ cotangent}

        return About()


def record(seen, looks=MANY, error=0.0):
    return ImageRecord(intensity=seen.reshape(SHAPE), first=4, last=39, floor=np.zeros(40), looks=looks,
                       model_error=error, first_return=np.full(6, 1.0), bin_width=0.1)


PRIORS = {"a": Prior(deviation=1.0)}


def test_answer_and_information_are_those_of_least_squares_with_the_prior():
    line, looks = Line(), 1e5
    seen = line.value({"a": np.array([0.3, -0.2, 0.5])}) * (1 + 1e-3 * np.random.default_rng(1).standard_normal(480))
    fit = fit_image(line, record(seen, looks), PRIORS, [Stage(bins=1, steps=6)], first=1, modes=3)
    counts = (np.arange(480) % 40 >= 4)
    weight = np.sqrt(looks) / line.middle * counts
    scaled = weight[:, None] * line.matrix
    expected = np.linalg.solve(scaled.T @ scaled + np.eye(3), scaled.T @ (weight * (seen - line.middle)))
    assert fit.values["a"] == pytest.approx(expected, abs=5e-3)
    information, vectors = fit.observability.singular_values ** 2, fit.observability.seen
    assert information == pytest.approx(np.linalg.eigvalsh(scaled.T @ scaled)[::-1], rel=5e-3)
    assert vectors @ vectors.T == pytest.approx(np.eye(3), abs=1e-9)


def test_the_first_stage_moves_the_first_unknowns_alone():
    line = Line()
    fit = fit_image(line, record(line.value({"a": np.ones(3)})), PRIORS,
                    [Stage(bins=2, steps=3, first_only=True)], first=1)
    z = fit.values["a"]
    assert z[0] != 0 and not z[1:].any()


def test_a_fit_of_stages_that_is_stopped_goes_on_to_the_same_answer(tmp_path):
    line, stages = Line(), [Stage(bins=4, steps=2, products=1, first_only=True), Stage(bins=2, steps=3, products=1)]
    seen = record(line.value({"a": np.array([0.3, -0.2, 0.5])}), 1e6)
    whole, steps = fit_image(line, seen, PRIORS, stages, first=1), []

    def stopped(done, total):
        steps.append((done, total))
        if len(steps) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fit_image(line, seen, PRIORS, stages, first=1, state_file=tmp_path / "state.npz", told=stopped)
    again = fit_image(line, seen, PRIORS, stages, first=1, state_file=tmp_path / "state.npz", told=stopped)
    assert np.array_equal(again.values["a"], whole.values["a"]) and np.array_equal(again.cost, whole.cost)
    assert steps[2][0] == 3 and steps[2][1] == 5 and again.iterations == whole.iterations
    with pytest.raises(ValueError, match="the state of another fit"):
        fit_image(line, seen, PRIORS, stages[1:], first=1, state_file=tmp_path / "state.npz")


def test_speckle_does_not_bias_a_level():
    """Of 432 bins of one look the mean's deviation is 1 / √432 = 4.8 %; the logarithm's would be off by 44 %."""
    class Level(Line):
        def __init__(self):
            super().__init__()
            self.matrix, self.start = np.ones((480, 1)), {"a": np.zeros(1)}
            self.middle = np.ones(480)

    level = Level()
    means = [fit_image(level, record(np.random.default_rng(seed).exponential(1.5, 480), 1.0), PRIORS,
                       [Stage(bins=4, steps=5)], first=1).values["a"][0] for seed in range(8)]
    assert np.mean(means) == pytest.approx(0.5, abs=4 * 1.5 * 0.048 / np.sqrt(8))


def test_vertices_that_stand_on_no_grid_are_refused():
    x, y = np.meshgrid(np.arange(4.0), np.arange(5.0))
    positions = np.stack([x.ravel(), y.ravel(), np.zeros(20)], 1)
    assert np.array_equal(positions[grid_of(positions)[2][2, 3], :2], [2, 3])
    positions[7, 0] += 0.3
    with pytest.raises(ValueError, match="stand on no regular grid"):
        grid_of(positions)


def image(sonar="sidescan", shape=(6, 2, 40)):
    return xr.Dataset({"level": (("ping", "side", "range"), np.full(shape, 100.0))},
                      {"range": 0.1 * (np.arange(shape[2]) + 0.5)}, {"sonar": sonar})


@pytest.mark.parametrize("given, message", [
    (image("multibeam"), "of a sonar of the kind multibeam, and the scene's is sidescan"),
    (image(shape=(5, 2, 40)), "5 x 2 x 40 pings, rows and bins, and the scene's sonar makes 6 x 2 x 40"),
    (image().where(image().level.ping > 0), "missing or not finite")])
def test_records_that_do_not_fit_are_refused_in_a_sentence(given, message):
    with pytest.raises(ValueError, match=message):
        ImageRecord.of(given, SHAPE, looks=1)


def test_looks_that_cannot_be_are_refused():
    with pytest.raises(ValueError, match="looks is 0; give the number of looks"):
        ImageRecord.of(image(), SHAPE, looks=0)
