"""Beams of faces that do not focus: Fresnel's integral of a line, and the far field's pattern."""
import numpy as np
import pytest
from scipy.special import fresnel

from mitsonar.sonar.faces import near_field
from mitsonar.sonar.faces.beam_shapes import half_power, line_shape, measured_shape
from mitsonar.sonar.faces.directivity import Aperture, length_for_beam_width
from mitsonar.sonar.faces.near_field import near_pressure

WAVELENGTH, WIDTH = 0.00375, np.deg2rad(0.4)
U = np.linspace(0, 0.03, 200)


@pytest.mark.parametrize("away", [0.5, 5.0, 60.0])
def test_an_even_face_has_fresnels_integral(away):
    """x²/2r - u x = (x - u r)²/2r - u² r/2: C and S of (x - u r) √(2/λr) at both ends."""
    face = Aperture(length=length_for_beam_width(WIDTH, WAVELENGTH))
    ends = (np.array([[-0.5], [0.5]]) * face.length - U * away) * np.sqrt(2 / (WAVELENGTH * away))
    sine, cosine = fresnel(ends)
    integral = np.diff(cosine + 1j * sine, axis=0)[0] * np.sqrt(WAVELENGTH * away / 2) / face.length
    expected = integral * np.exp(-1j * np.pi / WAVELENGTH * U ** 2 * away)
    assert np.abs(near_pressure(face, U, [away], WAVELENGTH)[0] - expected).max() < 2e-3      # midpoint rule


@pytest.mark.parametrize("window", ["boxcar", "hann", "cosine", "hamming", "taylor 4 35"])
def test_far_away_it_is_the_pattern(window):
    """Shading that ends abruptly is found from eight lobes to 2 % of the axis."""
    length = length_for_beam_width(WIDTH, WAVELENGTH, half_power(window))
    face = Aperture(length=length, along_shape=line_shape(length / WAVELENGTH, window=window))
    found = near_pressure(face, U, [1e6], WAVELENGTH)[0]
    assert np.abs(found - face.along(U, WAVELENGTH)).max() < 0.02


def test_a_measured_beam_comes_back():
    angle = np.deg2rad(np.linspace(-3, 3, 81))
    shape, width = measured_shape(angle, np.maximum(-12 * (angle / WIDTH) ** 2, -40))
    face = Aperture(length=length_for_beam_width(width, WAVELENGTH), along_shape=shape)
    assert np.abs(near_pressure(face, U, [1e6], WAVELENGTH)[0] - face.along(U, WAVELENGTH)).max() < 0.02


def test_a_point_hears_all_directions_alike():
    assert np.all(near_pressure(Aperture(length=0.0), U, [1.0, 50.0], WAVELENGTH) == 1)


def test_blocks_of_cosines_change_nothing(monkeypatch):
    face, ranges = Aperture(length=length_for_beam_width(np.radians(1.0), WAVELENGTH)), np.array([2.0, 40.0])
    whole = near_pressure(face, U, ranges, WAVELENGTH)
    monkeypatch.setattr(near_field, "BLOCK", 1)
    assert np.allclose(near_pressure(face, U, ranges, WAVELENGTH), whole, rtol=0, atol=1e-12)
