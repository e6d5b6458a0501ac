"""`mitsonar.read` knows by its content any file that mitsonar wrote, and says what it is if it is none."""
import errno
import json
import os
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from raw_record import raw_record
from soundings_line import soundings_line
from synthetic_sidescan import sidescan

import mitsonar

ROOT = Path(__file__).resolve().parents[2]


def test_text_and_pictures(tmp_path):
    from mitsonar.labels.pictures import write_png

    (tmp_path / "annotations.json").write_text('{"images": []}\n')
    (tmp_path / "manifest.jsonl").write_text('{"index": 0}\n{"index": 1}\n')
    mask = np.arange(12, dtype=np.uint16).reshape(3, 4) * 5000
    write_png(mask, tmp_path / "mask.png")
    assert mitsonar.read(tmp_path / "annotations.json") == {"images": []}
    assert mitsonar.read(tmp_path / "manifest.jsonl") == [{"index": 0}, {"index": 1}]
    assert np.array_equal(mitsonar.read(tmp_path / "mask.png"), mask)


@pytest.mark.parametrize("name, content, sentence", [
    ("a.csv", b"a,b\n1,2\n", "it is no EXR, netCDF, JSON, PNG or survey line; give a file that"),
    ("empty", b"", "it is no EXR, netCDF, JSON, PNG or survey line"),
    ("a.json", b'{"a": ', "it is no JSON"),
    ("a.json", b"\xff\xfe", "it is no JSON"),
    ("a.json", b"[" * 100_000, "it is no JSON"),
    ("a.png", b"\x89PNG\r\n\x1a\n" + bytes(40), "the picture is damaged"),
    ("a.nc", b"\x89HDF\r\n\x1a\n" + bytes(40), "is no netCDF-4 file"),
    ("a.exr", b"\x76\x2f\x31\x01" + bytes(40), "is cut short"),
])
def test_other_files_are_refused(tmp_path, name, content, sentence):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=sentence):
        mitsonar.read(tmp_path / name)


def test_folders_that_are_no_records(tmp_path):
    with pytest.raises(ValueError, match="a folder, and not one of Zarr; give a file inside it"):
        mitsonar.read(tmp_path)
    with pytest.raises(FileNotFoundError):
        mitsonar.read(tmp_path / "none.nc")


def test_an_image_of_every_kind_of_attribute(tmp_path):
    from mitsonar.io.records.records import SonarImage

    image = SonarImage.of(sidescan(4, 6)).assign_attrs(none=None, yes=True, nested={"a": [1, None]}, empty=[])
    image.to_netcdf(tmp_path / "a.nc")
    assert json.dumps(mitsonar.read(tmp_path / "a.nc").attrs) == json.dumps(image.attrs)
    assert image.isel(ping=slice(2)).to_netcdf().tobytes()[:4] == b"\x89HDF"        # parts of it, and without a name


def test_a_recorded_line_goes_into_netcdf(tmp_path):
    mitsonar.write(soundings_line(pings=2), tmp_path / "line.gsf")
    line = mitsonar.read(tmp_path / "line.gsf")
    assert line.attrs["preset"] is None                                 # which xarray alone refuses
    line.to_netcdf(tmp_path / "line.nc")
    back = mitsonar.read(tmp_path / "line.nc")
    assert back["depth"].equals(line["depth"]) and back.attrs["preset"] is None


def test_json_that_no_memory_holds_is_refused(tmp_path):
    (tmp_path / "a.json").touch()
    os.truncate(tmp_path / "a.json", 50 * 10**9)           # sparse: it takes no room
    with pytest.raises(ValueError, match="a.json: it has 50,000,000,000 bytes, and JSON of at most 1,000,000,000"):
        mitsonar.read(tmp_path / "a.json")


