"""Beams of faces in one plane: shaded, curved, measured, with diffuse side lobes.

Closed forms: side lobes of an even line -13.26 dB; a line shaded by a raised cosine (Hann) -31.47 dB, half power at
x = L s / λ = 0.7203 (Harris 1978, table 1: -3 dB in 1.44 bins); a line whose edges lag by a quadratic phase has
Fresnel's pattern.
"""
import numpy as np
import pytest
from scipy.special import fresnel

from mitsonar.sonar.faces import beam_shapes
from mitsonar.sonar.faces.beam_shapes import BeamShape, half_power, line_shape, measured_shape
from mitsonar.sonar.faces.directivity import Aperture, length_for_beam_width

SIZE = 60.0                        # [wavelengths]
SINES = np.linspace(-1, 1, 20001)


def db(pressure):
    return 20 * np.log10(np.maximum(np.abs(pressure), 1e-9))


def test_a_line_without_shading_is_a_sinc():
    assert np.allclose(line_shape(SIZE).pressure(SINES, SIZE), np.sinc(SIZE * SINES))
    assert half_power() == pytest.approx(0.44294647, abs=1e-5)


def test_shading_lowers_side_lobes_and_widens_the_beam():
    shape = line_shape(SIZE, window="hann")
    level = db(shape.pressure(SINES, SIZE))
    assert level[np.abs(SINES) > 2.01 / SIZE].max() == pytest.approx(-31.47, abs=0.1)
    assert half_power("hann") == pytest.approx(0.7203, rel=5e-3)         # the end segments are off
    assert shape.pressure(half_power("hann") / SIZE, SIZE) ** 2 == pytest.approx(0.5, abs=2e-3)


def test_the_edges_of_a_curved_face_lag_and_make_fresnels_pattern():
    """p = ∫ exp(i 2π (x ξ + 4 g ξ²)) dξ: Fresnel's integrals between a (2x/8g ± 1) of a = 2 √g."""
    sag, size = 0.7, 3.0
    x = size * SINES

    def end(sign):
        return 2 * np.sqrt(sag) * (sign + x / (4 * sag))

    sine, cosine = (np.subtract(*parts) for parts in zip(fresnel(end(1)), fresnel(end(-1)), strict=True))
    closed = np.abs(cosine + 1j * sine)
    found = line_shape(size, sag=sag).pressure(SINES, size)
    assert np.abs(found - closed / closed[len(x) // 2]).max() < 2e-3
    assert half_power(sag=sag) > 1.5 * half_power()


def test_diffuse_side_lobes_fill_the_nulls_at_their_level():
    shape = line_shape(SIZE, floor=10 ** -2.5)
    nulls = np.arange(1, 50) / SIZE
    assert db(shape.pressure(nulls, SIZE)) == pytest.approx(-25.0, abs=1e-6)
    assert shape.pressure(0.0, SIZE) == 1


def test_a_housing_shields_the_face_from_above():
    shape = line_shape(1.0, floor=0.04, shielded=True)
    sines = np.array([-1.0, -0.5, 1.0])
    expected = np.array([0.0, 0.02, 0.04]) + np.array([1.0, 0.98, 0.96]) * np.sinc(sines) ** 2
    assert shape.pressure(sines, 1.0) ** 2 == pytest.approx(expected, abs=1e-12)


def test_measured_levels_are_kept_and_give_their_width():
    angle = np.radians(np.arange(-90, 91.0))
    level = -3.0103 * (np.degrees(angle) / 20) ** 2
    shape, width = measured_shape(angle, np.maximum(level, -30))
    assert db(shape.pressure(np.sin(np.radians([0, 10.5, -33, 80])), 1.0)) == pytest.approx(
        [0, -3.0103 * 0.2758, -3.0103 * 2.7225, -30], abs=0.05)
    assert np.degrees(width) == pytest.approx(40, abs=1)


def test_the_envelope_is_never_below_the_beam():
    for shape in (line_shape(SIZE, floor=1e-4), line_shape(SIZE, window="taylor 4 35")):
        envelope = shape.envelope(SINES, SIZE)
        assert (envelope >= np.abs(shape.pressure(SINES, SIZE)) - 1e-6).all()
        assert (np.diff(envelope[SINES >= 0]) <= 1e-12).all()


@pytest.mark.parametrize("wrong", [{"floor": 1.0}, {"floor": -0.1}, {"table": np.array([1.0, np.nan])}])
def test_shapes_that_are_no_beam_are_refused(wrong):
    with pytest.raises(ValueError, match="give"):
        BeamShape(**wrong)


@pytest.mark.parametrize("angle", [[0.0], [0.2, 0.1], [0.0, 2.0]])
def test_angles_that_do_not_increase_within_the_half_space_are_refused(angle):
    with pytest.raises(ValueError, match="increase"):
        measured_shape(np.array(angle), np.zeros(len(angle)))


@pytest.mark.parametrize("window", ["hann", "taylor 4 30"])
def test_a_shaded_face_tells_its_width(window):
    width, wavelength = np.deg2rad(0.5), 0.005
    length = length_for_beam_width(width, wavelength, half_power(window))
    face = Aperture(length=length, along_shape=line_shape(length / wavelength, window=window))
    assert face.beam_widths(wavelength)[0] == pytest.approx(width, rel=5e-3)          # steps of the table


@pytest.mark.parametrize("sag, window", [(0.0, "taylor 4 30"), (1.3, "boxcar")])
def test_a_long_face_has_the_sum_over_its_segments(monkeypatch, sag, window):
    summed = line_shape(40.0, window=window, sag=sag).table
    monkeypatch.setattr(beam_shapes, "BLOCK", 1)
    assert np.abs(line_shape(40.0, window=window, sag=sag).table - summed).max() < 1e-9


def test_a_measured_beam_finer_than_tables_is_refused():
    with pytest.raises(ValueError, match="degrees wide at -3 dB; give one of 0.01 degrees or more"):
        measured_shape(np.radians([-1e-3, 0, 1e-3]), np.array([-40.0, 0.0, -40.0]))
