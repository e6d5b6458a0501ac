"""Pictures of a line of soundings: the numbers on the axes are those of the line, whatever the line lacks.

Closed forms: straight rays in water of one speed end where the soundings lie; a mean over a bin is the mean of its
soundings; what a wrong profile does follows from exact eigenrays of the library.
"""
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import xarray as xr
from drawn_line import HEAD, line, smile
from matplotlib.colors import to_hex, to_rgb
from matplotlib.text import Text
from soundings_line import soundings_line

from mitsonar import plots
from mitsonar.cli import main as cli
from mitsonar.hydrography.record import variable
from mitsonar.hydrography.reduction import ray_paths
from mitsonar.hydrography.reduction.resounding import resounded
from mitsonar.hydrography.vertical_angles import vertical_angle
from mitsonar.io.records import netcdf
from mitsonar.plots import canvas
from mitsonar.plots.lines import line_maps, ray_plot, water_column
from mitsonar.propagation import eigenray
from mitsonar.water import SoundSpeedProfile

pytestmark = pytest.mark.filterwarnings("error")
FULL = line(12, 41, column=300)
CAST = SoundSpeedProfile([0, 15, 25, 80], [1510, 1508, 1490, 1488])


def with_water(data, profile, cast=None):
    """The line with the water's own profile, and another cast."""
    values = {"true_cast_depth": profile.depth, "true_cast_sound_speed": profile.sound_speed}
    if cast is not None:
        data = data.drop_dims("node")
        values |= {"cast_depth": cast.depth, "cast_sound_speed": cast.sound_speed}
    return data.assign({name: variable(name, array) for name, array in values.items()})


def unknown(data, *names):
    """The line with NaN in place of numbers."""
    return data.assign({name: xr.full_like(data[name], np.nan) for name in names})


def curve(axes, words):
    """The numbers of a curve by its name."""
    return next(one for one in axes.get_lines() if one.get_label() == words).get_data()


@pytest.mark.parametrize("what", [what for what in plots.LINE_VIEWS if not what.startswith("error_")])    # one map
def test_every_view_is_drawn(what, tmp_path):
    before = FULL.copy(deep=True)
    plots.plot(FULL, what, tmp_path / "a.png")
    image = matplotlib.image.imread(tmp_path / "a.png")
    assert image.shape[0] > 200 and image.shape[1] > 600 and image.std() > 0.05
    assert FULL.identical(before)


MAPS = ("error", "error_detection", "error_refraction", "error_motion")
LINES = {                                              # views that are asked for, and those that have nothing to show
    "one ping": (line(1, 41, column=60), ("column", "curtain", "swath", "smile", "rays", "quality", "motion"), ()),
    "one beam": (line(6, 1, column=60), ("column", "curtain", "swath", "smile", "rays", "quality"), ()),
    "one sounding": (line(1, 1), ("swath", "backscatter", "smile"), ()),
    "none valid": (FULL.assign(valid=xr.zeros_like(FULL["valid"])), [*plots.LINE_VIEWS][1:],
                   ("swath", *MAPS, "backscatter", "smile", "rays", "quality")),
    "read from a file": (line(6, 11, truth=False), [*plots.LINE_VIEWS][1:], ("column", "curtain", *MAPS, "smile")),
    "unknown numbers": (unknown(FULL, *(name for name in FULL if FULL[name].dtype.kind == "f")),
                        ("column", "curtain", "swath", "backscatter", "smile", "rays", "quality", "motion"),
                        ("column", "curtain", "swath", "backscatter", "smile", "rays", "quality")),
    "half unknown": (FULL.assign({name: FULL[name].where(np.arange(41) % 2 > 0) for name in FULL
                                  if FULL[name].dims == ("ping", "beam") and FULL[name].dtype.kind == "f"}),
                     ("column", "curtain", "swath", "backscatter", "smile", "rays", "quality"), ()),
    "silent column": (unknown(FULL, "column_level_db"), ("column", "curtain"), ("column", "curtain")),
    "no pings": (FULL.isel(ping=[]), plots.LINE_VIEWS, plots.LINE_VIEWS),
    "no motion": (FULL.isel(motion=[]), ("rays", "motion"), ("motion",)),
    "no sectors": (FULL.isel(transmission=[]), ("column", "curtain"), ()),
    "one place": (FULL.assign(x=xr.zeros_like(FULL["x"]), y=xr.zeros_like(FULL["y"])), ("swath", "error"), ()),
    "upside down": (FULL.assign(ping_roll=FULL["ping_roll"] + np.pi), ("rays", "smile"), ()),
    "under the bed": (FULL.assign(ping_depth=FULL["ping_depth"] + 100), ("column", "curtain", "rays", "smile"), ()),
}


