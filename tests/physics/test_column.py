"""Mean absorption between two depths from a cumulative table: exact for layered water on vertical paths."""
import numpy as np
import pytest

import drjit as dr
from mitsonar.propagation.device import arrays_of, upload
from mitsonar.signal.echoes import absorbed, mean_absorption_table
from mitsonar.water.column import AbsorptionColumn


@pytest.mark.parametrize("pair", [(0.0, 60.0), (3.0, 18.0), (18.0, 3.0), (20.0, 20.0), (20.0, 20.2), (55.0, 75.0)])
def test_vertical_paths(variant, pair):
    """Against numerical integration of the piecewise linear α; the table of 1024 steps over 80 m is good to 1e-5."""
    from drjit.auto import Float

    column = AbsorptionColumn([0.0, 10.0, 20.0, 60.0], [0.10, 0.10, 0.06, 0.05])
    table, steps = mean_absorption_table(column, 80.0, Float)
    z = np.linspace(*pair, 20001)
    mean = column.at(z).mean()
    length = 37.0
    depth = [upload(arrays_of(Float).Float, np.array([v], np.float32)) for v in pair]
    found = absorbed(table, steps, *depth, dr.opaque(Float, length)).numpy()[0]
    assert -10 * np.log10(found) == pytest.approx(2 * mean * length, abs=2e-3)


def test_values_that_are_no_absorption_are_refused():
    with pytest.raises(ValueError, match="not negative"):
        AbsorptionColumn([0.0], [-0.1])
    with pytest.raises(ValueError, match="depths increasing"):
        AbsorptionColumn([10.0, 0.0], [0.1, 0.1])
