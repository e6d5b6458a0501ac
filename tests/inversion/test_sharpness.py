"""Sway from sharpness: L and its gradient, what it cannot see, and images of single pings by the house's focusing."""
import numpy as np
import pytest

from mitsonar.synthetic_aperture.focusing.grids import ground_grid

WAVELENGTH, PINGS = 0.015, 24


def points(rng, count=14, sway=None, finer=1):
    """Images of pings of a straight way past points on the ground, of a sonar that was swayed unknown to them."""
    from mitsonar.inversion.arrays.ping_images import PingImages
    grid = ground_grid((-1.0, 1.0), (19.0, 21.0), (0.05 / finer, 0.05), 10.0)
    along = 0.12 * (np.arange(PINGS) - (PINGS - 1) / 2)
    sonar = np.stack([0 * along, along, 0 * along], 1)
    place = np.stack([grid.x.ravel(), grid.y.ravel(), np.full(grid.depth.size, -10.0)], 1)
    targets = place[rng.choice(len(place), count, replace=False)]
    strength = np.exp(2j * np.pi * rng.random(count))
    sway = np.zeros(PINGS) if sway is None else sway

    def slant(points, moved):
        return np.linalg.norm(points - (sonar + moved[:, None] * [1, 0, 0])[:, None], axis=2)

    there, true = slant(place, np.zeros(PINGS)), slant(targets, sway)
    images = np.zeros((PINGS, len(place)), complex)
    for k, value in enumerate(strength):
        apart = there - true[:, k, None]
        images += value * np.exp(-0.5 * (apart / 0.04) ** 2 + 4j * np.pi / WAVELENGTH * apart)
    rates = -4 * np.pi / WAVELENGTH * place[:, 0] / there
    return PingImages(images=images.astype(np.complex64), rates=rates.astype(np.float32),
                      points=np.arange(len(place)), grid=grid, time=np.arange(PINGS) / 10, along=along), targets


def test_gradient_of_sharpness_agrees_with_differences(rng):
    from mitsonar.inversion.arrays.sharpness import sharpness
    pings, _ = points(rng)
    sway = 1e-3 * rng.standard_normal(PINGS)
    _, gradient = sharpness(pings, sway)
    for _ in range(3):
        step = 2e-5 * rng.standard_normal(PINGS)
        change = 0.5 * (sharpness(pings, sway + step)[0] - sharpness(pings, sway - step)[0])
        assert gradient @ step == pytest.approx(change, rel=5e-3, abs=1e-3 * np.linalg.norm(gradient) * 1e-4)


def test_sway_is_found_but_for_shift_and_trend(rng):
    """3 mm of smooth sway, a fifth of a wavelength, to a twentieth; the points' phases alone tell it as well."""
    from mitsonar.inversion.arrays.sharpness import _curvature, _sharpest, sway_of_targets, without_trend
    sway = np.exp(-0.5 * ((np.arange(PINGS)[:, None] - np.arange(PINGS)) / 3) ** 2) @ rng.standard_normal(PINGS)
    along = np.arange(PINGS)
    sway = without_trend(sway, along)
    sway *= 3e-3 / sway.std()
    pings, targets = points(rng, sway=sway)
    found = _sharpest(pings, 3.0)
    found = without_trend(np.unwrap(found, period=pings.period), along)
    assert (found - sway).std() < 0.05 * sway.std()
    # on points that stand closer than the image is fine
    still, _ = points(rng, count=5, finer=4)
    values, patterns = _curvature(still)
    line = np.linalg.qr(np.stack([np.ones(PINGS), along], 1))[0]
    # shift and trend, in the two directions of the least curvature
    assert np.linalg.norm(patterns[np.argsort(np.abs(values))[:2]] @ line) > 0.95 * np.sqrt(2)
    alone, (target, *_) = points(rng, count=1, sway=sway)
    row, column = (int(np.argmin(np.abs(axis - at))) for axis, at in
                   ((alone.grid.along_track, target[1]), (alone.grid.across_track, target[0])))
    assert (sway_of_targets(alone, np.array([[row, column]])) - sway).std() < 0.05 * sway.std()


def test_images_of_pings_add_up_to_the_focused_one_and_turn_as_the_trajectory_moves(variant, tmp_path):
    from small_strip import TEXT

    import mitsonar
    from mitsonar.inversion.arrays.ping_images import PingImages, moved
    path = tmp_path / "strip.xml"
    path.write_text(TEXT)
    raw = mitsonar.raw_echoes(path)
    grid = ground_grid((0.0, 0.6), (17.6, 18.4), (0.05, 0.05), 20.2)
    pings = PingImages.of(raw, grid, window=None)
    focused = mitsonar.focus(raw, grid, window="none")["image"].values[0]
    whole = pings.image(np.zeros(4)) / 10 ** (raw.attrs["source_level_db"] / 20)
    assert np.linalg.norm(whole - focused) < 1e-4 * np.linalg.norm(focused)
    sway = np.array([2.0e-4, 2.2e-4, 2.4e-4, 2.6e-4])
    turned = pings.turned(sway)
    again = PingImages.of(raw, grid, moved(raw, raw["ping_time"].values, sway), window=None)
    change, wanted = turned - pings.images, again.images - pings.images
    # receivers hear when the sway is that of a part of a ping later
    assert np.linalg.norm(change - wanted) < 0.06 * np.linalg.norm(wanted)


def test_what_cannot_be_is_refused(variant, tmp_path, rng):
    from raw_record import raw_record

    from mitsonar.inversion.arrays.ping_images import PingImages
    from mitsonar.inversion.arrays.sharpness import sharpened, sway_of_targets
    raw = raw_record()
    with pytest.raises(ValueError, match="at least three pings, got 2"):
        sharpened(raw.isel(ping=slice(2)))
    with pytest.raises(ValueError, match="correlation is -1"):
        sharpened(raw, correlation=-1)
    with pytest.raises(ValueError, match="lay a smaller grid"):
        PingImages.of(raw, ground_grid((0.0, 60.0), (0.0, 60.0), (0.01, 0.01), 10.0))
    pings, _ = points(rng)
    with pytest.raises(ValueError, match="target 0 lies where no ping sees"):
        sway_of_targets(pings.part(np.arange(5)), np.array([[30, 30]]))
