"""Frames on Earth: zones of UTM and UPS, true north, and records that name no good system."""
import numpy as np
import pytest

from mitsonar.device.earth import Frame, metric_system, origin, same_system


@pytest.mark.parametrize("latitude, longitude, crs", [
    (54.0, 9.7, "EPSG:32632"), (-54.0, 189.7, "EPSG:32702"), (86.0, 30.0, "EPSG:5041"), (-90.0, 10.0, "EPSG:5042")])
def test_a_zone_holds_its_first_position_and_points_to_true_north(latitude, longitude, crs):
    """A step of 1e-5 degrees of latitude has that bearing within 1e-6: the meridian curves by 1e-9, rounding 1e-9."""
    frame = Frame.in_zone(latitude, longitude)
    assert frame.crs == crs
    step = -1e-5 if latitude > 0 else 1e-5           # a pole has no north
    here, there = frame.places(np.array([latitude, latitude + step]), np.array([longitude, longitude]))
    assert np.abs(here).max() <= 0.5
    east, north = (there - here) * np.sign(step)
    assert -np.arctan2(east, north) == pytest.approx(float(frame.convergence(latitude, longitude)), abs=1e-6)


def test_what_is_no_place_on_earth_has_no_coordinates_and_no_zone():
    places = Frame(crs="EPSG:32632").places(np.array([54.0, 91.0, np.nan]), np.array([9.0, 9.0, 9.0]))
    assert np.isfinite(places[0]).all() and np.isnan(places[1:]).all()
    with pytest.raises(ValueError, match="nowhere on Earth"):
        Frame.in_zone(91.0, 0.0)


def test_systems_in_metres():
    assert same_system("EPSG:32632", metric_system("EPSG:32632").to_wkt())
    for crs, words in (("EPSG:4326", "not one in metres, but in degree"), ("EPSG:2263", "US survey foot"),
                       ("EPSG:0", "none that PROJ knows")):
        with pytest.raises(ValueError, match=words):
            metric_system(crs)


def test_origins_are_an_easting_and_a_northing():
    assert origin({}) == (0.0, 0.0) and origin({"local_origin": [5.0, 6.0, 7.0]}) == (5.0, 6.0)
    for value, words in (([1.0], "give easting"), ("here", "give easting"), ([1e9, 0.0], "farther than any place")):
        with pytest.raises(ValueError, match=f"the line's origin is .*{words}"):
            origin({"origin": value}, "origin", "the line")
