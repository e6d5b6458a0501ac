"""Rendered lines on a map: small targets on a flat bed lie at their coordinates, whatever the course and the pitch.

400 kHz, 10 m over the bed, 2 m/s, bins of 0.1 m, pings 0.2 m apart; pixels of 0.25 m. The record says where its bins
lie to the middle of a bin, so half a pixel is due.
"""
import numpy as np
import pytest
import rasterio
from track_files import write_track

import mitsonar
from mitsonar.io.records import geotiff
from mitsonar.validation.scenes import bed, point_target, sidescan

TARGETS = {"near": (16.1, 3.3), "far": (-24.6, -5.9)}
ORIGIN = [512200.0, 5790240.0]


@pytest.mark.parametrize("heading_deg, pitch_deg", [(37, 4), (215, -3)])
def test_targets_lie_at_their_coordinates_to_half_a_pixel(variant, tmp_path, heading_deg, pitch_deg):
    heading, way = np.deg2rad(heading_deg), np.arange(-22, 22, 0.2)
    rows = np.zeros((way.size, 7))
    rows[:, 0], rows[:, 1], rows[:, 2], rows[:, 3] = way / 2 + 11, way * np.sin(heading), way * np.cos(heading), -10
    rows[:, 5], rows[:, 6] = pitch_deg, heading_deg
    shapes = {name: point_target([*where, -19.99], 10.0) for name, where in TARGETS.items()}
    scene = sidescan({"bed": bed(20.0), **shapes}, rays=4000, film={"range": 45.0, "bins": 450},
                     sensor={"preset": "towed_400khz", "track": write_track(tmp_path / "line.csv", rows), "pings": 999})
    image = mitsonar.render(scene).assign_attrs(crs="EPSG:32631", local_origin=ORIGIN)
    for place in ("flat", "truth"):
        chart = mitsonar.imaging.mosaic(image, 0.25, quantity="mean_level", place=place, gain=None)
        geotiff.write(chart, tmp_path / "line.tif")
        check_places(tmp_path / "line.tif")


def check_places(path):
    """Find every target within half a pixel of where it is."""
    with rasterio.open(path) as raster:
        power = 10 ** (raster.read(1).astype(float) / 10)
        for x, y in TARGETS.values():
            row, column = raster.index(ORIGIN[0] + x, ORIGIN[1] + y)
            rows, columns = np.mgrid[row - 3:row + 4, column - 3:column + 4].reshape(2, -1)
            weight = np.nan_to_num(power[rows, columns])
            assert weight.max() > 30 * np.nanmedian(power)
            weight[weight < 0.1 * weight.max()] = 0
            found = np.average(raster.xy(rows, columns), axis=1, weights=weight)
            assert found - ORIGIN == pytest.approx((x, y), abs=0.125)
