"""Mosaics of sidescan lines: where things lie, how swaths are blended, what is left empty, what is refused.

Lines are made by hand over a level bed: silence, a bed of one level, and a small object whose echo comes where and when
geometry says, 10 m below the sonar, weighted by a beam of 0.6 degrees.
"""
import numpy as np
import pytest
import xarray as xr

import mitsonar
from mitsonar.imaging import mosaic
from mitsonar.io.records import geotiff

UTM31, UTM32 = "EPSG:32631", "EPSG:32632"
ORIGIN = (512200.0, 5790240.0)
SPEED, SOUND = 2.0, 1500.0


def line(heading_deg=0.0, middle=(0.0, 0.0), *, pings=160, step=0.25, pitch_deg=0.0, altitude=10.0, bed=60.0,
         point=None, bins=400, bin_width=0.1, **attrs):
    """One straight line about its middle, over a bed of one level [dB]; `point` x, y of an object of 110 dB."""
    heading, pitch = np.deg2rad(heading_deg), np.deg2rad(pitch_deg)
    ahead, abeam = np.array([np.sin(heading), np.cos(heading)]), np.array([np.cos(heading), -np.sin(heading)])
    way = step * (np.arange(pings) - 0.5 * (pings - 1))
    position = np.array(middle) + way[:, None] * ahead
    slant = (np.arange(bins) + 0.5) * bin_width
    power = np.zeros((pings, 2, bins))
    power[:, :, slant > altitude] = 10 ** (bed / 10)
    label = np.where(power > 0, 1, 0)
    ground = np.sqrt(np.maximum(slant**2 - altitude**2 / np.cos(pitch)**2, 0))
    if point is not None:
        way_off = np.array(point) - position
        for _ in range(3):                                     # the sonar goes on while sound travels
            away = np.sqrt((way_off**2).sum(1) + altitude**2)
            way_off = np.array(point) - position - (SPEED * away / SOUND)[:, None] * ahead
        off = (way_off @ ahead - altitude * np.tan(pitch)) / away
        side, number = (way_off @ abeam > 0).astype(int), np.rint(away / bin_width - 0.5).astype(int)
        seen = number < bins
        shape = 10 ** 11 * np.exp(-(off / np.deg2rad(0.6)) ** 2)
        power[np.flatnonzero(seen), side[seen], number[seen]] += shape[seen]
        label[np.flatnonzero(seen), side[seen], number[seen]] = np.where(np.abs(off[seen]) < 0.01, 2, 1)
    sign = np.array([-1, 1])[None, :, None, None]
    place = position[:, None, None] + (altitude * np.tan(pitch)) * ahead + sign * ground[None, None, :, None] * abeam
    place = np.where((power > 0)[..., None], place, np.nan)
    dims = ("ping", "side", "range")
    with np.errstate(divide="ignore"):
        level = np.maximum(10 * np.log10(power), -200).astype(np.float32)
    each = {"ping_time": np.arange(pings) * step / SPEED, "x": position[:, 0], "y": position[:, 1],
            "heading": np.full(pings, heading), "pitch": np.full(pings, pitch), "altitude": np.full(pings, altitude)}
    return xr.Dataset(
        {"level": (dims, level, {"units": "dB re 1 µPa"}), "label": (dims, label.astype(np.uint32)),
         "seabed_x": (dims, place[..., 0]), "seabed_y": (dims, place[..., 1]),
         "depth": (dims, np.full(power.shape, 20.0))},
        {"ping": np.arange(pings), "side": ["port", "starboard"], "range": slant,
         **{name: ("ping", values) for name, values in each.items()}},
        {"sound_speed": SOUND, "absorption_db": 0.1, "crs": UTM31, "local_origin": list(ORIGIN), **attrs})


def at(chart, x, y, name="level"):
    """The value of a map at a place of the scene."""
    return chart[name].sel(x=ORIGIN[0] + x, y=ORIGIN[1] + y, method="nearest").item()