@pytest.mark.parametrize("name", LINES)
def test_a_line_that_lacks_something_is_drawn_or_answered_in_a_sentence(name):
    data, views, nothing = LINES[name]
    refused = []
    for what in views:
        try:
            plots.line_figure(data, what)
        except ValueError as error:
            assert str(error).endswith(".") and "\n" not in str(error)
            refused.append(what)
    assert refused == list(nothing)


def test_the_smile_is_the_mean_error_at_each_angle_with_what_it_spreads():
    figure = plots.line_figure(FULL, "smile")
    above, below = figure.axes
    angle, refraction = curve(above, "refraction")
    seen = np.rad2deg(np.arctan2(FULL["across_track"].values, FULL["depth"].values - HEAD))
    errors = [FULL["error"].values[np.floor(seen / 5) == step] for step in np.unique(np.floor(seen / 5))]
    assert curve(above, "all causes")[1] == pytest.approx([some.mean() for some in errors])
    assert refraction == pytest.approx(smile(np.deg2rad(angle)), abs=0.06)     # what is too deep is seen steeper
    spread = [some.std() for some in errors]
    band = above.collections[0].get_paths()[0].vertices
    assert np.ptp(band[np.isclose(band[:, 0], angle[3]), 1]) == pytest.approx(2 * spread[3])
    assert curve(above, "motion")[1] == pytest.approx(0.01)
    assert "ray theory, level bed" not in above.get_legend_handles_labels()[1]
    assert below.get_yscale() == "log"


@pytest.mark.parametrize("depth", [8.0, 2000.0])
def test_names_of_orders_do_not_overlap(depth):
    figure = plots.line_figure(line(3, 21, depth), "smile")
    figure.draw_without_rendering()
    boxes = sorted((text.get_window_extent() for text in figure.axes[1].texts), key=lambda box: box.y0)
    assert len(boxes) == 4 and all(low.y1 <= high.y0 + 1 for low, high in zip(boxes, boxes[1:]))


def test_ray_theory_is_that_of_exact_eigenrays():
    """A sounding of the true ray's slowness and time is placed in the profile used; both ends by eigenrays."""
    used, bed = SoundSpeedProfile([0, 80], [1500, 1500]), 50.0
    head = ray_paths.head_of(FULL.assign(head_sound_speed=FULL["head_sound_speed"] * 0 + CAST.at(HEAD)), 0)
    away = np.array([5.0, 30.0, 60.0, 100.0])
    true = eigenray(CAST, HEAD, bed, away)
    slowness = np.cos(true.launch_angle) / CAST.at(HEAD)
    length = used.at(HEAD) * true.travel_time                       # straight rays: sin = p c
    sine = slowness * used.at(HEAD)
    depth, across = HEAD + length * np.sqrt(1 - sine**2), length * sine
    found = ray_paths.refraction_error(used, CAST, head, bed, np.arctan2(across, depth - HEAD))
    assert np.abs(depth - bed).max() > 0.3                                               # there is something to find
    assert found == pytest.approx(depth - bed, abs=2e-3)         # read off between 400 rays, 5e-4 of the error
    mirrored = ray_paths.refraction_error(used, CAST, head, bed, -np.arctan2(across, depth - HEAD))
    assert mirrored == pytest.approx(found)


def test_the_smile_has_ray_theory_where_the_water_is_known():
    axes = plots.line_figure(with_water(FULL, CAST), "smile").axes[0]
    angle, error = curve(axes, "ray theory, level bed")
    head = ray_paths.head_of(FULL, 6)
    assert error[90] == pytest.approx(ray_paths.refraction_error(
        ray_paths.used_profile(FULL, head), CAST, head, 50.0, np.deg2rad(angle[90:91]))[0])
    given = (np.deg2rad([-50.0, 0, 50]), np.array([1.0, 0, 1]))
    drawn = curve(plots.line_figure(FULL, "smile", theory=given).axes[0], "ray theory, level bed")
    assert drawn[0] == pytest.approx([-50, 0, 50]) and drawn[1] == pytest.approx([1, 0, 1])


