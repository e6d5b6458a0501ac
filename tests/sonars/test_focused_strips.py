"""Images of strips: where points lie, how strong and how wide they are, and that all ways to them are one."""
import numpy as np
import pytest
from sonar_scenes import bed, lambert, point_target, synthetic_aperture

import mitsonar
from mitsonar.synthetic_aperture.focusing.grids import ground_grid
from mitsonar.synthetic_aperture.record import check_image

C, BED = 1500.0, 20.3
THERMOCLINE = {"profile": "0:1520, 8:1518, 14:1500, 30:1496"}
UNEASY = {"overlap": 3, "pings": 24, "sway": 0.03, "heave": 0.02, "yaw_deg": 0.3, "surge": 0.02, "motion_period": 3.0}
PLACES = {"near": (21.0, 0.6, -BED + 0.002), "far": (26.0, 0.9, -BED + 0.002)}
STRENGTHS = {"near": -10.0, "far": -3.0}


def scene(water=None, sensor=None, **shapes):
    targets = {name: point_target(place, STRENGTHS[name]) for name, place in PLACES.items()}
    return synthetic_aperture({"seabed": bed(BED, lambert(-60.0)), **targets, **shapes}, water=water or {},
                              sensor={**UNEASY, "image_spacing": 0.04, "vertical_beam_width_deg": 180.0,
                                      **(sensor or {})})


def peak(raw, place, **how):
    """Place relative to where the point is, and level of its peak, on a grid of 2 mm."""
    grid = ground_grid((-0.05, 0.05), (-0.05, 0.05), (0.002, 0.002), BED, origin=place[:2])
    image = mitsonar.focus(raw, grid, **how)
    level = image.level.values[0]
    row, column = np.unravel_index(level.argmax(), level.shape)
    return image.x.values[row, column] - place[0], image.y.values[row, column] - place[1], level.max()


@pytest.mark.parametrize("water", [{}, THERMOCLINE], ids=["one speed", "thermocline"])
def test_points_stand_at_their_places_with_their_strengths(water):
    """Within a tenth of a resolution cell of 1.4 x 2.5 cm, and 0.3 dB."""
    raw = mitsonar.raw_echoes(scene(water=water))
    for name, place in PLACES.items():
        east, north, level = peak(raw, place)
        assert abs(east) <= 0.002 and abs(north) <= 0.0025
        assert level == pytest.approx(STRENGTHS[name], abs=0.3)


def test_the_truth_names_what_stands_there():
    image = mitsonar.render(scene(water=THERMOCLINE, sensor={"pings": 12}))
    check_image(image)
    numbers = {name: int(number) for number, name in image.attrs["labels"].items()}
    assert set(numbers) == {"seabed", *PLACES}
    assert {"label", "shadow", "object_shadow", "seabed_x", "share"} <= set(image.variables)
    bed_seen = image.label.values == numbers["seabed"]
    assert bed_seen.mean() > 0.98 and image.shadow.values.mean() < 0.01


def test_render_and_focus_of_scene_and_signals_are_one():
    made = scene(sensor={"pings": 6})
    rendered, focused = mitsonar.render(made, seed=2), mitsonar.focus(made, seed=2)
    raw = mitsonar.raw_echoes(made, seed=2)
    again = mitsonar.focus(raw, ground_grid_of(rendered))
    np.testing.assert_array_equal(rendered.image.values, focused.image.values)
    # the grid's steps come back from differences of its axes
    np.testing.assert_allclose(again.image.values, rendered.image.values, atol=1e-6 * abs(again.image.values).max())


def ground_grid_of(image):
    along, across = image.along_track.values, image.across_track.values
    return ground_grid((along[0], along[-1]), (across[0], across[-1]), (along[1] - along[0], across[1] - across[0]),
                       image.grid_depth.values, origin=(image.attrs["grid_origin_x"], image.attrs["grid_origin_y"]),
                       heading=image.attrs["grid_heading"])


def test_one_sound_speed_in_a_thermocline_costs_strength_and_place():
    """The straight ray's time at the speed of the sonar is 0.5 % off: the point moves by centimetres."""
    raw = mitsonar.raw_echoes(scene(water=THERMOCLINE))
    right, wrong = peak(raw, PLACES["near"]), peak(raw, PLACES["near"], profile=1511.0)
    assert np.hypot(*right[:2]) < 0.004 and right[2] == pytest.approx(STRENGTHS["near"], abs=0.3)
    assert np.hypot(*wrong[:2]) > 0.02 or wrong[2] < STRENGTHS["near"] - 3
