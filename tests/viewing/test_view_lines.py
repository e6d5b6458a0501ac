"""What a page of soundings and of focused images shows, read back by rerun's own reader."""
import numpy as np
import pytest
from labelled_focus import labelled_focus
from read_view import pixels
from soundings_line import soundings_line

pytest.importorskip("rerun", reason="rerun-sdk is not installed")


def test_soundings_are_points_where_they_are_with_their_values(shown):
    line = soundings_line(pings=4)
    read, valid = shown(line), line["valid"].values
    for entity, depth in (("by_error", "depth"), ("by_depth", "depth"), ("by_backscatter", "depth"),
                          ("true", "true_depth")):
        points, = read[f"/world/multibeam/soundings/{entity}"].column("Points3D:positions")
        wanted = [line["x"].values[valid], line["y"].values[valid], -line[depth].values[valid]]
        np.testing.assert_allclose(points, np.transpose(wanted), rtol=1e-6, atol=1e-4)
    error, = read["/world/multibeam/soundings/by_error"].column("error")
    np.testing.assert_allclose(error, line["error"].values[valid], rtol=1e-6)


def test_positive_errors_are_red_and_negative_ones_blue(shown):
    line = soundings_line(pings=4)
    colours, = shown(line)["/world/multibeam/soundings/by_error"].column("Points3D:colors")
    red, blue = (np.array(colours) >> shift & 255 for shift in (24, 8))
    error = line["error"].values[line["valid"].values]
    clear = np.abs(error) > 0.005
    assert clear.sum() > 20 and ((red > blue) == (error > 0))[clear].all()


def test_every_ping_has_its_soundings_and_its_water_column_at_its_time(shown):
    line = soundings_line(pings=4)
    read = shown(line)
    for entity in ("/world/multibeam/ping", "/multibeam/column/level", "/multibeam/column/soundings"):
        np.testing.assert_allclose(read[entity].times, line["ping_time"].values, atol=1e-9)
    sizes = [len(points) for points in read["/world/multibeam/ping"].column("Points3D:positions")]
    assert sizes == line["valid"].sum("beam").values.tolist()


def test_the_soundings_of_a_column_lie_at_their_depths(shown):
    """Cells of the picture are square, so that two soundings give the scale; tolerance: a pixel."""
    line = soundings_line(pings=4)
    places = np.array(shown(line)["/multibeam/column/soundings"].column("Points2D:positions")[0])
    valid = line["valid"].values[0]
    across, depth = line["across_track"].values[0][valid], line["depth"].values[0][valid]
    scale = np.ptp(places[:, 0]) / np.ptp(across)
    np.testing.assert_allclose(np.diff(places[:, 1]), scale * np.diff(depth), atol=1)


def test_a_line_without_truth_or_column_is_shown_by_depth(shown):
    line = soundings_line(pings=3, column=False)
    read = shown(line.drop_vars([name for name in line if str(name).startswith(("error", "true"))]))
    assert "/world/multibeam/soundings/by_depth" in read
    assert not any("error" in entity or "column" in entity for entity in read)


def test_a_focused_image_is_a_picture_of_its_points(shown):
    image = labelled_focus(rows=20, columns=90, rectangles=(("highlight", "box.1", 10, 16, 30, 36),))
    read = shown(image)
    name = next(entity for entity in read if entity.endswith("/focused/level")).removesuffix("level")
    level = pixels(read[f"{name}level"].fixed[0])
    drawn = np.maximum(image["level"].isel(bank=0).transpose("along_track", "across_track").values[::-1], level.min())
    np.testing.assert_allclose(level, drawn, atol=0.06)
    objects = pixels(next(row for row in read[f"{name}objects"].fixed if any("buffer" in key and value for key, value in
                                                                            row.items())))
    rows, columns = np.nonzero(objects)
    assert (rows.min(), rows.max(), columns.min(), columns.max()) == (4, 9, 30, 35)        # the last row is on top
    assert f"{name}level_1" in read
