"""Images of strips: where points lie, how strong and how wide they are, and that all ways to them are one."""
import numpy as np
import pytest

import mitsonar
from mitsonar.synthetic_aperture.grids import ground_grid
from mitsonar.synthetic_aperture.record import check_image
from mitsonar.validation.scenes import bed, lambert, point_target, synthetic_aperture

C, BED = 1500.0, 20.3
THERMOCLINE = {"profile": "0:1520, 8:1518, 14:1500, 30:1496"}
UNEASY = {"overlap": 3, "pings": 24, "sway": 0.03, "heave": 0.02, "yaw_deg": 0.3, "surge": 0.02, "motion_period": 3.0}
PLACES = {"near": (21.0, 0.6, -BED + 0.02), "far": (26.0, 0.9, -BED + 0.02)}
STRENGTHS = {"near": -10.0, "far": -3.0}


def scene(water=None, sensor=None, **shapes):
    targets = {name: point_target(place, STRENGTHS[name]) for name, place in PLACES.items()}
    return synthetic_aperture({"seabed": bed(BED, lambert(-60.0)), **targets, **shapes}, water=water or {},
                              sensor={**UNEASY, "image_spacing": 0.01, "vertical_beam_width_deg": 180.0,
                                      **(sensor or {})})


def about(image, place, half=0.12):
    """The image about a place: levels, and the axes relative to it."""
    along, across = image.along_track.values, image.across_track.values
    x, y = image.x.values, image.y.values
    row, column = np.unravel_index(np.argmin((x - place[0]) ** 2 + (y - place[1]) ** 2), x.shape)
    rows, columns = abs(along - along[row]) < half, abs(across - across[column]) < half
    return image.level.values[0][np.ix_(rows, columns)], y[np.ix_(rows, columns)], x[np.ix_(rows, columns)]


@pytest.fixture(scope="module", params=["one speed", "thermocline"])
def image(request):
    return mitsonar.render(scene(water=None if request.param == "one speed" else THERMOCLINE))


def test_points_stand_at_their_places_with_their_strengths(image):
    """Within a point of 1 cm, and 0.5 dB: through what beams across the track and half a point leave."""
    check_image(image)
    for name, place in PLACES.items():
        level, y, x = about(image, place)
        peak = np.unravel_index(level.argmax(), level.shape)
        assert abs(x[peak] - place[0]) <= 0.011 and abs(y[peak] - place[1]) <= 0.011
        assert level.max() == pytest.approx(STRENGTHS[name], abs=0.5)


def test_the_truth_names_what_stands_there(image):
    numbers = {name: int(number) for number, name in image.attrs["labels"].items()}
    assert set(numbers) == {"seabed", *PLACES}
    assert {"label", "shadow", "object_shadow", "seabed_x", "share"} <= set(image.variables)
    bed_seen = image.label.values == numbers["seabed"]
    assert bed_seen.mean() > 0.95 and not image.shadow.values.any()


def test_render_and_focus_of_scene_and_signals_are_one():
    made = scene(sensor={"pings": 6})
    rendered, focused = mitsonar.render(made, seed=2), mitsonar.focus(made, seed=2)
    raw = mitsonar.raw_echoes(made, seed=2)
    again = mitsonar.focus(raw, ground_grid_of(rendered))
    np.testing.assert_array_equal(rendered.image.values, focused.image.values)
    np.testing.assert_array_equal(rendered.image.values, again.image.values)


def ground_grid_of(image):
    along, across = image.along_track.values, image.across_track.values
    return ground_grid((along[0], along[-1]), (across[0], across[-1]), (along[1] - along[0], across[1] - across[0]),
                       image.depth.values, origin=(image.attrs["grid_origin_x"], image.attrs["grid_origin_y"]),
                       heading=image.attrs["grid_heading"])


def test_one_sound_speed_in_a_thermocline_costs_strength_and_place():
    """The straight ray's time at the speed of the sonar is 0.5 % off: the point moves by centimetres."""
    made = scene(water=THERMOCLINE)
    raw = mitsonar.raw_echoes(made)
    wrong = mitsonar.focus(raw, profile=1511.0)
    right = mitsonar.focus(raw)
    place = PLACES["near"]
    peaks = []
    for image in (right, wrong):
        level, y, x = about(image, place, half=0.3)
        peak = np.unravel_index(level.argmax(), level.shape)
        peaks.append(np.hypot(x[peak] - place[0], y[peak] - place[1]))
    assert peaks[0] < 0.03 < peaks[1]
