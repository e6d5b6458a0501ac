"""`check_gradients` calls right what is right, and each way of being wrong by its name."""
import numpy as np
import pytest
from fake_models import NUMBERS, Fake, FakeLinearised, of_key, shaken

from mitsonar.gradients.check.check import check_gradients


def verdicts(check, key):
    return {row.part: row.verdict for row in check.rows if row.key == key}


def test_right_derivatives_are_right_to_the_rounding_of_differences():
    check = check_gradients(Fake())
    assert [row.key for row in check.rows] == ["depth", "bed", "unheard", "gain", "gain"]
    assert all(row.verdict == "right" and row.error < 1e-5 and abs(row.slope - 1) < 1e-5 and row.asymmetry < 1e-12
               for row in check.rows if row.key != "unheard")
    assert not check.wrong


def test_a_parameter_that_the_record_does_not_depend_on_is_unseen():
    assert verdicts(check_gradients(Fake()), "unheard") == {"": "unseen"}


@pytest.mark.parametrize("key", ["depth", "bed", "gain"])
@pytest.mark.parametrize("factor, error", [(1.01, 0.01 / 1.01), (-1.0, 2.0), (0.5, 0.5)])
def test_a_wrong_factor_is_found_and_measured(key, factor, error):
    check = check_gradients(Fake(of_key(key, lambda jacobian: factor * jacobian)), tolerance=0.005)
    assert {row.key for row in check.wrong} == {key}
    for row in check.wrong:
        assert row.verdict == "off" and row.error == pytest.approx(error, rel=1e-3)
        assert row.slope == pytest.approx(1 / factor, rel=1e-4)


def test_a_gradient_of_zero_is_disconnected():
    check = check_gradients(Fake(of_key("bed", np.zeros_like)))
    assert verdicts(check, "bed") == {"": "disconnected"} and len(check.wrong) == 1
    assert "its gradient is zero" in check.wrong[0].notes[0]


def test_one_number_of_a_few_without_gradient_is_not_hidden_by_the_others():
    check = check_gradients(Fake(of_key("gain", lambda jacobian: jacobian * [1, 0])))
    assert verdicts(check, "gain") == {"[0]": "right", "[1]": "disconnected"}


def test_a_few_nodes_of_many_without_gradient_are_off():
    check = check_gradients(Fake(of_key("bed", lambda jacobian: jacobian * (np.arange(12) != 4))))
    assert verdicts(check, "bed") == {"": "off"}


def test_a_gradient_of_what_does_nothing_is_off():
    check = check_gradients(Fake(of_key("unheard", lambda jacobian: jacobian + 1)))
    assert verdicts(check, "unheard") == {"": "off"}


def test_backward_that_is_not_the_transpose_of_forward_is_off(monkeypatch):
    monkeypatch.setattr(FakeLinearised, "also", 1.0)
    check = check_gradients(Fake(), ["depth"])
    assert check.rows[0].verdict == "off" and "forward and backward derivatives differ" in check.rows[0].notes[0]


def test_a_derivative_that_is_wrong_in_the_far_and_faint_only_is_off():
    """The last third of the record is 30 times fainter than the first, and its derivative has a wrong sign."""
    far = np.where(np.arange(NUMBERS) < 40, 1.0, -1.0)[:, None]
    assert verdicts(check_gradients(Fake(of_key("depth", lambda jacobian: far * jacobian))), "depth") == {"": "off"}


def test_a_kink_at_the_start_is_off():
    """Differences of |x| about 0 are 0 at all steps, and whatever a gradient says is something else."""
    model = Fake(beside=lambda values: np.abs(values["depth"] - 0.3) * np.ones(NUMBERS))
    spoilt = of_key("depth", lambda jacobian: jacobian + 1)
    assert verdicts(check_gradients(Fake(spoilt, model._beside), ["depth"]), "depth") == {"": "off"}