def brightest(raster):
    """Place of the brightest of a raster's pixels, weighted by power about it."""
    power = np.nan_to_num(10 ** (raster.read(1).astype(float) / 10))
    row, column = np.unravel_index(power.argmax(), power.shape)
    near = np.mgrid[max(row - 3, 0):row + 4, max(column - 3, 0):column + 4].reshape(2, -1)
    weight = power[near[0], near[1]]
    rows, columns = (near * weight).sum(1) / weight.sum()
    return raster.xy(rows, columns)


@pytest.mark.parametrize("place", ["flat", "truth"])
@pytest.mark.parametrize("heading, pitch", [(0, 0), (37, 3), (90, 0), (215, -2), (300, 0)])
@pytest.mark.parametrize("along, across", [(7.3, 19.1), (-11.4, -13.2)])
def test_a_small_object_lies_at_its_coordinates_to_half_a_pixel(tmp_path, place, heading, pitch, along, across):
    import rasterio

    turn = np.deg2rad(heading)
    point = (along * np.sin(turn) + across * np.cos(turn), along * np.cos(turn) - across * np.sin(turn))
    chart = mosaic(line(heading, pitch_deg=pitch, point=point), 0.25, place=place, gain=None)
    geotiff.write(chart, tmp_path / "a.tif")
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert raster.crs.to_epsg() == 32631 and raster.res == (0.25, 0.25)
        assert np.array(brightest(raster)) - ORIGIN == pytest.approx(point, abs=0.125)


def test_another_coordinate_system_moves_all_to_where_it_is_there(tmp_path):
    import rasterio
    from pyproj import Transformer

    chart = mosaic(line(37, point=(17.3, -6.1)), 0.25, crs=UTM32, gain=None)
    geotiff.write(chart, tmp_path / "a.tif")
    expected = Transformer.from_crs(UTM31, UTM32, always_xy=True).transform(ORIGIN[0] + 17.3, ORIGIN[1] - 6.1)
    with rasterio.open(tmp_path / "a.tif") as raster:
        assert raster.crs.to_epsg() == 32632 and brightest(raster) == pytest.approx(expected, abs=0.125)


@pytest.mark.parametrize("heading", [0, 28, 90])
def test_an_even_bed_is_even_and_without_holes_down_to_nadir(heading):
    chart = mosaic(line(heading), 0.25, gain=None)
    x, y = np.meshgrid(chart["x"].values - ORIGIN[0], chart["y"].values - ORIGIN[1])
    turn = np.deg2rad(heading)
    along, across = x * np.sin(turn) + y * np.cos(turn), x * np.cos(turn) - y * np.sin(turn)
    inside = (np.abs(along) < 19.5) & (np.abs(across) < np.sqrt(40**2 - 10**2) - 0.5)
    outside = (np.abs(along) > 20.5) | (np.abs(across) > np.sqrt(40**2 - 10**2) + 0.5)
    np.testing.assert_allclose(chart["level"].values[inside], 60, atol=1e-3)         # the water column is not in it
    assert np.isnan(chart["level"].values[outside]).all() and inside.sum() > 40_000
    assert chart["level"].dtype == np.float32 and chart.attrs["crs"] == UTM31


def test_cells_are_means_of_powers():
    one = line(bin_width=0.05, bins=600)
    level = one["level"].values.copy()
    level[:, :, 1::2] = np.where(level[:, :, 1::2] > 0, 70, -200)                   # every other bin 10 dB more
    chart = mosaic(one.assign(level=(one["level"].dims, level)), 2.0, gain=None)
    far = chart["level"].values[:, np.abs(chart["x"].values - ORIGIN[0]) > 15]
    assert far[2:-2] == pytest.approx(10 * np.log10((1e6 + 1e7) / 2), abs=0.5)


