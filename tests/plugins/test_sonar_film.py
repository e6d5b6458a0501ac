"""The film `sonar_film`: window and bins, exactly, and the picture it keeps for Mitsuba."""
import functools

import numpy as np
import pytest

C = 1500.0


@pytest.fixture
def film(make):
    """Make a film of attributes."""
    return functools.partial(make, "sonar_film")


def test_window_in_bins(film):
    assert film().window(C) == ((0.0, 200 / C), 800)
    assert film(range=75.0, range_min=15.0, bins=60).window(C) == ((30 / C, 150 / C), 60)


def test_window_follows_the_sonars_sound_speed(film):
    (start, end), bins = film(range=75.0, range_min=15.0, bins=60).window(C / 2)
    assert (start, end, bins) == (60 / C, 300 / C, 60)


@pytest.mark.parametrize("rate_khz, bins", [(10.0, 1334), (0.001, 1), (30.0, 4000)])
def test_window_in_samples_ends_with_a_whole_one(film, rate_khz, bins):
    (start, end), found = film(sample_rate_khz=rate_khz).window(C)
    assert (start, found) == (0, bins)
    assert end == pytest.approx(bins / (1000 * rate_khz), rel=1e-15) and end >= 200 / C * (1 - 1e-12)


@pytest.mark.parametrize("attributes, words", [
    ({"range": 0.0}, "range is the float 0.0; expected a number [m] above 0"),
    ({"range": 2e5}, "at most 100000"),
    ({"range_min": -1.0}, "range_min is the float -1.0"),
    ({"range_min": 100.0}, "range_min is 100.0 m, not below range 100.0 m; lower it"),
    ({"bins": 0}, "bins is the integer 0; expected an integer at least 1"),
    ({"bins": 1_000_001}, "at most 1000000"),
    ({"sample_rate_khz": 0.0}, "expected a number [kHz] above 0"),
    ({"bins": 9, "sample_rate_khz": 9.0}, "bins and sample_rate_khz are both given"),
    ({"width": 9}, 'unknown attribute "width"'),
])
def test_refusals(refusal, attributes, words):
    assert words in refusal("sonar_film", **attributes)


def test_too_many_samples(film):
    with pytest.raises(ValueError, match="sample_rate_khz is 8000, which makes 1.07e.06 bins of the range; lower it"):
        film(sample_rate_khz=8000.0).window(C)


def test_picture_for_mitsuba(film, tmp_path, two_threads):
    import mitsuba as mi

    made = film(bins=3)
    for ask in (made.develop, made.bitmap):
        with pytest.raises(ValueError, match="holds no image yet; render the scene first"):
            ask()
    image = mi.TensorXf(np.arange(12, dtype=np.float32).reshape(2, 6, 1))
    made.put(image)
    assert np.array_equal(made.develop(), image)
    assert np.array_equal(np.array(made.bitmap())[..., None], image)
    made.write(tmp_path / "o.exr")
    assert np.array_equal(np.array(mi.Bitmap(str(tmp_path / "o.exr")))[..., None], image)
    made.clear()
    assert made.image is None
