"""The blur of energies over beams and bins, against its two sums written out in float64.

Beams of 24 elements half a wavelength apart, at even sines. Side lobes below 3e-5 are left out of the blur, which is
scaled up for them, and its pattern is read from a table: 1 % of the largest energy.
"""
import numpy as np

from mitsonar.survey.beam_domain.blur import PARTS, REACH, Blur

SINES, PLACE, WEIGHT = np.linspace(-0.8, 0.8, 40), 0.5 * (np.arange(24) - 11.5), np.hanning(26)[1:-1]
BLUR, SHARE = Blur(SINES, PLACE, WEIGHT, 0.6), 0.6
ENERGY = np.random.default_rng(1).uniform(0, 1, (40, 30)).astype(np.float32)


def test_energies_spread_over_beams_and_bins():
    step = SINES[1] - SINES[0]
    inside = step * ((np.arange(PARTS) + 0.5) / PARTS - 0.5)
    gap = SINES[None, :, None] + inside - SINES[:, None, None]                             # (B, B', parts)
    mix = np.abs(np.exp(2j * np.pi * gap[..., None] * PLACE) @ (WEIGHT / WEIGHT.sum())) ** 2
    spread = np.sinc(SHARE * np.arange(-REACH, REACH + 1)) ** 2
    mixed = np.pad(mix.mean(-1) @ ENERGY, ((0, 0), (REACH, REACH)))
    expected = sum(weight * mixed[:, k:k + 30] for k, weight in enumerate(spread / spread.sum()))
    assert np.abs(BLUR.shown(ENERGY, 0) - expected).max() < 0.01 * expected.max()


def test_a_box_of_beams_is_blurred_as_a_part_of_the_fan():
    """Bit for bit: what lies outside of the box adds nothing."""
    only = np.zeros_like(ENERGY)
    only[7:21] = ENERGY[7:21]
    assert (BLUR.shown(only, 0)[7:21] == BLUR.shown(ENERGY[7:21], 7)).all()


def test_what_has_no_inverse_in_32_bits_is_nothing():
    """The truth divides by these energies: 1e-40 would give an infinite share."""
    faint = BLUR.shown(np.float32(1e-40) * (1 + ENERGY), 0)
    assert (faint == 0).all() and (BLUR.shown(np.float32(1e-36) * (1 + ENERGY), 0) > 0).any()