def test_a_kink_beside_the_start_takes_smaller_steps():
    check = check_gradients(Fake(beside=lambda values: np.maximum(values["depth"] - 0.304, 0) * np.ones(NUMBERS)))
    row = check.rows[0]
    assert row.verdict == "right" and row.step <= 0.002 and row.error < 1e-4


def test_chance_that_is_drawn_anew_leaves_it_undecided():
    row = check_gradients(Fake(beside=shaken(0.05)), ["depth"]).rows[0]
    assert row.verdict == "undecided" and row.notes[0] == "differences do not converge: shadows or edges"


def test_rounding_of_single_precision_does_not_matter():
    check = check_gradients(Fake(beside=shaken(1e-8)), ["depth"])
    assert check.rows[0].verdict == "right" and check.rows[0].error < 1e-5
    check = check_gradients(Fake(beside=shaken(1e-8, "unheard")), ["unheard"])
    assert check.rows[0].verdict == "unseen"


def test_values_that_no_record_can_be_made_of_take_smaller_steps():
    def below(values):
        if values["depth"] < 0.29:
            raise ValueError("the bed is above the sonar")
        return 0.0

    row = check_gradients(Fake(beside=below), ["depth"]).rows[0]
    assert row.verdict == "right" and 2 * row.step <= 0.01


def test_empty_bins_have_no_weight_and_are_told():
    def beside(values):
        return np.where(np.arange(NUMBERS) % 7 == 3, np.nan, 0.0)

    check = check_gradients(Fake(beside=beside), ["depth", "bed"])
    assert all(row.verdict == "right" and "9 of 60 values of the record are not finite" in row.notes[0]
               for row in check.rows)


def test_gradients_that_are_not_finite_are_off():
    broken = np.where(np.arange(NUMBERS) == 5, np.nan, 1.0)[:, None]
    row = check_gradients(Fake(of_key("depth", lambda jacobian: jacobian * broken)), ["depth"]).rows[0]
    assert row.verdict == "off" and "not finite in 1 places" in row.notes[0]


def test_a_record_that_is_another_with_derivatives_is_off(monkeypatch):
    class Other(Fake):
        def linearised(self, values):
            found = super().linearised(values)
            found.value = 1.05 * found.value
            return found

    row = check_gradients(Other(), ["depth"]).rows[0]
    assert row.verdict == "off" and "differs from that without by 5.0e-02" in row.notes[0]


def test_a_parameter_that_is_lost_beside_others_is_found(monkeypatch):
    alone = FakeLinearised.forward

    def forward(self, tangents):
        return alone(self, {"bed": tangents["bed"]} if len(tangents) > 1 else tangents)

    monkeypatch.setattr(FakeLinearised, "forward", forward)
    check = check_gradients(Fake())
    assert [row.key for row in check.wrong] == ["all together"]


def test_a_linearisation_that_follows_the_model_elsewhere_is_found():
    class Shared(Fake):
        def value(self, values):
            self.last = values
            return super().value(values)

    class Stale(FakeLinearised):
        def forward(self, tangents):
            return super().forward(tangents) * (self.model.last is self.model.start)

    model = Shared()

    def linearised(values):
        found = Fake.linearised(model, values)
        model.last = model.start
        stale = Stale(found.value, found._jacobians, found._start)
        stale.model = model
        return stale

    model.linearised = linearised
    check = check_gradients(model, ["depth"])
    assert [row.verdict for row in check.rows] == ["right", "off"]
    assert "does not stay the same" in check.rows[1].notes[0]


