"""Datasets to OpenEXR and back: identical in every bit, the same bytes every time, whole files or none.

No tolerance anywhere: the file is a container, so equality is exact (NaN patterns included).
"""
import errno
import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import OpenEXR
import pytest
import xarray
from synthetic_sidescan import sidescan

from mitsonar.device import files
from mitsonar.io.records import exr

REPOSITORY = Path(__file__).resolve().parents[2]
INPUTS = REPOSITORY / "tests" / "inputs"


def forward_looking():
    """Two pings of three beams: float64 and text beside the image, a signed variable, one without the beams."""
    rng = np.random.default_rng(3)
    dims = ("ping", "beam", "range")
    return xarray.Dataset(
        {"level": (dims, rng.normal(size=(2, 3, 5)).astype(np.float32)),
         "count": (dims, rng.integers(-9, 9, (2, 3, 5)).astype(np.int16)),
         "flag": (("beam", "ping", "range"), rng.random((3, 2, 5)) > 0.5),
         "noise": ("ping", [1 / 3, np.nan]),
         "note": ("ping", ["calm", "rough µ"])},
        {"beam": ("beam", [-0.1, 0.0, 0.1], {"units": "rad"}), "range": ("range", np.arange(5) / 7),
         "start": ((), np.datetime64("2012-08-21T10:11:12.123456789", "ns"))},
        {"sonar": "forward_looking", "list": [1, 2.5, None, -np.inf], "nested": {"deep": {"largest": np.inf}}})


def narrow():
    """One ping, one bin, no side."""
    return xarray.Dataset({"level": (("ping", "range"), np.array([[-200.0]], np.float32))})


DATASETS = [sidescan(12, 40), sidescan(1, 1), forward_looking(), narrow()]


def same_bits(a, b):
    assert a.dtype == b.dtype and a.dims == b.dims and a.attrs.keys() == b.attrs.keys()
    assert a.values.tobytes() == b.values.tobytes()


@pytest.mark.parametrize("dataset", DATASETS, ids=["sidescan", "one bin", "forward_looking", "no side"])
def test_round_trip_is_identical(dataset, tmp_path):
    exr.write(dataset, tmp_path / "a.exr")
    back = exr.read(tmp_path / "a.exr")
    assert back.identical(dataset)
    assert list(back.variables) == list(dataset.variables)
    for name in dataset.variables:
        same_bits(back[name], dataset[name])


def test_odd_numbers_survive(tmp_path):
    dataset = sidescan(3, 4)
    dataset["level"].values.view(np.uint32)[0, 0] = [0x7FC12345, 0x80000000, 0x7F800000, 1]  # NaN, -0, inf, denormal
    dataset["rays"].values[0, 0] = 2**32 - 1
    dataset["y"] = dataset["y"].copy(data=[-0.0, 1e308, np.nextafter(1, 2)])
    exr.write(dataset, tmp_path / "a.exr")
    back = exr.read(tmp_path / "a.exr")
    for name in ("level", "rays", "y"):
        same_bits(back[name], dataset[name])


def test_views_and_the_dataset_itself_are_untouched(tmp_path):
    whole = sidescan(8, 20)
    part = whole.isel(ping=slice(1, None, 2), range=slice(None, None, -3))
    before = part.copy(deep=True)
    exr.write(part, tmp_path / "a.exr")
    assert exr.read(tmp_path / "a.exr").identical(before)
    xarray.testing.assert_identical(part, before)


def test_same_dataset_gives_same_bytes(tmp_path):
    for name in ("a.exr", "b.exr"):
        exr.write(sidescan(20, 50), tmp_path / name)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()


def test_any_reader_finds_the_picture_the_channels_and_the_words(tmp_path):
    dataset = sidescan(6, 10)
    exr.write(dataset, tmp_path / "a.exr")
    file = OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True)
    assert [part.name() for part in file.parts] == ["image", "data"]
    level = dataset["level"].values
    np.testing.assert_array_equal(file.channels(0)["Y"].pixels, np.c_[level[:, 0, ::-1], level[:, 1]])
    names = [f"{side}.{name}" for side in ("port", "starboard")
             for name in ("depth", "label.id", "level", "mean_level", "rays", "shadow")]
    assert sorted(file.channels(1)) == names
    np.testing.assert_array_equal(file.channels(1)["starboard.label.id"].pixels, dataset["label"].values[:, 1])
    assert file.channels(1)["port.label.id"].pixels.dtype == np.uint32
    header = file.header(0)
    assert header["mitsonar:seed"] == str(2**40 + 7) and header["mitsonar:sonar"] == "sidescan"
    assert header["mitsonar:units.Y"] == "dB re 1 µPa" and header["mitsonar:sound_speed"] == "1492.3 m/s"
    assert header["mitsonar:version"] == "0.1.0" and header["mitsonar:bin_width"] == "7.5 m"
    assert file.header(1)["mitsonar:units.depth"] == "m"


def test_mitsuba_reads_the_picture(tmp_path, two_threads):
    mi = pytest.importorskip("mitsuba")
    if mi.variant() is None:
        mi.set_variant("scalar_rgb")
    dataset = sidescan(6, 10)
    exr.write(dataset, tmp_path / "a.exr")
    picture = np.array(mi.Bitmap(str(tmp_path / "a.exr")))
    np.testing.assert_array_equal(picture.reshape(6, 20)[:, 10:], dataset["level"].values[:, 1])