def test_rooms_of_files_need_no_import_of_their_own():
    text = ("import mitsonar; print(mitsonar.io.exr.read.__name__, mitsonar.io.signals.write.__name__, "
            "sorted(set(dir(mitsonar.io)) & {'casts', 'exr', 'netcdf', 'signals', 'tracks'}))")
    said = subprocess.run([sys.executable, "-c", text], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    assert said == "read write ['casts', 'exr', 'netcdf', 'signals', 'tracks']\n"
    with pytest.raises(AttributeError, match="'mitsonar.io' has no attribute 'exrr'; it has .*exr"):
        _ = mitsonar.io.exrr


@pytest.mark.parametrize("error", [AttributeError("no attribute 'split'"), IndexError(), TypeError("no")])
def test_whatever_the_libraries_raise_of_a_damaged_file_is_a_sentence(tmp_path, monkeypatch, error):
    mitsonar.write(sidescan(2, 3), tmp_path / "a.nc")

    def damaged(*arguments, **options):
        raise error

    monkeypatch.setattr(xr, "open_dataset", damaged)
    with pytest.raises(ValueError, match=f"a.nc is no netCDF-4 file .* .{str(error) or 'IndexError'}.[.]"):
        mitsonar.read(tmp_path / "a.nc")


@pytest.mark.parametrize("name", ["a.exr", "a.nc", "a.h5", "a.zarr"])
def test_an_image_of_nan_alone_is_refused(tmp_path, name):
    image = sidescan(2, 3)
    image["level"] = image["level"] * np.nan
    if name == "a.zarr":
        pytest.importorskip("zarr")
        image.to_zarr(tmp_path / name)
    else:
        mitsonar.write(image, tmp_path / name)
    with pytest.raises(ValueError, match=f"cannot use .*{name}: all numbers of level are NaN"):
        mitsonar.read(tmp_path / name)


@pytest.mark.parametrize("kind", [h5py.ref_dtype, [("a", "f4"), ("b", "f4")], h5py.string_dtype()])
def test_levels_that_are_no_numbers_are_refused(tmp_path, kind):
    image = sidescan(2, 3)
    mitsonar.write(image, tmp_path / "a.nc")
    with h5py.File(tmp_path / "a.nc", "a") as file:
        del file["level"]
        file.create_dataset("level", image["level"].shape, kind)
    with pytest.raises(ValueError, match="cannot use .*a.nc: level holds .*, which is no number; write it again"):
        mitsonar.read(tmp_path / "a.nc")


def test_signals_and_raw_echoes_of_nan_alone_are_refused_and_a_gap_is_not(tmp_path):
    signals = xr.DataArray(np.full((2, 3), np.nan + 1j), dims=("ping", "sample"), name="signals")
    raw = raw_record()
    for record, name in ((signals, "signals"), (raw.assign(signal=raw["signal"] * np.nan), "signal")):
        mitsonar.write(record, tmp_path / "a.nc")
        with pytest.raises(ValueError, match=f"all numbers of {name} are NaN"):
            mitsonar.read(tmp_path / "a.nc")
    signals[1, 2] = 1
    mitsonar.write(signals, tmp_path / "b.nc")
    assert mitsonar.read(tmp_path / "b.nc").identical(signals)


@pytest.mark.parametrize("name, suffix", [("image", ".nc"), ("image", ".h5"), ("line", ".nc")])
def test_a_full_disk_is_said_and_ends_no_process(tmp_path, capfd, name, suffix):
    """Once the disk has filled up under HDF5, h5py ends the process where it closes the file a second time."""
    if os.geteuid() != 0 or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=24k", "none", tmp_path],
                                           capture_output=True).returncode:
        pytest.skip("only root may mount a small disk to fill up")
    try:
        with pytest.raises(OSError, match="the disk is full") as caught:
            mitsonar.write(sidescan(100, 200) if name == "image" else soundings_line(4, 24), tmp_path / f"a{suffix}")
        assert caught.value.errno == errno.ENOSPC and not list(tmp_path.iterdir())
        assert capfd.readouterr().err == ""
    finally:
        subprocess.run(["umount", tmp_path], check=True)
