"""Pictures of datasets: every bin at its place, intensities averaged, display gain that flattens an even bed.

Closed forms: the mean of 1 and 10 is 5.5, 7.4 dB; on a level Lambert bed the gain of physics (30 log R + 2aR, Lambert's
sin²) leaves a constant, exact but for float32 levels (1e-4 dB). Places are checked to one picture element.
"""
import subprocess
import sys

import matplotlib.image
import numpy as np
import pytest
from exhaustive import thinned
from labelled_sidescan import labelled
from matplotlib.patches import Patch
from synthetic_sidescan import sidescan

from mitsonar import plots
from mitsonar.imaging.gain import display_gain
from mitsonar.plots import canvas
from mitsonar.plots.images import grid
from mitsonar.plots.images.levels import shown_levels

pytestmark = pytest.mark.filterwarnings("error")


def nothing(dataset):
    """The same survey where no ray met anything and the water is silent."""
    silent = dataset.copy(deep=True)
    for name in ("level", "mean_level"):
        silent[name][:] = -200
    silent["depth"][:] = np.nan
    for name in ("label", "rays", "shadow"):
        silent[name][:] = 0
    return silent


def phased(pings, bins):
    """A survey of an interferometric sidescan: depths a little off, and some bins without."""
    dataset = sidescan(pings, bins)
    shape = dataset["level"].shape
    slope = np.broadcast_to(np.linspace(0, 20, bins), shape)
    return dataset.assign({name: (dataset["level"].dims, values) for name, values in {
        "phase": np.angle(np.exp(1j * slope)), "coherence": 1 - slope / 40, "angle": 1.5 - slope / 20,
        "uncertainty": slope / 100, "measured_depth": np.where(slope > 1, 20 + 0.1 * np.sin(slope), np.nan),
        "error": np.where(slope > 1, np.sin(slope), np.nan), "valid": slope > 1}.items()})


SURVEYS = {
    "plain": sidescan(30, 60),
    "one bin": sidescan(1, 1),
    "standing still, dimensions turned around": sidescan(12, 40, speed=0.0).transpose("range", "side", "ping"),
    "far only": sidescan(20, 60).isel(range=slice(20, None)),
    "nothing, altitude unknown": nothing(sidescan(5, 20)).assign_coords(altitude=("ping", np.full(5, np.nan))),
    "no track, no attributes": sidescan(8, 20)[["level", "label", "depth", "shadow", "rays"]].drop_vars(
        ["altitude", "x", "y", "ping_time"]).drop_attrs(),
    "labelled": labelled(30, 100),
    "with phases": phased(20, 60),
    "a row a ping": labelled(30, 100).isel(side=1, drop=True),
    "labelled, no object": labelled(8, 40, objects={"seabed": "seabed"}, rectangles=[]),
}


CASES = [(name, what) for name in SURVEYS for what in plots.PLOTS]
RICHEST = "one bin", "nothing, altitude unknown", "labelled", "with phases"


@pytest.mark.parametrize("name, what", thinned(CASES, *(
    (name, what) for name, what in CASES if name in RICHEST or what == next(iter(plots.PLOTS)))))
def test_every_plot_of_every_survey(name, what, tmp_path, monkeypatch):
    monkeypatch.setattr(grid, "WIDEST", 300)  # small pictures for speed
    monkeypatch.setattr(grid, "LOWEST", 100)
    dataset = SURVEYS[name]
    before = dataset.copy(deep=True)
    if plots.PLOTS[what][1] not in dataset:
        with pytest.raises(ValueError, match="needs the variable"):
            plots.plot(dataset, what, tmp_path / "a.png")
        return
    plots.plot(dataset, what, tmp_path / "a.png")
    image = matplotlib.image.imread(tmp_path / "a.png")
    assert image.shape[0] > 200 and image.shape[1] > 250 and image.std() > 0.01
    assert dataset.identical(before)


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_preview_gives_the_same_bytes_each_time(suffix, tmp_path):
    for name in ("a", "b"):
        plots.preview(sidescan(10, 20), tmp_path / f"{name}.{suffix}")
    first, second = ((tmp_path / f"{name}.{suffix}").read_bytes() for name in ("a", "b"))
    assert first == second or suffix == "svg"  # an SVG names its parts at random


@pytest.mark.parametrize(("side", "index", "column"), [("port", 0, 299), ("port", 49, 5), ("starboard", 0, 310),
                                                       ("starboard", 49, 1390)])
