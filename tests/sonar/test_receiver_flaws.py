"""Errors of receivers: the diffuse side lobes that they leave of a line, against the closed form.

Lines of 64 and 128 receivers half a wavelength apart with Taylor's window: <|W|²> = ((1 + σ²) e^{σ²} - 1) Σw²/(Σ|w|)²
beyond what the window itself leaves, which is below -30 dB and known. The mean over 40 seeds and 600 sines beyond the
main lobe, of which some 64 x 40 are independent: its deviation is 2 to 3 % of the floor, 0.5 dB is allowed.
"""
import numpy as np
import pytest

from mitsonar.sonar import beam_pattern, line_array, planar_array
from mitsonar.sonar.arrays.channels import diffuse_level


def towards(sine):
    return np.stack([np.zeros_like(sine), sine, np.sqrt(1 - sine ** 2)], -1)


@pytest.mark.parametrize(("elements", "rms", "floor_db"), [(64, 0.2, -28.21), (128, 0.1, -37.34), (128, 0.3, -27.54)])
def test_side_lobes_rise_to_the_closed_form(elements, rms, floor_db):
    line, sine = line_array(elements, 0.5).shaded("taylor 4 30"), np.linspace(0.1, 0.9, 600)
    even = np.mean(np.abs(beam_pattern(line, towards(sine), 1.0)) ** 2)
    power = np.mean([np.abs(beam_pattern(line.flawed(rms, seed), towards(sine), 1.0)) ** 2 for seed in range(40)])
    wanted = diffuse_level(line.weight, rms)
    assert 10 * np.log10(wanted) == pytest.approx(floor_db, abs=5e-3)
    assert 10 * np.log10((power - even) / wanted) == pytest.approx(0, abs=0.5)
    # twice the square over the number, less the window's loss of 0.6 to 0.7 dB, to first order
    assert wanted == pytest.approx(2 * rms ** 2 * np.square(line.weight).sum() / line.weight.sum() ** 2, rel=0.08)


def test_the_beam_is_right_on_its_axis_and_same_seeds_have_same_errors():
    line = line_array(32, 0.5).shaded("hann")
    assert beam_pattern(line.flawed(0.5, 3), [0, 0, 1], 1.0) == pytest.approx(1, abs=1e-12)
    assert np.array_equal(line.flawed(0.5).channel, line.flawed(0.5).channel)
    assert not np.array_equal(line.flawed(0.5, 1).channel, line.flawed(0.5, 2).channel)
    assert line.flawless and not line.flawed(0.1).flawless and line.flawed(0.0).flawless


def test_rows_of_a_column_share_their_receiver():
    channel = planar_array(5, 3, 0.5).flawed(0.2).channel.reshape(3, 5)
    assert np.array_equal(channel, np.tile(channel[0], (3, 1))) and len(set(channel[0])) == 5


@pytest.mark.parametrize("rms", [-0.1, 1.5, np.nan])
def test_other_errors_are_refused(rms):
    with pytest.raises(ValueError, match="give a number from 0 to 1"):
        line_array(4, 0.5).flawed(rms)
    with pytest.raises(ValueError, match="channel has shape"):
        line_array(4, 0.5).__class__(position=np.zeros((2, 3)), normal=[0, 0, 1], along=[1, 0, 0], channel=np.ones(3))