def test_the_smile_of_a_line_that_was_reduced_with_a_wrong_profile_is_that_of_ray_theory():
    """Soundings of a rocking ship on a level bed, reduced anew, with the head's own speed as a node of the wrong cast.

    Within 3 % of the smile's size: bins of 2 degrees, arrays that lie apart and move, 1 cm of noise.
    """
    data = soundings_line(8, 120, slope=0.0, column=False, snippets=False)
    wrong = resounded(data, SoundSpeedProfile([0, 10, 20, 200], [1510, 1510, 1490, 1490]))
    known = with_water(wrong.assign(error=wrong["depth"] - 50.0), SoundSpeedProfile.constant(1500.0))
    axes = plots.line_figure(known, "smile").axes[0]
    (angle, mean), theory = curve(axes, "all causes"), curve(axes, "ray theory, level bed")
    assert np.ptp(mean) > 0.4
    assert mean == pytest.approx(np.interp(angle, *theory), abs=0.03 * np.ptp(mean))


def test_directions_come_back_from_the_angles_of_two_tilted_arrays():
    tilted = FULL.assign(ping_roll=FULL["ping_roll"] + 0.1, ping_pitch=FULL["ping_pitch"] - 0.05,
                         receive_mounting=("axis", [0.02, 0.01, -0.03]))
    head = ray_paths.head_of(tilted, 3)
    towards = np.random.default_rng(0).normal(0, 1, (50, 3)) * [0.1, 1, 0] + [0, 0, 1.2]
    towards /= np.linalg.norm(towards, axis=1)[:, None]
    found = ray_paths.launches(head, np.arcsin(towards @ head.receive), np.arcsin(towards @ head.transmit))
    assert found == pytest.approx(towards, abs=1e-12)
    assert head.transmit[2] == pytest.approx(np.sin(0.05)) and head.receive[2] > 0       # bow down, starboard down


def test_rays_end_at_the_soundings():
    """Water of one speed; with errors of 0 the bed, the soundings and the ends of both sorts of rays are one."""
    exact = FULL.assign(depth=FULL["true_depth"])
    head = ray_paths.head_of(exact, 5)
    across, depth = ray_plot.ray_lines(exact.isel(ping=[5]), head, ray_paths.used_profile(exact, head))
    assert across[:, -1] == pytest.approx(exact["across_track"].values[5], abs=1e-3)
    assert depth[:, -1] == pytest.approx(exact["depth"].values[5], abs=1e-3)
    assert across[:, 0] == pytest.approx(0) and depth[:, 0] == pytest.approx(HEAD)


def test_echoes_are_seen_by_the_array_as_it_lies_when_they_return():
    """A ship that has rolled to starboard by 2 degrees when echoes are back: what comes at 0 came from 2 to port."""
    rolls = FULL.assign(motion_roll=FULL["motion_roll"] + np.deg2rad(2.0))
    head = ray_paths.head_of(rolls, 5)
    axes = ray_paths.receiving_axes(rolls, 5, head, np.array([0.05, 1e4]))
    towards = ray_paths.launches(head, np.zeros(2), np.zeros(2), axes)
    assert np.rad2deg(np.arctan2(towards[:, 1], towards[:, 2])) == pytest.approx([-2, 0])     # the last is unknown


def test_a_ping_is_seen_by_its_own_head():
    """Of two heads that look 40 degrees aside, a metre apart."""
    mountings = np.deg2rad([[-40.0, 0, 0], [40.0, 0, 0]])
    two = FULL.assign(head=variable("head", np.arange(12) % 2),
                      head_receive_offset=variable("head_receive_offset", np.array([[0, -1.0, 0], [0, 1.0, 0]])),
                      head_receive_mounting=variable("head_receive_mounting", mountings))
    for ping in (4, 5):
        head = ray_paths.head_of(two, ping)
        assert head.across == (0.5, -0.5)[ping % 2 == 0]
        for axes in (None, ray_paths.receiving_axes(two, ping, head, np.array([0.1]))):
            towards = ray_paths.launches(head, np.zeros(1), np.zeros(1), axes)[0]
            assert np.rad2deg(np.arctan2(towards[1], towards[2])) == pytest.approx((-40, 40)[ping % 2 == 0])
    angles = vertical_angle(two)
    assert np.tan(angles[5, 20]) == pytest.approx(-0.5 / float(two["depth"][5, 20] - HEAD))


