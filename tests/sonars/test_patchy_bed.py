"""K-distributed echoes: a flat bed whose strength varies by patches larger than a resolution cell.

Closed form: intensity is Gamma(ν, 1/ν) times an exponential, second moment 2 (1 + 1/ν), distribution function 1 -
2/Γ(ν) (ν I)^(ν/2) K_ν(2 √(ν I)). Patches are squares of 16 m, pings are 16 m apart and look at the middles of two
patches on either side, with cells of 0.075 m by at most 0.8 m and sidelobes that reach the next patch with 1 % of the
energy. Levels are relative to the same bed without patches; 18 rays a bin add 0.5 % to the second moment.
"""
import functools

import numpy as np
import pytest
from mean_intensity import render
from scipy.special import gamma, kv
from scipy.stats import kstest

from mitsonar.units import KNOT
from mitsonar.validation.scenes import bed, lambert, sidescan

SIZE, PINGS = 16.0, 1500


def survey(shape=None, pings=PINGS, rays=10_000, **sensor):
    patches = {} if shape is None else {"patchiness": shape, "patch_size": SIZE}
    # 16 m a ping, through the middles of patches, slowly: the beams turn to where the sonar is when echoes are back
    track = {"start": [0.0, -SIZE * (pings - 1) / 2, -20.0], "pings": pings, "ping_rate_hz": 0.05,
             "speed_knots": SIZE * 0.05 / KNOT}
    return sidescan({"seabed": bed(40.0, {**lambert(), **patches}, size=26_000.0)}, rays=rays,
                    sensor={**track, **sensor}, film={"range_min": 25.0, "range": 46.0, "bins": 280},
                    integrator={"first_pass": 0.0})


@functools.lru_cache
def mean_level():
    """Intensity of each bin without patches, (bin,): 18,000 rays of 200 pings in each, 1 %."""
    return render(survey(pings=200, rays=25_000))[1].mean(0)


def relative(dataset, name):
    """Intensities in the middles of patches over what they are without patches, (2, pings, patches)."""
    middles = [int(np.argmin(abs(dataset["range"].values - np.hypot(20.0, (k + 0.5) * SIZE)))) for k in (1, 2)]
    level = dataset[name].values[..., middles].astype(float)
    return 10 ** (level / 10) / mean_level()[middles]


@pytest.mark.parametrize("shape", [0.5, 2.0])
def test_intensity_is_k_distributed_and_its_mean_unchanged(shape):
    dataset, *_ = render(survey(shape, speckle=True))
    intensity = relative(dataset, "level").ravel()
    n = len(intensity)
    assert n == 4 * PINGS
    wanted = 2 * (1 + 1 / shape)
    assert intensity.mean() == pytest.approx(1.0, abs=4 * np.sqrt((wanted - 1) / n))
    error = 4 * (intensity**2).std() / np.sqrt(n)
    assert (intensity**2).mean() == pytest.approx(wanted, abs=error + 0.03 * wanted)

    def distribution(i):
        i = np.maximum(i, 1e-9)
        return 1 - 2 / gamma(shape) * (shape * i) ** (shape / 2) * kv(shape, 2 * np.sqrt(shape * i))

    assert kstest(intensity, distribution).pvalue > 0.01
    assert kstest(intensity, "expon").pvalue < 1e-6                        # and Rayleigh's is refused


def test_mean_levels_are_gamma_distributed():
    """Without speckle the patches themselves show: <g²> = 1 + 1/ν."""
    dataset, *_ = render(survey(1.0))
    g = relative(dataset, "mean_level").ravel()
    assert g.mean() == pytest.approx(1.0, abs=4 / np.sqrt(len(g)))
    assert (g**2).mean() == pytest.approx(2.0, abs=4 * (g**2).std() / np.sqrt(len(g)) + 0.06)
