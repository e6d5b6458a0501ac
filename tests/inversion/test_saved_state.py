"""A fit that was stopped goes on where it was, and ends as one that was not."""
import numpy as np
import pytest
from closed_models import Exponential

from mitsonar.inversion import LBFGS, Classes, Gamma, Gaussian, Prior, Stopping, TrustRegion, fit

METHODS = {"trust_region": TrustRegion(inner=3), "lbfgs": LBFGS(gradients=2)}
PRIORS = {"x": Prior(deviation=1.0)}
STOPPING = Stopping(iterations=5, noise=None, fall=0.0)


def _problem():
    rng = np.random.default_rng(0)
    matrix = 0.3 * rng.standard_normal((80, 12))
    return Exponential(matrix), Gamma(np.exp(matrix @ rng.standard_normal(12)) * rng.gamma(4, 0.25, 80), 4.0)


class _Stopped(Exception):
    pass


@pytest.mark.parametrize("method", METHODS)
def test_stopped_and_gone_on_is_the_same_to_the_bit(method, tmp_path):
    def stop(done, total):
        if done == 2:
            raise KeyboardInterrupt

    model, likelihood = _problem()
    whole = fit(model, likelihood, PRIORS, method=METHODS[method], stopping=STOPPING)
    with pytest.raises(KeyboardInterrupt):
        fit(model, likelihood, PRIORS, method=METHODS[method], stopping=STOPPING, progress=stop,
            state_file=tmp_path / "state.npz")
    again = fit(model, likelihood, PRIORS, method=METHODS[method], stopping=STOPPING,
                state_file=tmp_path / "state.npz")
    assert again.iterations == whole.iterations > 2
    np.testing.assert_array_equal(again.values["x"], whole.values["x"])
    np.testing.assert_array_equal(again.uncertainty["x"], whole.uncertainty["x"])
    np.testing.assert_array_equal(again.cost, whole.cost)


def test_a_done_fit_gives_its_answer_again_and_can_go_further(tmp_path):
    model, likelihood = _problem()
    first = fit(model, likelihood, PRIORS, stopping=Stopping(iterations=1, noise=None), state_file=tmp_path / "s.npz")
    same = fit(model, likelihood, PRIORS, stopping=Stopping(iterations=1, noise=None), state_file=tmp_path / "s.npz")
    further = fit(model, likelihood, PRIORS, stopping=Stopping(iterations=4, noise=None),
                  state_file=tmp_path / "s.npz")
    np.testing.assert_array_equal(first.values["x"], same.values["x"])
    assert further.iterations > first.iterations == same.iterations == 1


def test_a_state_of_another_fit_is_refused(tmp_path):
    model, likelihood = _problem()
    fit(model, likelihood, PRIORS, stopping=STOPPING, state_file=tmp_path / "s.npz")
    with pytest.raises(ValueError, match="the state of another fit"):
        fit(model, likelihood, {"x": Prior(deviation=2.0)}, state_file=tmp_path / "s.npz")
    with pytest.raises(ValueError, match="the state of another fit"):
        fit(model, Gaussian(np.ones(80), 1.0), PRIORS, state_file=tmp_path / "s.npz")


def test_a_state_of_other_classes_is_refused(tmp_path):
    model, likelihood = _problem()
    fit(model, likelihood, {"x": Prior(deviation=1.0, classes=Classes(values=(-1.0, 1.0), spread=0.2))},
        stopping=STOPPING, state_file=tmp_path / "s.npz")
    with pytest.raises(ValueError, match="the state of another fit"):
        fit(model, likelihood, {"x": Prior(deviation=1.0, classes=Classes(values=(-1.0, 2.0), spread=0.2))},
            state_file=tmp_path / "s.npz")


@pytest.mark.parametrize("damage", ["cut", "empty", "text", "huge", "version"])
def test_damaged_states_are_refused(damage, tmp_path):
    model, likelihood = _problem()
    path = tmp_path / "s.npz"
    fit(model, likelihood, PRIORS, stopping=STOPPING, state_file=path)
    whole = path.read_bytes()
    if damage == "huge":
        np.savez_compressed(path, z=np.zeros(5_000_000))
    elif damage == "version":                          # of the format, in the archive's list of files
        place = whole.index(b"PK\1\2") + 6
        path.write_bytes(whole[:place] + b"\xff" + whole[place + 1:])
    else:
        path.write_bytes({"cut": whole[:len(whole) // 2], "empty": b"", "text": b"nothing"}[damage])
    with pytest.raises(ValueError, match="no whole state of a fit"):
        fit(model, likelihood, PRIORS, state_file=path)
