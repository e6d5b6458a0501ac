"""Beam patterns of line and rectangular apertures against closed forms.

b = sin x / x, x = π (L/λ) sin ψ: -3 dB at x = 1.39155738, first side lobe -13.261459 dB at x = 4.493409; full width
0.88589294 λ/L for long lines; two-way -3 dB width 0.63783340 λ/L; ∫ b⁴ dψ → (2/3) λ/L.
"""
import numpy as np
import pytest
from scipy.integrate import quad

from mitsonar.sonar import Aperture, Sidescan, length_for_beam_width

WAVELENGTH = 0.015


def db(amplitude):
    return 20 * np.log10(np.abs(amplitude))


def test_half_power_and_first_side_lobe():
    line = Aperture(length=100 * WAVELENGTH)
    assert db(line.along(1.39155738 / (np.pi * 100), WAVELENGTH)) == pytest.approx(-3.0103, abs=1e-4)
    assert db(line.along(4.493409 / (np.pi * 100), WAVELENGTH)) == pytest.approx(-13.261459, abs=1e-5)


@pytest.mark.parametrize("width_deg", [0.2, 1.0, 10.0, 60.0, 120.0])
def test_length_for_a_beam_width_has_that_width(width_deg):
    width = np.radians(width_deg)
    line = Aperture(length=length_for_beam_width(width, WAVELENGTH))
    assert line.along(np.sin(width / 2), WAVELENGTH) ** 2 == pytest.approx(0.5, abs=1e-8)
    assert line.beam_widths(WAVELENGTH)[0] == pytest.approx(width, rel=1e-8)


def test_half_circle_of_beam_means_no_beam():
    assert length_for_beam_width(np.pi, WAVELENGTH) == 0.0
    assert Aperture(length=0.0).along(0.9, WAVELENGTH) == 1.0


def test_two_way_width_and_equivalent_beam():
    line = Aperture(length=200 * WAVELENGTH)
    sonar = sidescan(line)
    u = 0.63783340 / 2 / 200
    assert sonar.along_intensity(np.array(u)) == pytest.approx(0.5, abs=1e-5)
    found = quad(lambda u: float(sonar.along_intensity(np.array(u))), -1, 1, limit=2000, points=[0])[0]
    assert found == pytest.approx(2 / 3 / 200, rel=2e-4)


def sidescan(face):
    return Sidescan(frequency=100e3, source_level_db=220.0, pulse_length=1e-4, transmit=face, receive=face,
                    depression_angle=np.radians(20.0), sound_speed=1500.0)


def test_solid_angle_of_a_line_is_its_ring():
    """Omnidirectional across: ∫∫ b⁴ du dφ over the face's half space = π ∫ b⁴ du."""
    sonar = sidescan(Aperture(length=50 * WAVELENGTH))
    along = quad(lambda u: float(sonar.along_intensity(np.array(u))), -1, 1, limit=2000, points=[0])[0]
    assert sonar.solid_angle() == pytest.approx(np.pi * along, rel=1e-6)


def test_directivity_index_of_a_large_face_is_4_pi_area():
    """4πA/λ² for a rectangle many wavelengths wide, baffled (its beam in one half space): 0.05 dB at 100 x 10 λ."""
    sonar = sidescan(Aperture(length=100 * WAVELENGTH, height=10 * WAVELENGTH))
    assert sonar.directivity_index_db() == pytest.approx(10 * np.log10(4 * np.pi * 1000), abs=0.05)


@pytest.mark.parametrize("along_deg, across_deg, expected", [(1, 50, 28.41), (60, 50, 10.72), (180, 50, 6.67)])
def test_directivity_index_of_wide_beams(along_deg, across_deg, expected):
    """Against a plain two-dimensional quadrature of b² over the half space of the face, to the digits printed."""
    face = Aperture(**{name: length_for_beam_width(np.radians(width), WAVELENGTH)
                       for name, width in (("length", along_deg), ("height", across_deg))})
    assert sidescan(face).directivity_index_db() == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("side", [-1.0, np.nan, np.inf])
def test_sizes_that_are_none_are_refused(side):
    with pytest.raises(ValueError, match="aperture length is"):
        Aperture(length=side)
