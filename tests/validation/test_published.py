"""Table 1 and the law of effective speed, against what is printed and against closed forms.

Table 1: printed speeds to their last digit (5e-7 m/s), times to theirs (5e-10 s), the difference 23.0995 ns to 0.002 ns
(1e-8 m of range make 0.0006 ns). The coefficient in water of one gradient g is 1/2 - g h / (6 c) + O((g h / c)²), the
last 1e-4 at 5 1/s and 9.5 m; a fit over one metre adds a curvature of second order, less. In other water it is
(c - ev) / (g h) at the array; curvature over the metre, and nodes in it, make 2e-3 of a half.
"""
import numpy as np
import pytest

from mitsonar.scenes.published import effective_speed, table_1


@pytest.fixture(scope="module")
def printed():
    return table_1.compute()


@pytest.fixture(scope="module")
def law():
    return effective_speed.compute()


def test_both_printed_columns_are_reproduced(printed):
    for method in ("traced", "equation 2"):
        one = printed.sel(found_by=method)
        assert float(one.effective_speed) == pytest.approx(float(one.printed_speed), abs=5e-7)
        assert float(one.return_time) == pytest.approx(float(one.printed_time), abs=5e-10)
    assert printed.displacement == pytest.approx(14.83763487, abs=5e-9)


def test_equation_2_is_23_ns_late_and_the_vector_approximation_is_not(printed):
    error = 1e9 * (printed.return_time - printed.return_time.sel(found_by="traced"))
    assert float(error.sel(found_by="equation 2")) == pytest.approx(23.0995, abs=2e-3)
    assert 1e9 / printed.frequency / float(error.sel(found_by="equation 2")) == pytest.approx(87, abs=0.5)
    assert abs(float(error.sel(found_by="vector approximation"))) < 0.01


def test_exaggerated_waters_average_to_the_published_coefficient(law):
    assert round(law.mean_coefficient, 3) == 0.503
    exaggerated = law.coefficient[law.kind == "exaggerated"]
    assert (exaggerated > 0.5).all() and (law.coefficient[law.kind == "reversed"] < 0.5).all()


def test_coefficients_follow_their_closed_forms(law):
    uniform = law.kind != "cast-like"
    assert np.abs(law.coefficient - law.expected)[uniform].max() < 1e-4
    assert np.abs(law.coefficient - law.expected).max() < 2e-3


def test_law_is_linear_and_right_in_one_gradient_only(law):
    uniform = law.kind != "cast-like"
    assert law.curvature[uniform].max() < 3e-4
    assert (law.law_error < 0.02 * law.no_correction_error)[uniform].all()
    layered = law.sel(water=["estuary, array at 2.5 m", "summer, array in the thermocline",
                             "-5 1/s in the upper metre alone"])
    assert (layered.coefficient < 0.2).all()
    assert (layered.law_error > 1.5 * layered.no_correction_error).all() and (layered.law_error > 1e-6).all()


@pytest.mark.parametrize("result, says", [
    (table_1, "23.0995       1/87"), (effective_speed, "0.5032; published: 0.503")])
def test_table_rows_and_picture(result, says, printed, law, tmp_path):
    from mitsonar.plots import canvas

    dataset = {table_1: printed, effective_speed: law}[result]
    assert says in result.table(dataset)
    header, records = result.rows(dataset)
    assert records and {len(record) for record in records} == {len(header)}
    canvas.save(result.plot(dataset), tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes().startswith(b"\x89PNG")