def test_where_swaths_overlap_the_blend_decides():
    lines = [line(middle=(-15, 0), bed=60), line(middle=(15, 0), bed=80)]
    nearest, feather, mean = (mosaic(lines, 0.5, gain=None, blend=blend) for blend in ("nearest", "feather", "mean"))
    for x, powers in ((-8, (1e6, 1e8)), (8, (1e8, 1e6))):
        assert at(nearest, x, 0) == pytest.approx(10 * np.log10(powers[0]), abs=0.01)
        assert at(mean, x, 0) == pytest.approx(10 * np.log10(sum(powers) / 2), abs=0.5)
        weights = 1 - np.array([7, 23]) / 40
        assert at(feather, x, 0) == pytest.approx(10 * np.log10(np.average(powers, weights=weights)), abs=0.5)
    assert at(mean, -40, 0) == pytest.approx(60, abs=0.01) and mean.attrs["blend"] == "mean"


def test_one_record_that_turns_back_is_blended_like_two():
    there, back = line(0, middle=(-15, 0), bed=60), line(180, middle=(15, 0), bed=80)
    back = back.assign_coords(ping_time=back["ping_time"] + 60)
    chart = mosaic(xr.concat([there, back], "ping"), 0.5, gain=None)
    assert at(chart, -5, 3) == pytest.approx(60, abs=0.01) and at(chart, 5, 3) == pytest.approx(80, abs=0.01)


def test_labels_are_not_mixed():
    lines = [line(middle=(-15, 0), point=(-5.1, 3.1)), line(middle=(15, 0))]
    chart = mosaic(lines, 0.25, quantity="label", blend="mean")
    values = chart["label"].values
    assert values.dtype == np.uint32 and set(np.unique(values)) <= {0, 1, 2, chart["label"].attrs["nodata"]}
    assert at(chart, -5.1, 3.1, "label") == 2 and at(chart, -5.1, 8, "label") == 1
    assert chart.attrs["blend"] == "nearest" and chart.attrs["gain"] is None
    assert mosaic(line(), 0.5, quantity="depth")["depth"].values[20, 100] == 20


def test_a_single_ping_is_a_line_across():
    chart = mosaic(line(pings=1), 0.25, gain=None)
    assert chart.sizes["y"] <= 2 and np.nanmax(chart["level"]) == pytest.approx(60, abs=1e-3)
    assert np.isfinite(chart["level"].values).any(0).mean() > 0.99