def test_signals_that_swing_are_seen_by_a_weight_that_swings_as_they_do():
    """A delay of a tone: slow weights see nothing of it, and half of its derivative missing must be found."""
    class Tone:
        start, units, shape = {"delay": np.array(0.0)}, {"delay": "s"}, (2000,)

        def __init__(self, factor):
            self.factor, self.time = factor, np.arange(2000) * 1e-5

        def value(self, values):
            return np.cos(2 * np.pi * 7013.0 * (self.time - values.get("delay", 0.0)))

        def linearised(self, values):
            move = self.factor * 2 * np.pi * 7013.0 * np.sin(2 * np.pi * 7013.0 * self.time)
            return FakeLinearised(self.value(values), {"delay": move[:, None]}, self.start)

    right = check_gradients(Tone(1.0)).rows[0]
    assert right.verdict == "right" and right.error < 1e-4
    assert check_gradients(Tone(0.5)).rows[0].error == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("options, says", [
    ({"keys": ["bde"]}, r"no parameter 'bde' \(did you mean \"bed\"\?\); there are depth, bed, unheard, gain"),
    ({"directions": 0}, "directions is 0; give 1 or more"),
    ({"tolerance": 1.5}, "tolerance is 1.5; give a share"),
])
def test_refusals(options, says):
    with pytest.raises(ValueError, match=says):
        check_gradients(Fake(), **options)


def test_a_record_without_anything_in_it_is_refused():
    with pytest.raises(ValueError, match="the record is empty"):
        check_gradients(Fake(beside=lambda values: np.full(NUMBERS, np.nan)))


def test_the_same_seed_gives_the_same_figures_whichever_keys_are_asked_for():
    together, alone = check_gradients(Fake(), seed=3), check_gradients(Fake(), ["bed"], seed=3)
    assert alone.rows[0] == together.rows[1]
    assert check_gradients(Fake(), ["bed"], seed=4).rows[0] != alone.rows[0]


def test_the_table_is_text_and_dataset():
    check = check_gradients(Fake(of_key("bed", np.zeros_like)))
    text = check.text().splitlines()
    assert text[0].split() == ["parameter", "verdict", "error", "slope", "forward/backward", "two", "steps", "step"]
    assert text[1].startswith("depth") and " right " in text[1] and text[-1] == "bins in shadow: 25.0%"
    table = check.to_dataset()
    assert list(table["verdict"].values) == ["right", "disconnected", "unseen", "right", "right"]
    assert table["error"][0] < 1e-5 and np.isnan(table["error"][2]) and table.attrs["tolerance"] == 0.01


def test_derivatives_that_are_grainy_are_undecided_and_those_that_are_not_are_off():
    """Steep little waves on the record: differences over a step see their mean, derivatives where they are."""
    class Grainy(Fake):
        def __init__(self, factor):
            super().__init__(of_key("depth", lambda jacobian: factor * jacobian))

        def value(self, values):
            depth = {**self.start, **values}["depth"]
            return super().value(values) + 2e-8 * np.sin(1e6 * depth + np.arange(NUMBERS) // 20)

        def linearised(self, values):
            found, depth = super().linearised(values), {**self.start, **values}["depth"]
            grain = 0.02 * np.cos(1e6 * depth + np.arange(NUMBERS) // 20)
            found._jacobians["depth"] = found._jacobians["depth"] + grain[:, None]
            return found

    row = check_gradients(Grainy(1.0), ["depth"], tolerance=1e-3).rows[0]
    assert row.verdict == "undecided" and row.error > 1e-3 and "derivatives scatter within a step" in row.notes[-1]
    assert check_gradients(Grainy(0.5), ["depth"], tolerance=1e-3).rows[0].verdict == "off"


def test_edges_that_small_steps_do_not_cross_are_undecided():
    """A record that leaps every 4 cm, and whose derivative holds the leaps: steps of millimetres see none of them."""
    class Leaping(Fake):
        def value(self, values):
            depth = {**self.start, **values}["depth"]
            leaps = np.floor((depth - self.start["depth"]) / 0.04 + 0.5) * 0.04
            return super().value(values) + 0.3 * np.sum(leaps) * np.ones(NUMBERS)

        def linearised(self, values):
            found = super().linearised(values)
            found._jacobians["depth"] = found._jacobians["depth"] + 0.3
            return found

    row = check_gradients(Leaping(), ["depth"]).rows[0]
    assert row.verdict == "undecided" and "differences are others at larger steps" in row.notes[-1], row
