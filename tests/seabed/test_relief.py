"""Reliefs against closed forms, and their statistics against the spectrum they were made from.

Deterministic shapes: heights, crests and slopes to rounding. Spectrum: windowed periodograms (Hann) of 40 surfaces,
every third mode so that neighbours do not share the window's main lobe; the ring means times twice the number of modes
are chi-squared, and must lie within the two-sided bound at 1e-4 shared by all rings. The Hann window's leakage under a
slope of K^-3.25 is below 1 % from the fourth mode up (known bias, inside the bound). Extent: overlapping grids agree to
3e-3 of the rms height, the tail of the filter beyond one outer scale. Dislocations: vortices of the demodulated phase,
counted, within 4 standard deviations of the Poisson number of pairs.
"""
import numpy as np
import pytest
from scipy import ndimage, stats

from mitsonar.scattering import Fractal, Plane, Relief, Ripples, RoughnessSpectrum, Sinusoid

X = np.arange(-60, 61) * 0.05
Y = np.arange(-40, 41) * 0.05
MEDIUM_SAND = RoughnessSpectrum.of_sediment("medium sand", outer_scale=4.0)
RELIEFS = [Plane(slope=0.1, heading=2.0), Sinusoid(wavelength=0.7, height=0.1, heading=0.4),
           Ripples(wavelength=0.6, height=0.05, heading=1.0, asymmetry=0.3, sharpness=0.7, wander=0.1,
                   defect_density=0.3, seed=5),
           Fractal(spectrum=MEDIUM_SAND, seed=3)]


@pytest.mark.parametrize("relief", RELIEFS, ids=lambda relief: type(relief).__name__)
class TestEveryRelief:
    def test_rows_are_y_and_columns_x(self, relief):
        heights = relief.on_grid(X, Y)
        assert heights.shape == (Y.size, X.size) and heights.dtype == np.float64
        assert np.isfinite(heights).all()

    def test_is_the_same_every_time(self, relief):
        assert np.array_equal(relief.on_grid(X, Y), relief.on_grid(X, Y))

    def test_does_not_depend_on_how_far_the_grid_reaches(self, relief):
        whole, part = relief.on_grid(X, Y), relief.on_grid(X[30:90], Y[10:50])
        assert np.abs(whole[10:50, 30:90] - part).max() < 3e-3 * whole.std()

    def test_refuses_uneven_grids(self, relief):
        if isinstance(relief, (Fractal, Ripples)):
            with pytest.raises(ValueError, match="increasing by a constant step"):
                relief.on_grid(np.array([0.0, 1.0, 3.0]), Y)

    def test_sums(self, relief):
        total = relief + Plane(slope=0.2) + Sinusoid(wavelength=1.0, height=0.1)
        assert isinstance(total, Relief) and len(total.parts) == 3
        by_hand = sum(part.on_grid(X, Y) for part in total.parts)
        assert np.allclose(total.on_grid(X, Y), by_hand, rtol=0, atol=1e-15)


def test_level_plane_is_flat():
    assert not Plane().on_grid(X, Y).any()


def test_plane_descends_along_its_heading():
    east = Plane(slope=np.arctan(0.1), heading=np.pi / 2).on_grid(X, Y)
    assert np.allclose(east, -0.1 * X, atol=1e-15)
    north = Plane(slope=np.arctan(0.1), heading=0.0).on_grid(X, Y)
    assert np.allclose(north, -0.1 * Y[:, None], atol=1e-15)


def test_sinusoid_has_its_height_wavelength_and_heading():
    wave = Sinusoid(wavelength=0.5, height=0.2, heading=np.pi / 2)
    assert np.allclose(wave.on_grid(X, Y), 0.1 * np.cos(2 * np.pi * X / 0.5), atol=1e-15)


def test_plain_ripples_are_a_sinusoid():
    shape = {"wavelength": 0.5, "height": 0.2, "heading": 0.7}
    assert np.allclose(Ripples(**shape).on_grid(X, Y), Sinusoid(**shape).on_grid(X, Y), atol=1e-13)