def test_holes_wider_than_fill_stay_open():
    kept = np.r_[0:60, 100:160]                                  # 10 m are missing
    holed = line().isel(ping=kept)
    assert np.isnan(at(mosaic(holed, 0.25), 20, 0)) and mosaic(holed, 0.25).attrs["fill"] == 1
    filled = mosaic(holed, 0.25, gain=None, fill=12)
    assert at(filled, 20, 0) == pytest.approx(60, abs=1e-3)
    sparse = mosaic(line(step=2.0, pings=20), 0.25, fill=1.0)    # pings stand alone
    assert np.isfinite(sparse["level"].values[:, sparse.sizes["x"] // 4]).mean() < 0.3


def test_nadir_can_be_left_out():
    chart = mosaic(line(), 0.25, nadir_deg=45, gain=None)
    assert np.isnan(at(chart, 9.5, 0)) and at(chart, 10.5, 0) == pytest.approx(60, abs=1e-3)
    assert np.isnan(at(chart, -9.5, 0)) and np.isfinite(at(mosaic(line(), 0.25), 0.1, 0))


def test_gain_over_range_and_by_angle():
    one = line()
    slant = one["range"].values
    fallen = one["level"] - xr.DataArray(30 * np.log10(slant) + 0.2 * slant - 20 * np.log10(np.minimum(10 / slant, 1)),
                                         dims="range")
    patterned = fallen - 12 * np.cos(xr.DataArray(slant, dims="range") / 4) ** 2
    even = mosaic(one.assign(level=fallen), 0.5)["level"].values[10:-10]
    assert np.nanmax(even) - np.nanmin(even) < 0.05 and np.nanmedian(even) == pytest.approx(60, abs=0.05)
    plain, angle = (mosaic(one.assign(level=patterned), 0.5, gain=gain)["level"].values[10:-10]
                    for gain in ("seabed", "angle"))
    assert np.nanstd(plain) > 3 and np.nanstd(angle) < 0.6


def test_cells_are_as_long_as_a_bin_or_the_way_between_pings():
    assert mosaic(line())["level"].attrs["units"] == "dB re 1 µPa"
    assert mosaic(line()).attrs["cell"] == 0.25 and mosaic(line(step=0.03)).attrs["cell"] == 0.1
    assert mosaic(line(step=0.26)).attrs["cell"] == 0.3


def test_a_record_without_a_coordinate_system_is_taken_to_be_in_the_one_that_is_given(tmp_path):
    import rasterio

    bare = line(crs=None, local_origin=None)
    for crs, expected in ((None, None), (UTM31, 32631)):
        chart = mosaic(bare, 0.5, crs=crs)
        geotiff.write(chart, tmp_path / "a.tif")
        with rasterio.open(tmp_path / "a.tif") as raster:
            assert (raster.crs.to_epsg() if raster.crs else None) == expected
            assert raster.bounds.left == pytest.approx(-38.7, abs=0.5)


@pytest.mark.parametrize("change, options, words", [
    (lambda r: [], {}, "no record"), (lambda r: r, {"blend": "last"}, "blend is 'last'"),
    (lambda r: r, {"place": "sphere"}, "place is 'sphere'"), (lambda r: r, {"gain": "loud"}, "gain is 'loud'"),
    (lambda r: r, {"quantity": "labels"}, "no variable 'labels'"), (lambda r: r, {"cell": 1e-5}, "take cells of"),
    (lambda r: r, {"cell": -1.0}, "above 0"), (lambda r: r, {"fill": np.nan}, "0 or more"),
    (lambda r: r, {"nadir_deg": 90}, "below 90"), (lambda r: r, {"crs": "EPSG:4326"}, "in degree"),
    (lambda r: r, {"crs": "EPSG:2263"}, "in US survey foot"), (lambda r: r.drop_vars("level"), {}, "made of sidescans"),
    (lambda r: r.drop_vars("altitude"), {}, "has no altitude"),
    (lambda r: r.drop_vars("seabed_x"), {"place": "truth"}, "has no seabed_x"),
    (lambda r: r.assign_attrs(sound_speed="fast"), {}, "sound_speed is 'fast'"),
    (lambda r: r.isel(side=[1, 0]), {}, "sides are starboard, port"), (lambda r: r.isel(range=[0]), {}, "even steps"),
    (lambda r: r.isel(ping=[]), {}, "no pings"), (lambda r: r.isel(ping=[2, 1, 0]), {}, "one after the other"),
    (lambda r: r.assign(level=r["level"] + 1e3), {}, "beyond any sound"),
    (lambda r: r.assign_attrs(absorption_db="much"), {}, "absorption_db is 'much'"),
    (lambda r: r.assign_coords(x=r["x"] * np.nan), {}, "not finite"),
    (lambda r: r.assign_coords(altitude=r["altitude"] * np.nan), {}, "no bin of the records has a place"),
    (lambda r: r.assign_coords(x=r["x"] + 1e7 * (r["ping"] > 80)), {}, "take cells of"),
    (lambda r: [r, r.assign_attrs(crs=None)], {}, "only some of the records"),
    (lambda r: [r.assign_attrs(labels={"1": "bed"}), r], {"quantity": "label"}, "have different labels"),
    (lambda r: [r.assign_attrs(frequency=100e3), r.assign_attrs(frequency=400e3)], {}, "100 kHz and 400 kHz"),
    (lambda r: [r, r.assign(label=r["label"].astype(np.uint8))], {"quantity": "label"}, "different types")])
def test_what_cannot_be_laid_out_is_refused(change, options, words):
    with pytest.raises(ValueError, match=words):
        mosaic(change(line(pings=100)), **options)


def test_maps_are_kept_as_netcdf_with_what_their_numbers_mean(tmp_path):
    chart = mosaic(line(labels={"1": "seabed"}), 0.5, quantity="label")
    mitsonar.write(chart, tmp_path / "map.nc")
    assert mitsonar.read(tmp_path / "map.nc").identical(chart)