@pytest.mark.parametrize(("ping", "row"), [(0, 0), (29, -1)])
def test_port_is_left_starboard_right_and_the_newest_ping_last(side, index, column, ping, row):
    """50 bins a side are 14 picture elements each: 0..699 port mirrored, 700..1399 starboard."""
    dataset = nothing(sidescan(30, 50))
    dataset["rays"].loc[{"side": side}][ping, index] = 1
    laid = grid.make_grid(dataset)
    image = laid.mean(dataset, lambda part: part["rays"].values)
    assert image.shape == (laid.height, 1400)
    columns = np.flatnonzero(image[row])
    first = 700 - 14 * (index + 1) if side == "port" else 700 + 14 * index
    np.testing.assert_array_equal(columns, np.arange(first, first + 14))
    assert image[row, first] == pytest.approx(1) and not image[laid.height // 2].any()


@pytest.mark.parametrize(("ping", "row"), [(0, 0), (29, -1)])
def test_a_row_a_ping_runs_from_left_to_right_and_has_no_sides(ping, row):
    dataset = nothing(sidescan(30, 50)).isel(side=0, drop=True)
    dataset["rays"][ping, 5] = 1
    dataset = grid.with_sides(dataset)
    laid = grid.make_grid(dataset)
    image = laid.mean(dataset, lambda part: part["rays"].values)
    np.testing.assert_array_equal(np.flatnonzero(image[row]), np.arange(28 * 5, 28 * 6))
    axes = canvas.picture(laid, image, "a row a ping")[1]
    assert axes.get_xlabel() == "slant range [m]" and axes.get_xlim() == (0, pytest.approx(75))


@pytest.mark.parametrize(("ping", "column"), [(0, 0), (29, -1)])
def test_an_echogram_has_its_ranges_down_and_the_newest_ping_on_the_right(ping, column):
    """50 bins are 14 picture elements each; the brightest of them is 70 to 84 elements below the top."""
    dataset = nothing(sidescan(30, 50)).isel(side=0, drop=True).assign_attrs(looks="down")
    dataset["rays"][ping, 5] = 1
    dataset = grid.with_sides(dataset)
    laid = grid.make_grid(dataset)
    axes = canvas.picture(laid, laid.mean(dataset, lambda part: part["rays"].values), "an echogram")[1]
    drawn = axes.images[0].get_array()
    assert drawn.shape == (700, laid.height) and axes.images[0].origin == "upper"
    np.testing.assert_array_equal(np.flatnonzero(drawn[:, column]), np.arange(14 * 5, 14 * 6))
    assert axes.get_ylabel() == "slant range [m]" and axes.get_ylim() == (pytest.approx(75), 0)


def test_the_picture_is_upright(tmp_path):
    """The last ping of port is bright: the upper left corner of the picture glows, the others stay dark."""
    dataset = nothing(sidescan(40, 50))
    dataset["level"][:] = 10
    dataset["level"][-10:, 0, -10:] = 60
    plots.preview(dataset, tmp_path / "a.png", tvg=None)
    image = matplotlib.image.imread(tmp_path / "a.png")[..., :3].sum(axis=2)
    box = image[90:-94, 88:-132]
    assert box[10, 10] > 2 and box[-10, 10] < 0.5 and box[10, -10] < 0.5


def test_levels_are_averaged_as_intensities():
    dataset = sidescan(4, 2000)
    dataset["level"][:] = np.where(np.arange(2000) % 2, 0, 10)
    laid = grid.make_grid(dataset)
    image = laid.mean(dataset, lambda part: 10 ** (part["level"].values / 10))
    assert image.shape[1] == grid.WIDEST
    assert 10 * np.log10(image.mean()) == pytest.approx(10 * np.log10(5.5), abs=1e-9)
    whole = dataset["level"].mean()
    assert abs(10 * np.log10(image.mean()) - whole) > 2  # the mean of the decibels is another number


def test_nan_bins_are_left_out_of_the_mean():
    dataset = sidescan(6, 1400)
    dataset["depth"][:] = np.where(np.arange(1400) % 2, np.nan, 7)
    image = grid.make_grid(dataset).mean(dataset, lambda part: part["depth"].values)
    np.testing.assert_allclose(image, 7)


def test_long_surveys_are_drawn_in_stretches(monkeypatch):
    dataset = sidescan(50, 30)
    laid = grid.make_grid(dataset)

    def both():
        return (laid.mean(dataset, lambda part: part["depth"].values),
                laid.largest(dataset, lambda part: part["label"].values))
    mean, largest = both()
    monkeypatch.setattr(grid, "LARGEST", 60 * 7)
    np.testing.assert_allclose(both()[0], mean, rtol=1e-12)
    np.testing.assert_array_equal(both()[1], largest)


def test_elements_are_square_on_the_ground_where_that_fits():
    square = grid.make_grid(sidescan(1000, 50, interval=0.05))
    assert square.stretch == pytest.approx(1, abs=0.01)
    short, long = (grid.make_grid(sidescan(pings, 50)) for pings in (20, 5000))
    assert short.stretch > 1.1 and short.height == grid.FLATTEST * short.width
    assert long.stretch < 0.9 and long.height == grid.TALLEST * long.width


def test_uneven_way_is_drawn_to_scale():
    """The second half of the pings is three times as fast, so it takes three quarters of the picture."""
    dataset = sidescan(41, 20)
    dataset["y"] = ("ping", np.r_[np.arange(20) * 1.0, 20 + 3.0 * np.arange(21)])
    dataset["rays"][:] = 0
    dataset["rays"][20:] = 1
    image = grid.make_grid(dataset).mean(dataset, lambda part: part["rays"].values)
    assert image[:, 0].mean() == pytest.approx(0.75, abs=0.02)


def test_rare_labels_stay_visible_in_large_surveys(tmp_path):
    dataset = sidescan(6000, 30)
    dataset["label"][:] = 1
    dataset["label"][3000, 1, 15] = 2
    plots.plot(dataset, "labels", tmp_path / "a.png")
    image = matplotlib.image.imread(tmp_path / "a.png")[90:-94, 88:, :3]
    blue = (image[..., 2] > 0.6) & (image[..., 0] < 0.3)
    assert blue[len(image) // 4:].sum() >= 20  # one ping of one bin; the legend lies above and beside


@pytest.mark.parametrize("count", [1, 60])
def test_the_legend_stands_beside_the_picture_and_on_the_sheet(count):
    sheet = grid.make_grid(sidescan(40, 20))
    keys = [Patch(label=f"number {k} of many") for k in range(count)]
    figure, axes = canvas.picture(sheet, np.zeros((sheet.height, sheet.width)), "title", keys=keys)
    legend, drawn, paper = axes.get_legend().get_window_extent(), axes.get_window_extent(), figure.bbox
    assert drawn.x1 < legend.x0 and legend.x1 < paper.x1 and paper.y0 < legend.y0 and legend.y1 < paper.y1
    assert drawn.width == pytest.approx(sheet.width)


def with_surface(level, pings=20):
    """A survey over 12 m of water, in which the sea surface echoes at 5 m with so many dB, above 52 dB of noise."""
    dataset = sidescan(pings, 300)
    at_surface = np.abs(dataset["range"] - 5) < 0.3
    for name in ("level", "mean_level"):
        dataset[name] = dataset[name].where(~at_surface, level).transpose("ping", "side", "range").astype(np.float32)
    return dataset.assign(seabed_depth=dataset["depth"].where(dataset["label"] == 1)).assign_attrs(noise_db=52.0)


def test_a_preview_shows_the_faint_echoes_of_the_water_column():
    """The surface at 90 dB, 55 dB under the bed, is brighter than the middle of the scale; the bed stays as it was."""
    dataset = with_surface(90.0)
    laid = grid.make_grid(dataset)
    image, (low, high), _, more_db = shown_levels(dataset, laid, "seabed")
    column_db = more_db["water column"]
    plain, limits, _, none = shown_levels(dataset.drop_vars("seabed_depth"), laid, "seabed")
    surface = np.abs(np.abs(np.linspace(*laid.across[[0, -1]], laid.width)) - 5) < 0.2
    assert 0 < column_db <= 100 and column_db % 5 == 0 and none == {}
    assert (image[:, surface] > 0.5 * (low + high)).all() and (plain[:, surface] < limits[0]).all()
    raised = image != plain
    np.testing.assert_allclose(image[raised] - plain[raised], column_db)
    assert not raised[:, np.abs(np.linspace(*laid.across[[0, -1]], laid.width)) > 12.3].any()


@pytest.mark.parametrize("level", [52.0, 15.0, 160.0])
def test_a_water_column_of_noise_or_of_strong_echoes_gets_no_gain(level):
    """As loud as the noise, fainter, or as bright as the bed: raised it would be grain, or no brighter."""
    dataset = with_surface(level)
    assert shown_levels(dataset, grid.make_grid(dataset), "seabed")[3] == {}


def test_black_and_white_are_the_beds_where_noise_fills_most_of_the_record():
    """12 of 17 m are water, and no mean level tells noise from echoes; the bed alone has the same limits."""
    whole = with_surface(52.0).drop_vars("mean_level").isel(range=slice(0, 68))
    whole = grid.with_sides(whole.isel(side=1, drop=True))
    bed = whole.isel(range=slice(49, None))
    limits = [shown_levels(dataset, grid.make_grid(dataset), "seabed")[1] for dataset in (whole, bed)]
    np.testing.assert_allclose(*limits, atol=1.0)


def drawn(dataset, monkeypatch, **options):
    """The figure that a preview saves."""
    figures = []
    monkeypatch.setattr(canvas, "save", lambda figure, path: figures.append(figure))
    plots.preview(dataset, "a.png", **options)
    figures[0].canvas.draw()
    return figures[0]


def test_the_gain_of_the_water_column_is_told(monkeypatch):
    words = [[text.get_text() for text in drawn(dataset, monkeypatch, tvg=tvg).texts] for dataset, tvg in
             ((with_surface(90.0), "seabed"), (with_surface(15.0), "seabed"), (with_surface(90.0), "recorder"))]
    assert any("water column + " in text for text in words[0])
    assert not any("water column" in text for text in [*words[1], *words[2]])       # recorders do not raise it


@pytest.mark.parametrize(("dataset", "scale"), [
    (sidescan(20, 50), "scale along track "), (sidescan(1000, 50, interval=0.05), "same scale along and across track"),
    (sidescan(5000, 50), "scale along track "), (sidescan(20, 50, speed=0.0), None)])
def test_scale_bars_stand_beside_the_picture_and_the_aspect_is_told(dataset, scale, monkeypatch):
    figure, laid = drawn(dataset, monkeypatch), grid.make_grid(dataset)
    axes = figure.axes[0]
    assert not axes.texts and len(axes.lines) == 1                 # of the data only the track's line is covered
    (bar,) = figure.artists
    parts = [part.get_window_extent() for part in (bar, *figure.texts)]
    for part in parts:
        assert not part.overlaps(axes.bbox) and figure.bbox.x0 <= part.x0 and part.x1 <= figure.bbox.x1
        assert figure.bbox.y0 <= part.y0 and part.y1 <= figure.bbox.y1
        assert not part.overlaps(axes.xaxis.label.get_window_extent())
    words = [text.get_text() for text in figure.texts]
    x, y = bar.get_transform().transform(np.array(bar.get_data()).T).T
    metre = laid.width / np.ptp(laid.across)
    assert f"{np.ptp(x) / metre:.3g} m" in words
    told = [text for text in words if "scale" in text]
    if scale is None:
        assert not told and np.ptp(y) == 0
    else:
        assert f"{np.ptp(y) / metre / laid.stretch:.3g} m" in words and told[0].startswith(scale)
        assert f"{laid.stretch:.3g} ×" in told[0] or abs(laid.stretch - 1) < 0.005


def test_gain_for_the_seabed_flattens_a_level_lambert_bed():
    dataset = sidescan(3, 200)
    gain, words = display_gain(dataset, "seabed")
    port = (dataset["mean_level"].values + gain[:, None])[0, 0]
    even = port[(dataset["range"].values > 12.5) & (dataset["range"].values < 20)]
    assert np.ptp(even) < 0.1 and words == " + 30 log R + 2αR − 20 log sin θ"


def test_a_recorders_gain_leaves_lamberts_law_in_the_picture():
    """20 log sin of the grazing angle: 6 dB for twice the range."""
    dataset = sidescan(3, 200)
    gain, words = display_gain(dataset, "recorder")
    level = (dataset["mean_level"].values + gain[:, None])[0, 0]
    near, far = (np.interp(r, dataset["range"].values, level) for r in (13.0, 19.0))
    assert near - far == pytest.approx(20 * np.log10(19 / 13), abs=0.1) and words == " + 30 log R + 2αR"


def test_gain_formulas():
    dataset = sidescan(3, 200).drop_vars("altitude")
    slant_range = dataset["range"].values
    for tvg, expected in (("target", 40 * np.log10(slant_range) + 0.06 * slant_range),
                          ("seabed", 30 * np.log10(slant_range) + 0.06 * slant_range),
                          ("recorder", 30 * np.log10(slant_range) + 0.06 * slant_range), (None, 0 * slant_range)):
        np.testing.assert_allclose(display_gain(dataset, tvg)[0], expected[None], rtol=1e-12)


@pytest.mark.parametrize(("length", "bar"), [(0.99, 0.5), (1, 1), (19.9, 10), (20, 20), (0.2, 0.2), (5000, 5000)])
def test_round_lengths(length, bar):
    assert canvas.round_length(length) == pytest.approx(bar)


@pytest.mark.parametrize(("dataset", "what", "name", "options", "kind", "words"), [
    (sidescan(2, 3), "picture", "a.png", {}, ValueError, "no plot 'picture'; choose one of waterfall, ping"),
    (sidescan(2, 3), "waterfall", "a.gif", {}, ValueError, r"end in \.png"),
    (sidescan(2, 3), "waterfall", "a", {}, ValueError, r"end in \.png"),
    (sidescan(2, 3), "waterfall", "missing/a.png", {}, FileNotFoundError, "folder .* does not exist"),
    (sidescan(2, 3), "waterfall", "a.png", {"tvg": "much"}, ValueError, "display gain is 'much'; use 'seabed'"),
    (sidescan(2, 3), "ping", "a.png", {"ping": 2}, ValueError, "no ping 2; there are 2"),
    (sidescan(2, 3).drop_vars("rays"), "rays", "a.png", {}, ValueError, "needs the variable 'rays'"),
    (sidescan(2, 3).isel(side=0), "waterfall", "a.png", {}, ValueError, "plots show a sidescan"),
    (sidescan(2, 3).isel(ping=[]), "mean", "a.png", {}, ValueError, "nothing to plot"),
])
def test_what_cannot_be_drawn_is_refused(dataset, what, name, options, kind, words, tmp_path):
    with pytest.raises(kind, match=words):
        plots.plot(dataset, what, tmp_path / name, **options)
    assert not list(tmp_path.iterdir())


def test_matplotlib_is_left_as_it_was():
    code = ("import sys, tempfile, matplotlib; before = matplotlib.rcParams.copy()\n"
            "from mitsonar import plots; from synthetic_sidescan import sidescan\n"
            "with tempfile.TemporaryDirectory() as folder: plots.preview(sidescan(3, 4), folder + '/a.png')\n"
            "assert matplotlib.rcParams.copy() == before and 'matplotlib.pyplot' not in sys.modules")
    subprocess.run([sys.executable, "-c", code], check=True, env={"PYTHONPATH": ":".join(filter(None, sys.path))})


def test_the_bed_below_the_sonar_is_not_black_where_lobes_leave_it_weak():
    """A lobe that falls by 12 dB from twice the altitude to nadir; the first return stays the brightest line of all."""
    dataset = sidescan(40, 400)
    slant_range = dataset["range"].values
    steep = np.clip(np.log2(24 / slant_range), 0, 1) * (slant_range > 12.0)
    change = 20 * np.log10(np.maximum(slant_range, 12) / 12) - 12 * steep + 4 * (np.abs(slant_range - 12.1) < 0.1)
    for name in ("level", "mean_level"):
        dataset[name] = dataset[name] + change
    laid = grid.make_grid(dataset)
    image, (low, high), _, more_db = shown_levels(dataset, laid, "recorder")
    across = np.abs(np.linspace(*laid.across[[0, -1]], laid.width))
    strip, abreast, first = (np.median(image[:, mine]) for mine in (
        (across > 12.4) & (across < 16), (across > 28) & (across < 36), np.abs(across - 12.1) < 0.08))
    assert list(more_db) == ["bed below the sonar up to"] and 4 < more_db["bed below the sonar up to"] <= 15
    assert abs(strip - abreast) < 3 and strip > low + 0.3 * (high - low) and first > strip + 2
    assert shown_levels(dataset, laid, "seabed")[3] == {}


def test_the_depth_is_that_of_what_is_seen(monkeypatch):
    """Echoes of the water column and of shadows have depths, which would stretch the colours from 5 to 90 m."""
    dataset = sidescan(20, 200)
    strange = dataset["depth"].isnull()
    dataset["seabed_depth"] = dataset["depth"]
    dataset["depth"] = dataset["depth"].where(~strange, np.where(np.arange(200) % 2, 5.0, 90.0))
    figures = []
    monkeypatch.setattr(canvas, "save", lambda figure, path: figures.append(figure))
    plots.plot(dataset, "depth", "a.png")
    low, high = figures[0].axes[0].images[0].get_clim()
    assert 16.9 < low < high < 20.6