@pytest.mark.parametrize("asymmetry", [0.0, 0.4, 0.8])
@pytest.mark.parametrize("sharpness", [0.0, 0.5, 1.0])
def test_ripple_cross_section(asymmetry, sharpness):
    u = np.arange(4000) / 4000 - 0.5  # one wavelength, trough to trough apart from the asymmetry
    heights = Ripples(wavelength=1.0, height=0.2, heading=np.pi / 2, asymmetry=asymmetry,
                      sharpness=sharpness).on_grid(u, np.array([0.0, 1.0]))[0]
    assert np.ptp(heights) == pytest.approx(0.2, rel=2e-3)
    assert heights.mean() == pytest.approx(0, abs=1e-4)
    assert u[heights.argmax()] == pytest.approx(0, abs=1e-3)          # crest at the origin
    # The lee, along the heading, is the short side. At asymmetry 0 both troughs of the period are the same place.
    assert (u[heights.argmin()] + 0.01) % 1 - 0.01 == pytest.approx((1 - asymmetry) / 2, abs=2e-3)


def test_sharp_crests_stand_between_flat_troughs():
    u = np.arange(-500, 500) / 1000
    skewness = [stats.skew(Ripples(wavelength=1.0, height=0.2, heading=np.pi / 2, sharpness=sharpness)
                           .on_grid(u, np.array([0.0, 1.0]))[0]) for sharpness in (0.0, 0.5, 1.0)]
    assert skewness[0] == pytest.approx(0, abs=1e-9) and skewness[0] < skewness[1] < skewness[2]


def test_crests_wander_as_much_as_asked():
    # Far apart (20 wander lengths) the displacements are independent; read off the phase at fixed points.
    ripples = [Ripples(wavelength=100.0, height=2.0, heading=np.pi / 2, wander=2.0, wander_length=5.0, seed=seed)
               for seed in range(400)]
    places = np.array([25.0, 125.0])
    sine = np.array([r.on_grid(places, np.array([0.0, 1.0]))[0] for r in ripples])  # -sin(2 pi wander / 100)
    wander = -np.arcsin(sine) * 100 / (2 * np.pi)
    assert wander.std() == pytest.approx(2.0, rel=0.15)  # 800 samples: 4 standard deviations are 10 %
    assert np.abs(wander.mean()) < 0.3


def test_as_many_dislocations_as_asked():
    wavelength, density, side = 1.0, 0.02, 120.0
    axis = np.arange(0, side, wavelength / 6)
    heights = Ripples(wavelength=wavelength, height=2.0, heading=np.pi / 2, defect_density=density,
                      seed=2).on_grid(axis, axis)
    carrier = heights * np.exp(-2j * np.pi * axis / wavelength)
    baseband = ndimage.gaussian_filter(carrier.real, 4) + 1j * ndimage.gaussian_filter(carrier.imag, 4)
    phase = np.angle(baseband)

    def wrapped(difference):
        return (difference + np.pi) % (2 * np.pi) - np.pi
    east, north = wrapped(np.diff(phase, axis=1)), wrapped(np.diff(phase, axis=0))
    turns = np.rint((east[:-1] + north[:, 1:] - east[1:] - north[:, :-1]) / (2 * np.pi))
    expected = density * side**2
    assert abs(np.abs(turns).sum() - expected) < 4 * np.sqrt(2 * expected)
    assert abs(turns.sum()) < 4 * np.sqrt(expected)  # as many forks one way as the other


