"""Pictures of focused images: every view, places and scales in metres, means of intensities and of phases, refusals."""
import numpy as np
import pytest
from focused_image import focused_image

from mitsonar import plots
from mitsonar.plots import canvas


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Draw a view and give its figure."""
    def draw(image, what=None, **options):
        figures = []
        monkeypatch.setattr(canvas, "save", lambda figure, path: figures.append(figure))
        plots.plot(image, what or plots.usual_plot(image), tmp_path / "a.png", **options)
        return figures[0]
    return draw


@pytest.mark.parametrize("what", [*plots.FOCUSED_VIEWS, "seabed_depth"])
def test_every_view_is_drawn_in_metres_of_one_scale(drawn, what):
    figure = drawn(focused_image(40, 60), what)
    axes = figure.axes[0]
    west, east, south, north = axes.images[0].get_extent()
    assert (west, east, south, north) == pytest.approx((9.975, 12.975, -0.025, 1.975))
    height, width = axes.images[0].get_array().shape
    assert width / (east - west) == pytest.approx(height / (north - south), rel=1e-3)
    assert axes.get_xlabel() == "across track [m]" and "up is 17°" in figure.texts[1].get_text()


def test_a_point_is_bright_at_its_place(drawn):
    picture = drawn(focused_image(40, 60)).axes[0].images[0]
    level = picture.get_array()
    row, column = np.unravel_index(np.argmax(level), level.shape)
    west, east, south, north = picture.get_extent()
    assert west + (column + 0.5) / level.shape[1] * (east - west) == pytest.approx(10 + 30 * 0.05, abs=0.05)
    assert south + (row + 0.5) / level.shape[0] * (north - south) == pytest.approx(20 * 0.05, abs=0.05)
    low, high = picture.get_clim()
    assert high - low == pytest.approx(50)


def test_elements_of_many_points_show_their_mean_intensity_and_phase(drawn):
    """4200 points in 1400 elements: levels 0, 0 and nothing are -1.76 dB, phases 3, -3 and 3 are 3.05."""
    image = focused_image(3, 4200)
    level, phase = np.zeros((3, 4200), np.float32), np.full((3, 4200), 3, np.float32)
    level[:, 2::3], phase[:, 1::3] = -np.inf, -3
    image["level"].values[0], image["phase"].values[:] = level, phase
    elements = np.asarray(drawn(image).axes[0].images[0].get_array())
    assert np.allclose(elements, 10 * np.log10(2 / 3), rtol=0, atol=1e-4)
    elements = np.asarray(drawn(image, "phase").axes[0].images[0].get_array())
    angle = np.angle(2 * np.exp(3j) + np.exp(-3j))
    assert np.allclose(elements, angle, rtol=0, atol=1e-4)


def test_a_bank_can_be_chosen(drawn):
    image = focused_image(20, 30)
    image["level"].values[1] -= 20
    first, second = (np.asarray(drawn(image, bank=bank).axes[0].images[0].get_array()) for bank in (0, 1))
    assert np.median(first - second) == pytest.approx(20, abs=2)
    assert "bank 1 of 2" in drawn(image, bank=1).texts[1].get_text()
    assert "bank" not in drawn(focused_image(banks=1)).texts[1].get_text()


@pytest.mark.parametrize("what, options, words", [
    ("imag", {}, "there is no plot 'imag' of a focused image .did you mean .image"),
    ("waterfall", {}, "choose one of image, phase, coherence"), ("image", {"bank": 2}, "there is no bank 2"),
    ("image", {"ping": 1}, "contains all its pings"), ("image", {"tvg": "seabed"}, "no gain over range"),
    ("phase", {"bank": 1}, "leave it out"), ("phase", {"colours": "grey"}, "leave them out"),
    ("image", {"colours": "red"}, "no colours 'red'")])
def test_what_is_not_there_is_refused(drawn, what, options, words):
    with pytest.raises(ValueError, match=words):
        drawn(focused_image(), what, **options)


def test_views_of_other_records_are_told_apart(drawn):
    from synthetic_sidescan import sidescan

    with pytest.raises(ValueError, match="the plot 'phase' needs the variable 'phase'; of this image there are image"):
        drawn(focused_image(banks=1), "phase")
    with pytest.raises(ValueError, match="needs the variable 'label'.* focus the scene itself"):
        drawn(focused_image().drop_vars("label"), "labels")
    with pytest.raises(ValueError, match="the plot 'height' is of a focused image"):
        drawn(sidescan(4, 8), "height")
    with pytest.raises(ValueError, match="only focused images have banks"):
        drawn(sidescan(4, 8), "waterfall", bank=0)


def test_north_is_0_degrees_from_either_side(drawn):
    for heading in (-1e-4, 0.0, 1e-4):
        assert "up is 0°" in drawn(focused_image(heading=heading)).texts[1].get_text()


def test_one_point_and_long_strips_are_drawn(drawn):
    assert drawn(focused_image(1, 1, banks=1)).axes
    assert drawn(focused_image(2000, 30, banks=1)).axes[0].images[0].get_array().shape[0] <= 4000


def test_words_above_a_narrow_strip_stay_on_the_paper(drawn):
    figure = drawn(focused_image(2000, 20, spacing=0.0123))
    figure.canvas.draw()
    assert all(text.get_window_extent().x1 <= figure.bbox.x1 for text in figure.texts)
