"""Shadows by the chords of ray fans against those by chords ten times nearer to the rays.

Boxes of 0.2 m stand on a flat bed 4 m below the sonar, 10 to 60 m off, in a summer cast whose rays bend by up to 0.1 m
over that way. Chords within 2 mm of the ray move the edge of a shadow by as much times the ratio of its length to the
way: 2 mm over a slope of 1 in 16 is 0.03 m of the 3 m behind the farthest box. Points lie 1 cm by 4 cm apart.
"""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from summer import SUMMER_TABLE

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scene.geometry import Geometry
from mitsonar.scene.tracing.connection import Connector
from mitsonar.scene.tracing.tracer import FAN_TOLERANCE, Tracer
from mitsonar.scene.tracing.water import DeviceWater
from mitsonar.water import SoundSpeedProfile

DEPTH, BED, HALF = 16.0, 20.0, 0.1
RANGES = 10.0, 25.0, 60.0


@pytest.fixture(scope="module")
def boxes():
    """Boxes in a row to the east, 5 m apart to the north so that none stands in another's shadow."""
    from mitsonar.scene.loading import prepare

    prepare()
    to_world = mi.ScalarTransform4f
    shapes = {"bed": {"type": "rectangle", "to_world": to_world().translate([0, 0, -BED]).scale(200.0)}}
    for number, x in enumerate(RANGES):
        shapes[f"box{number}"] = {"type": "cube",
                                  "to_world": to_world().translate([x, 5 * number, HALF - BED]).scale(HALF)}
    return Geometry(mi.load_dict({"type": "scene", **shapes}, optimize=False))


@pytest.mark.parametrize("number", range(len(RANGES)))
def test_shadows_of_small_boxes_keep_their_edges(variant, boxes, number):
    water, lib, x = DeviceWater(SoundSpeedProfile(*SUMMER_TABLE)), arrays_of(mi.Float), RANGES[number]
    east, north = np.meshgrid(x + np.arange(-1.0, 5.0, 0.01), 5 * number + np.arange(-0.5, 0.5, 0.04), indexing="ij")
    point = lib.Array3f64(*(upload(mi.Float64, column.ravel()) for column in (east, north, np.full(east.shape, -BED))))
    free = []
    for tolerance in (0.1 * FAN_TOLERANCE, FAN_TOLERANCE):
        sources = Tracer(boxes, water, max_range=80.0, tolerance=tolerance).sources([DEPTH])
        way = Connector(boxes, water).connect(sources, lib.Array3f64(0, 5 * number, -DEPTH),
                                              mi.UInt32(0), point, mi.Vector3f(0, 0, 1))
        dr.eval(way.free)
        free.append(way.free.numpy().reshape(east.shape))
    fine, coarse = free
    before, behind = east < x - HALF, north == north[0, 12]
    assert coarse[before].all()                                     # nothing hides what lies before a box
    ends = [np.max(east[behind & ~mask]) for mask in free]
    assert ends[0] > x + HALF + 0.04 * x                            # a shadow of h x / (4 m - h), 5 % of the range
    assert ends[1] == pytest.approx(ends[0], abs=0.03)
    assert np.mean(fine != coarse) < 0.005