def test_what_no_sounding_has_is_left_out_of_an_overview():
    bare = line(6, 11, truth=False)
    assert len(plots.line_figure(bare).axes) == 6
    silent = unknown(bare, "backscatter_db", "uncertainty", "horizontal_uncertainty")
    assert len(plots.line_figure(silent).axes) == 3                        # no mosaic, response, uncertainty


def test_the_line_of_a_real_sounder_is_drawn(tmp_path, capsys):
    path = Path(__file__).resolve().parents[3] / "shared/data/measured/multibeam/em2042_os01.kmall"
    if not path.exists():
        pytest.skip("the measured lines are not beside this checkout")
    assert cli.main(["plot", str(path), "--what", "column", "-o", str(tmp_path / "a.png")]) == 0
    assert (tmp_path / "a.png").stat().st_size > 20_000 and capsys.readouterr().err == ""


def test_rays_show_both_profiles_over_the_bed():
    left, right = plots.line_figure(with_water(FULL, CAST), "rays", ping=2).axes
    assert curve(left, "water's own")[0][[0, -1]] == pytest.approx([1510, 1488], abs=5)
    assert {"rays by the profile in use", "rays by the water's own", "bed", "soundings"} <= set(
        right.get_legend_handles_labels()[1])
    assert right.get_ylim()[0] > right.get_ylim()[1]                                     # depth grows downwards
    assert curve(right, "bed")[1] == pytest.approx(FULL["true_depth"].values[2])
    assert len(plots.line_figure(FULL, "rays").axes[1].get_lines()) < len(right.get_lines())


def test_a_grid_has_the_means_of_its_cells_and_fills_narrow_gaps_only():
    x, y = np.array([0.5, 0.5, 1.5, 3.5, 0.5, 1.5, 3.5, 0.5, 1.5, 3.5]), np.repeat([0.5, 1.5, 2.5], [4, 3, 3])
    grid, extent = line_maps.mean_grid(x, y, np.arange(10.0), 1.0)
    assert grid[0, :2] == pytest.approx([0.5, 2.0]) and np.isfinite(grid).all() and extent == (0.5, 4.5, 0.5, 3.5)
    assert line_maps.mean_grid(np.zeros(2), np.zeros(2), np.array([0.0, 10.0]), 1.0, decibel=True)[0][0, 0] == (
        pytest.approx(7.404, abs=1e-3))                                                  # the mean of 1 and 10: 5.5
    far = line_maps.mean_grid(np.array([0.0, 50.0]), np.zeros(2), np.ones(2), 1.0)[0]
    assert np.isfinite(far).sum() == 2


@pytest.mark.parametrize("east, north, lit", [(1, 0, False), (-1, 0, True), (0, 1, True), (0, -1, False)])
def test_beds_that_face_the_north_west_are_lit(east, north, lit):
    """Depth grows in that direction, so that the bed faces it."""
    rows, columns = np.mgrid[:20, :20]
    flat, tilted = (line_maps.shaded(50 + slope * (east * columns + north * rows), 1.0,
                                     line_maps.colormaps["gray"], lambda values: 0 * values + 0.5)[10, 10, 0]
                    for slope in (0.0, 0.2))
    assert (tilted > flat) == lit


@pytest.mark.parametrize("beams", [41, 601])
def test_maps_show_soundings_at_their_places_in_equal_scales(beams):
    data = line(12, beams, slope=0.1)
    figure = plots.line_figure(data, "swath")
    axes = figure.axes[0]
    west, east = axes.get_xlim()
    assert west < data["x"].min() and east > data["x"].max() and axes.get_aspect() == 1
    if beams == 41:
        points = axes.collections[0]
        assert np.allclose(points.get_offsets(), np.stack([data["x"], data["y"]], -1).reshape(-1, 2))
        low, high = points.get_clim()
        assert [low, high] == pytest.approx(np.percentile(data["depth"], [0.5, 99.5]))
    else:
        assert axes.images[0].get_extent()[:2] == pytest.approx(
            [float(data["x"].min()), float(data["x"].max())], abs=0.5)
    bar = figure.axes[0].child_axes[0]
    assert bar.yaxis_inverted() and bar.get_ylabel() == "depth [m]"
    assert axes.get_xlabel() == "east of 500000 m [m], EPSG:32632"


def test_errors_have_the_same_colours_to_both_sides_of_zero():
    low, high = plots.line_figure(FULL, "error_motion").axes[0].collections[0].get_clim()
    assert low == -high == pytest.approx(-0.01)


