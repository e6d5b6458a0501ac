"""The main lobe that a sidescan's speckle works with."""
import numpy as np
import pytest

from mitsonar.sonar.faces.directivity import Aperture, length_for_beam_width
from mitsonar.sonar.faces.sidescan import Sidescan
from mitsonar.survey.sidescan.side_beam import main_lobe


@pytest.mark.parametrize("wavelength, width_deg", [(0.015, 0.05), (1500.0, 0.4), (15.0, 0.1)])
def test_faces_of_many_metres_have_a_lobe_within_the_memory(wavelength, width_deg):
    face = Aperture(length=length_for_beam_width(np.deg2rad(width_deg), wavelength), height=1.0)
    sonar = Sidescan(frequency=1500 / wavelength, source_level_db=220.0, pulse_length=1e-4, transmit=face, receive=face,
                     depression_angle=0.3, sound_speed=1500.0)
    lobe = main_lobe(sonar, 50.0)
    assert np.isfinite(lobe.pressure).all() and (lobe.width > 0).all() and (lobe.edge <= 0.2).all()
