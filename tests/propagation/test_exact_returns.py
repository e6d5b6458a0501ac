"""Return times by an eigenray for every pair, on the device, against the same in NumPy (`return_time`).

Both solve one equation by independent code; NumPy's is checked against brute force. Tolerance 1e-10 s: the series of
the device leave 4e-11 s.
"""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Float, Float64
from summer import SUMMER_TABLE

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.propagation import eigenray, return_time
from mitsonar.propagation.device_rays.layer_table import layer_table
from mitsonar.propagation.numpy_rays.exact_returns import exact_return
from mitsonar.propagation.returns.travel import steady
from mitsonar.water import SoundSpeedProfile

PROFILES = {
    "constant": ([0.0], [1500.0]), "gradient": ([0.0, 100.0], [1480.0, 1520.0]),
    "duct": ([0.0, 20.0, 40.0], [1600.0, 1500.0, 1600.0]),
    "summer": SUMMER_TABLE,
}


@pytest.mark.parametrize("velocity", [(0.0, 0.0, 0.0), (1.5, 4.0, -0.3)])
@pytest.mark.parametrize("name", ["constant", "gradient", "summer"])
def test_the_same_as_in_numpy(rng, name, velocity):
    profile, depth = SoundSpeedProfile(*PROFILES[name]), 12.0
    hits = np.column_stack([rng.uniform(-60, 60, (2, 500)).T, rng.uniform(-45, -20, 500)])
    offset = np.array([0.4, -0.3, 0.5])
    origin = np.array([0.0, 0.0, -depth])
    wanted = return_time(profile, origin, hits, offset[None], velocity=velocity, method="eigenray")[:, 0]
    out = eigenray(profile, depth, -hits[:, 2], np.hypot(*hits.T[:2])).travel_time
    lib, table = arrays_of(Float), layer_table(profile, Float)

    def opaque(vector):
        return [dr.opaque(Float64, float(v)) for v in vector]

    elapsed = upload(Float64, out)
    found = exact_return(table, lib, dr.opaque(Float64, depth),
                         lib.Array3f64(*(upload(Float64, column) for column in (hits - origin).T)), elapsed,
                         opaque(offset), steady(opaque(velocity), opaque(np.zeros(3))), elapsed)[0].numpy()
    assert np.abs(found - wanted).max() < 1e-10


@pytest.mark.parametrize("name", ["summer", "duct"])
def test_no_ray_is_lost_and_none_is_late(rng, name):
    """Hits about the element's own depth, where rays turn and several arrive: the earliest, or none where none is."""
    profile, depth = SoundSpeedProfile(*PROFILES[name]), 16.0
    hits = np.column_stack([rng.uniform(-150, 150, (2, 3000)).T, rng.uniform(-39, -1, 3000)])
    offset, velocity, origin = np.array([0.4, -0.3, 0.5]), np.array([1.5, 4.0, -0.3]), np.array([0.0, 0.0, -depth])
    out = eigenray(profile, depth, -hits[:, 2], np.hypot(*hits.T[:2])).travel_time
    wanted = return_time(profile, origin, hits, offset[None], velocity=velocity, method="eigenray")[:, 0]
    elapsed, table = upload(Float64, out), layer_table(profile, Float)
    offset, velocity = ([dr.opaque(Float64, float(v)) for v in vector] for vector in (offset, velocity))
    found = exact_return(table, arrays_of(Float), dr.opaque(Float64, depth),
                         arrays_of(Float).Array3f64(*(upload(Float64, column) for column in (hits - origin).T)),
                         elapsed, offset, steady(velocity), elapsed)[0].numpy()
    assert (np.isnan(found) == np.isnan(wanted)).all()
    assert np.nanmax(np.abs(found - wanted)) < 1e-9


def test_a_turned_element_is_where_it_turned_to():
    """A quarter turn within the flight puts the element at its offset turned by that much."""
    profile, depth = SoundSpeedProfile.constant(1500.0), 12.0
    lib, table = arrays_of(Float), layer_table(profile, Float)

    def opaque(vector):
        return [dr.opaque(Float64, float(v)) for v in vector]

    hit = np.array([75.0, 0.0, 0.0])
    rate = np.pi / 2 / 0.1                                     # about the vertical, 0.1 s there and back
    time = exact_return(table, lib, dr.opaque(Float64, depth), lib.Array3f64(*opaque(hit)), dr.opaque(Float64, 0.05),
                        opaque([1.0, 0.0, 0.0]), steady(opaque(np.zeros(3)), opaque([0.0, 0.0, rate])),
                        dr.opaque(Float64, 0.05))[0].numpy()[0]
    angle = rate * (0.05 + time)
    assert time == pytest.approx(np.hypot(75 - np.cos(angle), np.sin(angle)) / 1500, abs=1e-12)