@pytest.mark.parametrize("gamma", [2.6, 3.25])
def test_fractal_has_its_spectrum(gamma):
    spectrum = RoughnessSpectrum(w2=1e-4, gamma=gamma, outer_scale=3.0)
    nodes, d = 96, 0.1
    axis = (np.arange(nodes) + 700) * d
    window = np.hanning(nodes + 1)[:-1]
    window = np.outer(window, window) / np.sqrt((np.outer(window, window) ** 2).sum())
    surfaces = [Fractal(spectrum=spectrum, seed=seed).on_grid(axis, axis) for seed in range(40)]
    power = np.mean([np.abs(np.fft.fft2(surface * window)) ** 2 for surface in surfaces], axis=0)
    k = 2 * np.pi * np.fft.fftfreq(nodes, d)
    k_x, k_y = np.meshgrid(k, k)
    ratio = power * d * d / (2 * np.pi) ** 2 / spectrum.at(np.hypot(k_x, k_y))
    # Every third mode of the half plane: the other half are complex conjugates.
    modes = np.zeros((nodes, nodes), bool)
    modes[::3, 3:nodes // 2:3] = True
    radius = np.hypot(k_x, k_y) * nodes * d / (2 * np.pi)
    edges = [4, 8, 12, 16, 24, 32, 40, 48, 68]
    for low, high in zip(edges, edges[1:]):
        ring = modes & (radius >= low) & (radius < high)
        freedom = 2 * ring.sum() * len(surfaces)
        chance = 2 * min(stats.chi2.cdf(ratio[ring].mean() * freedom, freedom),
                         stats.chi2.sf(ratio[ring].mean() * freedom, freedom))
        assert chance > 1e-4 / (len(edges) - 1), (low, high, ratio[ring].mean())


def test_fractal_has_its_variance_and_slope():
    # The square of wavenumbers a grid holds lies between the discs of radius pi/d and sqrt(2) pi/d. 100 patches of 16
    # outer scales squared: the mean square is good to a few per cent (the large scales are few).
    d, axis = 0.1, np.arange(160) * 0.1
    spectrum = RoughnessSpectrum.of_height(0.05, gamma=3.0, outer_scale=4.0)
    surfaces = np.array([Fractal(spectrum=spectrum, seed=seed).on_grid(axis, axis) for seed in range(100)])
    variance = np.mean(surfaces**2)
    lowest, highest = spectrum.height_variance(np.pi / d), spectrum.height_variance(np.sqrt(2) * np.pi / d)
    assert 0.95 * lowest < variance < 1.05 * highest
    # Slopes of finite differences see K times sinc: compare with that sum over a fine lattice of the same modes.
    k_fine = (np.arange(-400, 400) + 0.5) * np.pi / d / 400
    seen = (2 / d * np.sin(k_fine * d / 2)) ** 2
    weight = spectrum.at(np.hypot(k_fine, k_fine[:, None])) * (k_fine[1] - k_fine[0]) ** 2
    slope = np.mean(np.diff(surfaces, axis=2) ** 2) / d**2
    assert slope == pytest.approx((weight * seen).sum(), rel=0.01)


def test_fractal_edges_do_not_repeat():
    # A surface periodic with its grid would make opposite edges neighbours.
    axis = np.arange(200) * 0.1
    spectrum = RoughnessSpectrum.of_sediment("sand", outer_scale=1.0)
    heights = Fractal(spectrum=spectrum).on_grid(axis, axis)
    across = np.mean((heights[:, 0] - heights[:, -1]) ** 2)
    assert across == pytest.approx(2 * spectrum.height_variance(), rel=0.35)  # about 20 independent places


def test_other_seeds_are_other_surfaces():
    surfaces = [Fractal(spectrum=MEDIUM_SAND, seed=seed).on_grid(X, Y).ravel() for seed in (0, 1)]
    assert abs(np.corrcoef(*surfaces)[0, 1]) < 0.6


@pytest.mark.parametrize("make, said", [
    (lambda: Plane(slope=2.0), "plane: slope is 2.0"),
    (lambda: Sinusoid(wavelength=0.0, height=1.0), "sinusoid: wavelength is 0.0"),
    (lambda: Ripples(wavelength=1.0, height=-1.0), "ripples: height is -1.0"),
    (lambda: Ripples(wavelength=1.0, height=1.0, asymmetry=1.0), "ripples: asymmetry is 1.0"),
    (lambda: Ripples(wavelength=1.0, height=1.0, sharpness=1.5), "ripples: sharpness is 1.5; it must be from 0 to 1"),
    (lambda: Ripples(wavelength=1.0, height=1.0, wander=3.0, wander_length=4.0), "wander_length is 4.0; it must be at"),
    (lambda: Ripples(wavelength=1.0, height=1.0, defect_density=2.0), "defect_density is 2.0"),
    (lambda: Fractal(spectrum=RoughnessSpectrum(w2=1e-4, outer_scale=1e5)).on_grid(X, Y), "use a coarser step"),
])
def test_refusals(make, said):
    with pytest.raises(ValueError, match=said):
        make()
