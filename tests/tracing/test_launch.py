"""Drawing of directions: quantile tables give the density they were made of, and its exact reciprocal as weight.

Stratified draws from a table must integrate any function: mean of f(x) / density = ∫ f, here to the stratification
error; chi² over equal-probability cells is 0 for jittered strata, so the shares of cells are tested directly.
"""
from dataclasses import replace

import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float, UInt32
from scipy.integrate import trapezoid

from mitsonar.device.arrays import upload
from mitsonar.scene.tracing.launch import (
    CELLS,
    along_quantiles,
    draw,
    first_quantiles,
    one_way_quantiles,
    quantiles,
    refine_quantiles,
)
from mitsonar.sonar import Aperture, Sidescan


@pytest.fixture
def sonar():
    face = Aperture(length=0.66, height=0.016)
    return Sidescan(frequency=100e3, source_level_db=220.0, pulse_length=1e-4, transmit=face, receive=face,
                    depression_angle=np.radians(20.0), sound_speed=1500.0)


def drawn(table, count, rng):
    """Values and widths (1 / density) of one stratified sample per stratum."""
    xi = ((np.arange(count) + rng.random(count)) / count).astype(np.float32)
    row = dr.zeros(UInt32, count)
    value, width, cell = draw(upload(Float, table.astype(np.float32)), row, dr.minimum(upload(Float, xi), 0.9999999))
    return value.numpy().astype(float), width.numpy().astype(float), cell.numpy()


def test_quantiles_of_a_known_density():
    """Density x on [0, 2] in fine steps: quantile ξ lies at 2 sqrt(ξ), to the size of the steps."""
    edges = np.linspace(0, 2, 4001)
    table = quantiles(edges, (0.5 * (edges[1:] + edges[:-1]))[None], cells=16)
    np.testing.assert_allclose(table[0], 2 * np.sqrt(np.arange(17) / 16), atol=1e-3)


@pytest.mark.parametrize("f, integral", [(lambda u: np.ones_like(u), 2.0), (lambda u: u * u, 2 / 3)])
def test_weights_along_integrate_over_all_directions(variant, sonar, rng, f, integral):
    """Also functions that live where the beam does not: the wide share reaches there. 1e5 draws, 5 % of them wide."""
    u, width, _ = drawn(along_quantiles(sonar), 100_000, rng)
    assert np.mean(f(u) * width) == pytest.approx(integral, rel=2e-3)


def test_draw_along_follows_the_two_way_beam(variant, sonar, rng):
    """The weighted beam is nearly constant: most rays carry between 1.0 and 1.06 of the beam's integral (found: 92
    %)."""
    u, width, _ = drawn(along_quantiles(sonar), 50_000, rng)
    carried = sonar.along_intensity(u) * width
    assert carried.mean() == pytest.approx(sonar.solid_angle() / _across(sonar), rel=2e-3)
    assert np.mean((carried > carried.mean()) & (carried < 1.06 * carried.mean())) > 0.85


def test_draw_along_serves_all_shifts_between_transmission_and_reception(variant, sonar, rng):
    """A receiver that has turned by 0 to a beam width: the mean weighted beam is its integral, and no ray carries more
    than some times as much (drawn by the table for 0 alone, hundreds of times)."""
    beam = sonar.wavelength / sonar.transmit.length
    table, fine = along_quantiles(sonar, np.linspace(0, beam, 5)), np.linspace(-1, 1, 400_001)
    u, width, _ = drawn(table, 50_000, rng)
    for shift in (0.0, 0.3 * beam, beam):
        carried = sonar.along_intensity(u, u + shift) * width
        assert carried.mean() == pytest.approx(trapezoid(sonar.along_intensity(fine, fine + shift), fine), rel=1e-2)
        assert carried.max() < 15 * carried.mean()


@pytest.mark.parametrize("shorter", [1.0, 0.25])
def test_a_draw_for_one_way_gives_no_ray_much_of_either_beam(variant, sonar, rng, shorter):
    """Half of the draw follows each face: a ray carries 2 / 0.95 of a beam's integral at most, but for the widths of
    the cells (by the table for both ways, hundreds of times)."""
    face = Aperture(length=0.66 * shorter, height=0.016)
    sonar = replace(sonar, receive=face)
    u, width, _ = drawn(one_way_quantiles(sonar), 50_000, rng)
    fine = np.linspace(-1, 1, 400_001)
    for one in (sonar.transmit, sonar.receive):
        carried = one.along(u, sonar.wavelength) ** 2 * width
        assert carried.mean() == pytest.approx(trapezoid(one.along(fine, sonar.wavelength) ** 2, fine), rel=1e-2)
        assert carried.max() < 4 * carried.mean()


def _across(sonar):
    phi = np.linspace(-np.pi / 2, np.pi / 2, 20001)
    return trapezoid(sonar.across_intensity(np.sin(phi - sonar.depression_angle)), phi)


def test_first_pass_is_even_in_travel_time_on_a_flat_bed(variant, sonar, rng):
    """70 % of the rays fall evenly into the time bins between the first return and the end of the window."""
    phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
    window = (0.0, 2 * 100 / 1500)
    table = first_quantiles(sonar, phi[None], np.array([20.0]), 1500.0, window)
    value, _, _ = drawn(table[0], 40_000, rng)
    below = value[value > np.arcsin(0.2)]
    time = 2 * 20 / np.sin(below) / 1500
    share = np.histogram(time, bins=20, range=(2 * 20 / 1500, window[1]))[0] / len(value)
    assert share.min() > 0.70 / 20 * 0.9


def test_first_pass_shares_time_between_bed_and_surface(variant, sonar, rng):
    """Rays up and down in the ratio of the times that surface and bed are seen for, evenly in each: 15 % for the far
    end of the surface, where a cell of φ is most of a bin."""
    phi = np.linspace(-np.pi / 2, np.pi / 2, CELLS + 1)
    window = (0.0, 2 * 100 / 1500)
    table = first_quantiles(sonar, phi[None], np.array([40.0]), 1500.0, window, depth_above=np.array([10.0]))
    value, _, _ = drawn(table[0], 40_000, rng)
    for side, height in ((value, 40.0), (-value, 10.0)):
        seen = side[side > np.arcsin(height / 100)]
        time = 2 * height / np.sin(seen) / 1500
        share = np.histogram(time, bins=20, range=(2 * height / 1500, window[1]))[0] / len(value)
        assert share.min() > 0.70 * (100 - height) / (90 + 60) / 20 * 0.85


def test_second_pass_goes_where_the_need_is_and_nowhere_to_zero(variant, rng):
    """All need in one cell: it and its neighbours get three quarters of the rays; every other cell keeps some."""
    first = np.linspace(0, 1, CELLS + 1)[None]
    need = np.zeros((1, CELLS))
    need[0, 100] = 5.0
    value, width, _ = drawn(refine_quantiles(first, need)[0], 64_000, rng)
    near = (value > 99 / CELLS) & (value < 102 / CELLS)
    assert near.mean() == pytest.approx(0.75, abs=0.01)
    assert np.histogram(value, bins=64, range=(0, 1))[0].min() > 0.2 * 64_000 / 64
    assert width.mean() == pytest.approx(1.0, rel=5e-3)
