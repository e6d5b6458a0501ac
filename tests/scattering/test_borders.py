"""Places within borders: triangular displacements, one for each square of 5 cm, the same whenever it is asked for."""
import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("variant")


def grid(count, step=0.05):
    import mitsuba as mi

    x, y = (axis.ravel() * step + 0.02 - 7.3 for axis in np.meshgrid(np.arange(count), np.arange(count)))
    return mi.Float(x), mi.Float(y)


def test_displacements_are_triangular_and_independent():
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of
    from mitsonar.scattering.surfaces.borders import displacement

    d = np.array([part.numpy() for part in displacement(arrays_of(mi.Float), *grid(300))])
    assert np.abs(d).max() <= 0.5
    assert np.allclose(d.mean(1), 0, atol=0.003) and np.allclose(d.var(1), 1 / 24, rtol=0.02)     # (w/2)² / 6
    quantiles = np.quantile(d[0], [0.125, 0.5, 0.875])
    np.testing.assert_allclose(quantiles, [-0.25, 0, 0.25], atol=0.005)
    assert abs(np.corrcoef(d)[0, 1]) < 0.01
    field = d[0].reshape(300, 300)
    assert max(abs(np.mean(field[1:] * field[:-1])), abs(np.mean(field[:, 1:] * field[:, :-1]))) < 0.01 / 24


def test_a_square_has_one_number():
    import mitsuba as mi

    from mitsonar.device.arrays import arrays_of
    from mitsonar.scattering.surfaces.borders import drawn

    x = mi.Float([0.101, 0.12, 0.149, 0.151, -0.001])
    first = drawn(arrays_of(mi.Float), x, mi.Float(0.01))[0].numpy()
    assert np.ptp(first[:3]) == 0 and len(set(first)) == 3