def test_the_angular_response_is_the_mean_intensity_beside_the_law():
    data = line(400, 21)
    axes = plots.line_figure(data, "backscatter").axes[1]
    angle, measured = curve(axes, "mean intensity of soundings")
    law = curve(axes, "seabed's law")[1]
    assert measured == pytest.approx(law, abs=0.8)                # 400 soundings of exponential power: 5 %, 0.2 dB
    middle = np.abs(angle).argmin()
    assert law[middle] == pytest.approx(-20, abs=0.1)


def test_the_quality_of_each_way_of_detection_stands_where_it_was_used():
    uncertainty, quality, shares = plots.line_figure(FULL, "quality").axes
    angle, by_phase = curve(quality, "by phase")
    assert np.isnan(by_phase[np.abs(angle) < 20]).all() and by_phase[np.abs(angle) > 30] == pytest.approx(2.5)
    angle, said = curve(uncertainty, "stated: of depth")
    assert said == pytest.approx(0.05 + 0.1 * np.deg2rad(np.abs(angle)), abs=0.006)
    heights = [[bar.get_height() for bar in group] for group in shares.containers]
    assert np.sum(heights, 0) == pytest.approx(100)


@pytest.mark.parametrize("bend", [True, False])
def test_the_water_column_lies_where_rays_bring_it(bend):
    """The bed is level in straight rays. A cast that slows downwards lays the outer part of the same echoes deeper."""
    data = with_water(FULL, CAST, cast=SoundSpeedProfile([0, 30, 60], [1500, 1480, 1440]))
    fan = water_column.fan_of_ping(data, 4, bend=bend, tvg=None)
    port, starboard, lower, upper = fan.extent
    cell = (starboard - port) / fan.image.shape[1]
    assert upper == HEAD and cell == pytest.approx((lower - upper) / fan.image.shape[0], rel=0.01)
    depth = upper + (np.arange(fan.image.shape[0]) + 0.5) * cell
    beds = []
    for across in (0.0, 70.0):
        column = fan.image[:, int((across - port) / cell)]
        bright = depth[np.nan_to_num(column, nan=-np.inf) > 90]
        beds.append(bright.mean())
    assert beds[0] == pytest.approx(50 if not bend else 49.6, abs=0.5)
    assert (beds[1] > beds[0] + 0.4) if bend else beds[1] == pytest.approx(50, abs=1.2)
    ring = fan.image[int((40 - HEAD) / cell), int((np.sqrt(48**2 - 38**2) - port) / cell)]
    assert bend or ring == pytest.approx(65, abs=2)
    low, high = water_column.column_window(fan.image)
    assert low <= 45 and high >= 95                                # the ring 35 dB under the bed is in the colours


def test_the_curtain_has_the_first_return_at_its_range():
    upper, lower = plots.line_figure(FULL, "curtain", tvg=None).axes
    bottom = upper.get_lines()[0]
    assert bottom.get_ydata() == pytest.approx(48.0) and bottom.get_xdata() == pytest.approx(FULL["ping_time"])
    pings = water_column.curtain(FULL, None)
    for image in (pings.nadir, pings.largest):
        row = np.nanargmax(image[:, 5])
        assert pings.slant_range[row] - 1.3 <= 48 <= pings.slant_range[row + 1] + 1.3     # the bed is 2.4 m thick
    assert np.nanmax(pings.nadir) == pytest.approx(100) and np.isfinite(pings.largest).mean() > 0.95
    assert upper.get_ylim()[0] == pytest.approx(1.5 * float(FULL["depth"].max() - HEAD))
    assert lower.get_xlim() == pytest.approx((-0.25, 5.75))


def test_motions_are_in_degrees_and_heave_is_up():
    panels = plots.line_figure(FULL.assign(motion_roll=FULL["motion_roll"] + 0.1), "motion").axes
    assert panels[0].get_lines()[0].get_ydata() == pytest.approx(np.rad2deg(0.1))
    heave = panels[2].get_lines()[0].get_ydata()
    assert heave == pytest.approx(FULL["motion_depth"].mean().item() - FULL["motion_depth"].values)
    assert panels[-1].get_xlabel() == "time [s] after 2026-05-01T10:00:00Z"


