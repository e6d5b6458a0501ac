"""What a face aside of the sonar's centre sees, referred to the centre: exact of points in water of one sound speed."""
import numpy as np
import pytest

from mitsonar.hydrography.detection.faces_aside import AsideFace

TILT = np.deg2rad(30.0)


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_point_is_seen_from_the_centre_where_it_is(side):
    mirror = np.array([1.0, side, 1.0])
    axis = mirror * [0.0, np.sin(TILT), -np.cos(TILT)]
    face = AsideFace(transmit_centre=mirror * [0.0, 0.3, 0.1], receive_centre=mirror * [0.0, 0.2, -0.2], axis=axis,
                     normal=mirror * [0.0, np.cos(TILT), np.sin(TILT)])
    depression, distance = np.deg2rad([2.0, 20.0, 50.0, 85.0]), np.array([4.0, 10.0, 30.0, 6.0])
    point = distance[:, None] * np.stack([0 * depression, side * np.cos(depression), np.sin(depression)], -1)
    out, back = (np.linalg.norm(point - centre, axis=1) for centre in (face.transmit_centre, face.receive_centre))
    seen = face.seen((point - face.receive_centre) @ axis / back, (out + back) / 1500.0, 1500.0)
    np.testing.assert_allclose(seen.travel_time, 2 * distance / 1500.0, rtol=1e-12)
    np.testing.assert_allclose(seen.depression, depression, atol=1e-12)
    np.testing.assert_allclose(np.sin(seen.angle), side * np.cos(depression), atol=1e-12)
    np.testing.assert_allclose(seen.transmit_angle, 0, atol=1e-12)
