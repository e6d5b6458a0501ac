"""Faces apart from each other: each looks towards where its own ray leaves or arrives.

A rectangular face of length L hears a target u = sin ψ off its normal by sinc(L u / λ). Faces 0.2 m long, 0.6 m fore
and aft of the centre, at 100 kHz: a target 24 m abeam of the centre lies 1.43 degrees off each, sinc(0.333) = 0.827,
and sqrt(24² + 0.6²) m away.

Displaced phase centres: what is sent at x = 0 and heard at x = b has the same ways, turned round, as what is sent at b
and heard at 0. A sonar that has gone on by b hears the same, whatever the bed: coherence 1 by reciprocity. Tolerance
0.995 for a bed of which each record has some 400 resolution cells.
"""
import numpy as np
import pytest
from summer import SUMMER_TEXT
from track_files import write_track

import mitsonar
from mitsonar.validation.scenes import array_sonar, bed, buried_bed, point_target

APART, AWAY, LENGTH, WAVELENGTH = 0.6, 24.0, 0.2, 0.015
FACE = {"pattern": "rectangular", "element_length": LENGTH, "element_height": 0.01, "normal": "starboard"}


def faces(tmp_path, places, *arrays):
    """Attributes of arrays of faces that look to starboard, at places along the body [m]."""
    np.savetxt(tmp_path / "faces.csv", [(place, 0, 0, 0, 1, 0, 1, 0, 0) for place in places], delimiter=",",
               header="x,y,z,nx,ny,nz,ax,ay,az", comments="")
    return {f"{array}_{name}": value for array in arrays for name, value in {
        "element_length": LENGTH, "element_height": 0.01, "pattern": "rectangular"}.items()} | dict.fromkeys(
        arrays, "file") | {f"{array}_file": str(tmp_path / "faces.csv") for array in arrays}


@pytest.mark.parametrize("return_path", ["vector", "eigenray"])
@pytest.mark.parametrize("array", ["transmit", "receive"])
def test_each_face_sees_the_target_from_where_it_is(variant, tmp_path, array, return_path):
    scene = array_sonar({"bed": buried_bed(30.0), "buoy": point_target([AWAY, 0, -10])}, integrator={"cell": 4.0},
                        water={"absorption_db_per_km": 0.0}, film={"sample_rate_khz": 30.0},
                        sensor=faces(tmp_path, [-APART, 0, APART], array))
    found = np.abs(mitsonar.impulse_response(scene, return_path=return_path).values.sum(-1)).ravel()
    away = np.hypot(AWAY, [-APART, 0, APART])
    wanted = np.sinc(LENGTH / WAVELENGTH * np.array([-APART, 0, APART]) / away) / (AWAY * away)
    assert wanted[0] / wanted[1] == pytest.approx(0.827, abs=0.001)
    assert found == pytest.approx(wanted, rel=0.003)


@pytest.mark.parametrize("return_path", ["vector", "eigenray"])
@pytest.mark.parametrize("profile", ["0:1500", SUMMER_TEXT])
def test_displaced_phase_centres_hear_the_same(variant, tmp_path, profile, return_path):
    # an hour from ping to ping: it lies still while echoes come in
    track = write_track(tmp_path / "track.csv", [[0, 0, 0, -10, 0, 0, 0], [3600, 0, APART, -10, 0, 0, 0]])
    transmit = {f"transmit_{name}": value for name, value in FACE.items()}
    scene = array_sonar({"bed": bed(20.0, size=80.0)}, integrator={"cell": 0.25}, water={"profile": profile},
                        film={"range": 28.0, "range_min": 20.0, "sample_rate_khz": 20.0},
                        sensor={"track": track, "ping_rate_hz": 1 / 3600, **transmit,
                                **faces(tmp_path, [-APART, APART], "receive")})
    response = mitsonar.impulse_response(scene, (0, 1), return_path=return_path).values[:, 0].astype(complex)
    fore, aft = response[0, 1], response[1, 0]
    coherence = abs(np.vdot(fore, aft)) / np.linalg.norm(fore) / np.linalg.norm(aft)
    assert coherence > 0.995
    assert abs(np.vdot(fore, response[1, 1])) / np.linalg.norm(fore) / np.linalg.norm(response[1, 1]) < 0.8