@pytest.mark.parametrize(("change", "words"), [
    (lambda d: d.assign(odd=d.level.astype(complex)), "odd as EXR: its type is complex128"),
    (lambda d: d.drop_vars(["level", "mean_level", "depth"]), "none of its variables"),
    (lambda d: d.isel(ping=[]), "at least one row"),
    (lambda d: d.assign_attrs(a={"b": [object()]}), r"the dataset\.a\.b\[0\] as EXR: it is a object"),
    (lambda d: d.rename(depth="ф" * 130), "would have a name of 2.. bytes, and EXR cuts names beyond 255"),
    (lambda d: d.assign_attrs(a={1: 2}), "key 1 is not text"),
    (lambda d: d.assign(odd=("ping", np.array([None] * 3))), "odd as EXR: its type is object"),
])
def test_what_a_file_cannot_hold_is_refused_before_writing(change, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        exr.write(change(sidescan(3, 4)), tmp_path / "a.exr")
    assert not list(tmp_path.iterdir())


def test_files_that_are_not_ours_are_refused(tmp_path):
    with pytest.raises(FileNotFoundError, match="no such file"):
        exr.read(tmp_path / "missing.exr")
    with pytest.raises(ValueError, match="it is a folder"):
        exr.read(tmp_path)
    text = tmp_path / "text.exr"
    text.write_text("hello")
    with pytest.raises(ValueError, match="not an OpenEXR file"):
        exr.read(text)
    foreign = str(tmp_path / "foreign.exr")
    OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": np.zeros((2, 3), np.float32)}).write(foreign)
    with pytest.raises(ValueError, match="no attribute mitsonar:config"):
        exr.read(foreign)


@pytest.mark.parametrize("share", [0.2, 0.6, 0.99])
def test_a_file_cut_short_is_refused(share, tmp_path):
    path = tmp_path / "a.exr"
    exr.write(sidescan(40, 60), path)
    whole = path.read_bytes()
    path.write_bytes(whole[:int(share * len(whole))])
    with pytest.raises(ValueError, match="cut short"):
        exr.read(path)


@pytest.mark.parametrize(("name", "kind", "words"), [
    ("missing/a.exr", FileNotFoundError, "folder .*missing does not exist; make it first"),
    ("file/a.exr", ValueError, "is a file, not a folder"),
    ("folder", ValueError, "it is a folder"),
    ("pipe", ValueError, "a device or a pipe"),
    ("new/", ValueError, "names no file"),
])
def test_a_place_that_cannot_be_written_is_named_before_the_work(name, kind, words, tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    path = f"{tmp_path}/{name}"
    with pytest.raises(kind, match=words):
        files.check_writable(path)
    with pytest.raises(kind, match=words):
        exr.write(narrow(), path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder", "pipe"]


@pytest.mark.parametrize("failure", [KeyboardInterrupt, RuntimeError, SystemExit])
def test_a_failure_keeps_the_old_file_and_leaves_nothing(failure, tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(failure), files.replacing(path) as temporary:
        temporary.write_text("half")
        raise failure
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


def test_replacing_keeps_permissions_and_links(tmp_path):
    real, link = tmp_path / "real.txt", tmp_path / "link.txt"
    real.write_text("old")
    real.chmod(0o640)
    link.symlink_to(real)
    with files.replacing(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink() and real.read_text() == "new" and real.stat().st_mode & 0o777 == 0o640
    umask = os.umask(0o022)
    try:
        with files.replacing(tmp_path / "fresh.txt") as temporary:
            temporary.write_text("new")
    finally:
        os.umask(umask)
    assert (tmp_path / "fresh.txt").stat().st_mode & 0o777 == 0o644


def test_a_disk_that_fills_up_leaves_the_old_file_and_nothing_else(tmp_path):
    """A size limit on the files of a child process stands for the disk: any user may set one.

    The limits cut the file in its header, at several places in its pixels and just before its last byte.
    """
    path = tmp_path / "a.exr"
    exr.write(sidescan(60, 100), path)
    old, size = path.read_bytes(), path.stat().st_size
    code = textwrap.dedent("""
        import resource, signal, sys
        from synthetic_sidescan import sidescan
        from mitsonar.io import exr
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        dataset = sidescan(60, 100)
        for limit in map(int, sys.argv[2:]):
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
            try:
                exr.write(dataset, sys.argv[1])
            except OSError as error:
                print(error.errno, error)
    """)
    limits = [0, 100, 5000, size // 4, size // 2, size - 100, size - 1]
    done = subprocess.run([sys.executable, "-c", code, path, *map(str, limits)], capture_output=True, text=True,
                          check=True, env={**os.environ, "PYTHONPATH": f"{REPOSITORY}:{INPUTS}"})
    lines = done.stdout.splitlines()
    assert len(lines) == len(limits)
    for line in lines:
        assert line == (f"{errno.EFBIG} cannot write {path}: the file grew past the largest size allowed here; free "
                        "some space or choose another disk (nothing was left behind).")
    assert path.read_bytes() == old and list(tmp_path.iterdir()) == [path]


def test_a_full_disk_for_real(tmp_path):
    if os.geteuid() != 0 or subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "none", tmp_path],
                                           capture_output=True).returncode:
        pytest.skip("only root may mount a small disk to fill up")
    try:
        with pytest.raises(OSError, match="the disk is full") as caught:
            exr.write(sidescan(100, 200), tmp_path / "a.exr")
        assert caught.value.errno == errno.ENOSPC and not list(tmp_path.iterdir())
    finally:
        subprocess.run(["umount", tmp_path], check=True)