@pytest.mark.parametrize("options, sentence", [
    ({"what": "swaht"}, 'did you mean "swath"'), ({"what": "waterfall"}, "choose one of overview, column"),
    ({"what": "swath", "ping": 3}, "a ping is of the plots column"), ({"what": "rays", "ping": 12}, "no ping 12"),
    ({"what": "smile", "tvg": None}, "the plot is 'smile'"), ({"what": "rays", "colours": "grey"}, "leave them out"),
    ({"what": "column", "colours": "green"}, "no colours 'green'")])
def test_what_makes_no_sense_is_refused(options, sentence, tmp_path):
    with pytest.raises(ValueError, match=sentence):
        plots.plot(FULL, path=tmp_path / "a.png", **options)
    with pytest.raises(ValueError, match="a line of soundings, with travel_time"):
        plots.plot(FULL[["depth"]], "swath", tmp_path / "a.png")
    with pytest.raises(ValueError, match="lacks "):
        plots.line_figure(FULL.drop_vars("ping_x"), "swath")
    assert not list(tmp_path.iterdir())


def test_the_command_draws_a_line_from_its_file(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    netcdf.write(FULL, "line.nc")
    assert plots.usual_plot(FULL) == "overview"
    assert cli.main(["plot", "line.nc", "--what", "column", "--ping", "3"]) == 0
    assert capsys.readouterr().out.split() == ["line_column.png"]
    plots.plot(FULL, "column", "again.png", ping=3)
    assert (tmp_path / "again.png").read_bytes() == (tmp_path / "line_column.png").read_bytes()
    (tmp_path / "cut.nc").write_bytes((tmp_path / "line.nc").read_bytes()[:30_000])
    assert cli.main(["plot", "cut.nc"]) == 2
    assert "cut.nc is no netCDF-4 file that can be read" in capsys.readouterr().err


def test_a_water_column_is_read_some_pings_at_a_time(tmp_path, monkeypatch):
    """What is opened, not read, gives the same curtain, and the file's samples are asked for in blocks."""
    netcdf.write(FULL, tmp_path / "line.nc")
    monkeypatch.setattr(water_column, "BLOCK", 5)
    with netcdf.opened(tmp_path / "line.nc") as opened:
        pings = water_column.curtain(opened)
        assert not opened["column_level_db"].variable._in_memory
    assert np.array_equal(pings.largest, water_column.curtain(FULL).largest, equal_nan=True)


def test_a_video_has_a_frame_a_ping_with_its_bed_in_the_same_place(tmp_path):
    """The ship heaves by a metre; the bed stays at its depth, and pings without samples are left out."""
    data = line(4, 41, column=120)
    data = data.assign(ping_depth=("ping", HEAD + np.array([0.0, 1.0, 0.0, 0.0])),
                       depth=data["true_depth"],
                       column_level_db=data["column_level_db"].where(data["ping_time"] != 1.5))
    netcdf.write(data, tmp_path / "line.nc")
    plots.video(tmp_path / "line.nc", tmp_path / "frames", tvg=None)
    frames = [matplotlib.image.imread(path) for path in sorted((tmp_path / "frames").iterdir())]
    assert len(frames) == 3 and len({frame.shape for frame in frames}) == 1
    assert np.array_equal(frames[0][100:], frames[2][100:]) and not np.array_equal(frames[0], frames[1])
    heads = [np.flatnonzero(np.abs(frame[100:, 480, :3] - frame[100, 90, :3]).max(-1) > 0.01)[0]
             for frame in frames[:2]]
    assert heads[1] > heads[0]                                            # lower on the sheet by a metre
    with pytest.raises(ValueError, match="no ping with a water column"):
        plots.video(line(2, 5), tmp_path / "a.gif")
    assert not (tmp_path / "a.gif").exists()


def test_an_overview_of_a_few_pings_fills_its_dark_paper():
    """Maps of a narrow strip are stretched, and no panel's words run into the next one's."""
    line = soundings_line(pings=2)
    figure = plots.line_figure(line, "overview")
    figure.canvas.draw()
    assert to_hex(figure.get_facecolor()) == canvas.PAPER
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    drawn, paper = (sum(one.width * one.height for one in some) for some in (
        [axes.bbox for axes in figure.axes], [figure.bbox]))
    assert drawn > 0.35 * paper
    assert not any(one.overlaps(other) for number, one in enumerate(boxes) for other in boxes[:number])
    words = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    assert words and all(sum(to_rgb(text.get_color())) > 1.2 for text in words)
