"""Files of raw echoes: written ping by ping, taken up again where that ended, read ping by ping, refused if they lie.

No tolerance: files are containers, so values are the same bit for bit.
"""
import fcntl
import os
import subprocess
import sys
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr
from raw_record import one_by_one, raw_record

import mitsonar
from mitsonar.io.records import ping_file, raw_echoes
from mitsonar.io.records.records import encoded

ROOT = Path(__file__).resolve().parents[2]


def same(one, other):
    """Whether two records are alike bit for bit, NaN and signs of zero among it."""
    assert set(one.variables) == set(other.variables) and one.attrs == other.attrs
    for name in other.variables:
        assert one[name].dims == other[name].dims and one[name].attrs == other[name].attrs
        if other[name].dtype.kind == "U":
            assert one[name].values.tolist() == other[name].values.tolist()
        else:
            assert one[name].dtype == other[name].dtype and one[name].values.tobytes() == other[name].values.tobytes()
    return True


def stopped(folder, record, pings, name="a.nc"):
    """Write so many pings and be interrupted."""
    def breaking(start):
        yield from one_by_one(record, pings)(start)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        raw_echoes.write(breaking, folder / name, count=record.sizes["ping"])


def test_what_is_written_ping_by_ping_comes_back(tmp_path):
    record, told = raw_record(), []
    raw_echoes.write(one_by_one(record), tmp_path / "a.nc", count=5, progress=lambda *step: told.append(step))
    assert told == [(number, 5) for number in range(1, 6)] and os.listdir(tmp_path) == ["a.nc"]
    assert same(mitsonar.read(tmp_path / "a.nc"), record) and same(raw_echoes.read(tmp_path / "a.nc"), record)
    with raw_echoes.opened(tmp_path / "a.nc") as lazy:
        assert not lazy["signal"].variable._in_memory
        found = list(raw_echoes.pings(lazy))
        assert not lazy["signal"].variable._in_memory
    assert same(xr.concat(found, "ping", data_vars="minimal", coords="minimal", compat="override"), record)


def test_other_programs_find_plain_numbers_in_order(tmp_path):
    record = raw_record()
    raw_echoes.write(one_by_one(record), tmp_path / "a.nc", count=5)
    with h5py.File(tmp_path / "a.nc") as file:
        assert np.array_equal(file["signal_imag"][3], record["signal"].values[3].imag)
        place = file["signal_real"].id.get_offset()                    # who wants maps it
    mapped = np.memmap(tmp_path / "a.nc", np.float32, "r", place, record["signal"].shape)
    assert np.array_equal(mapped, record["signal"].values.real, equal_nan=True)
    with xr.open_dataset(tmp_path / "a.nc", engine="h5netcdf") as plain:
        assert plain["signal_real"].dims == ("ping", "rx", "sample") and plain["signal_real"].attrs["units"] == "µPa"


@pytest.mark.parametrize("pings", [0, 1, 3, 5])
def test_an_interrupted_file_goes_on_and_has_the_same_bytes(tmp_path, pings):
    record, asked = raw_record(), []
    raw_echoes.write(one_by_one(record), tmp_path / "whole.nc", count=5)
    if pings:
        stopped(tmp_path, record, pings)
        assert sorted(os.listdir(tmp_path)) == ["a.nc.part", "whole.nc"]
    assert raw_echoes.written(tmp_path / "a.nc") == pings

    def counted(start):
        asked.append(start)
        return one_by_one(record)(start)

    assert raw_echoes.write(counted, tmp_path / "a.nc", count=5) == asked[0] == min(pings, 4)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "whole.nc").read_bytes()
    assert sorted(os.listdir(tmp_path)) == ["a.nc", "whole.nc"]


def test_a_process_that_is_killed_while_it_writes_leaves_whole_pings(tmp_path):
    record = raw_record(samples=400)
    code = f"""if True:
        import os, signal, sys
        sys.path.insert(0, {str(ROOT / "tests" / "inputs")!r})
        from raw_record import one_by_one, raw_record
        from mitsonar.io.records import ping_file, raw_echoes
        record = raw_record(samples=400)
        flush = ping_file.PingFile._to_disk
        def die(file):                                 # after the numbers of the third ping, before its count
            flush(file)
            if file.written == 2:
                os.kill(os.getpid(), signal.SIGKILL)
        ping_file.PingFile._to_disk = die
        raw_echoes.write(one_by_one(record), {str(tmp_path / "a.nc")!r}, count=5)"""
    ended = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert ended.returncode == -9, ended.stderr
    with raw_echoes.opened(tmp_path / "a.nc.part", unfinished=True) as lazy:
        assert same(lazy.load(), record.isel(ping=slice(0, 2)))
    with pytest.raises(ValueError, match="a.nc.part is not finished: it has 2 of 5 pings"):
        mitsonar.read(tmp_path / "a.nc.part")
    assert raw_echoes.write(one_by_one(record), tmp_path / "a.nc", count=5) == 2
    assert same(mitsonar.read(tmp_path / "a.nc"), record)


@pytest.mark.parametrize("change, words", [
    (lambda record: record.assign_attrs(seed=7), r"begun with another seed \(0, and here 7\)"),
    (lambda record: record.assign_attrs(parameters={"a": "2"}), r"begun with other parameters \(a=1, and here a=2\)"),
    (lambda record: record.assign(motion_x=record["motion_x"] + 1), "begun with another scene"),
    (lambda record: xr.concat([record] * 2, "ping", data_vars="minimal"), "is of 5 pings, and these echoes have 10")])
def test_other_echoes_do_not_go_on_with_a_file(tmp_path, change, words):
    stopped(tmp_path, raw_record(), 2)
    before = (tmp_path / "a.nc.part").read_bytes()
    other = change(raw_record())
    with pytest.raises(ValueError, match=f"a.nc.part .*{words}"):
        raw_echoes.write(one_by_one(other), tmp_path / "a.nc", count=other.sizes["ping"])
    assert (tmp_path / "a.nc.part").read_bytes() == before


def test_memory_does_not_grow_with_the_pings(tmp_path):
    """A ping is 128 kB; 30 of them are 3.8 MB, of which no half may be held at once."""
    one = raw_record(1, 8, 2000)

    def many(pings):
        return lambda start: (one for _ in range(start, pings))

    raw_echoes.write(many(1), tmp_path / "few.nc", count=1)            # what is loaded at first use is not counted
    tracemalloc.start()
    raw_echoes.write(many(30), tmp_path / "a.nc", count=30)
    with raw_echoes.opened(tmp_path / "a.nc") as lazy:
        assert sum(ping["signal"].size for ping in raw_echoes.pings(lazy)) == 30 * 16000
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 1_500_000


def test_a_file_that_another_program_writes_is_left_alone(tmp_path):
    record = raw_record()
    stopped(tmp_path, record, 2)
    with open(tmp_path / "a.nc.part", "rb") as stream:
        fcntl.flock(stream, fcntl.LOCK_EX)             # as HDF5 does where it writes
        with pytest.raises(ValueError, match="a.nc.part is being written by another program"):
            raw_echoes.write(one_by_one(record), tmp_path / "a.nc", count=5)
    assert raw_echoes.written(tmp_path / "a.nc") == 2


def test_a_disk_without_room_is_told_before_the_first_ping(tmp_path, monkeypatch):
    import shutil

    monkeypatch.setattr(shutil, "disk_usage", lambda _: shutil._ntuple_diskusage(10, 10, 1000))
    with pytest.raises(OSError, match="5 pings take .* GB, and the disk has 1e-06 GB left"):
        raw_echoes.write(one_by_one(raw_record()), tmp_path / "a.nc", count=5)
    assert not os.listdir(tmp_path)


def test_a_disk_that_fills_up_keeps_whole_pings(tmp_path, monkeypatch):
    import errno

    from mitsonar.io.records import ping_file

    flush = ping_file.PingFile._to_disk

    def full(file):
        if file.written == 3:
            raise OSError(errno.ENOSPC, "No space left on device")
        flush(file)

    monkeypatch.setattr(ping_file.PingFile, "_to_disk", full)
    with pytest.raises(OSError, match="cannot write ping 3: the disk is full; .*a.nc.part keeps the pings before it"):
        raw_echoes.write(one_by_one(raw_record()), tmp_path / "a.nc", count=5)
    assert raw_echoes.written(tmp_path / "a.nc") == 3


def test_too_few_and_too_many_pings_and_unlike_ones_are_refused(tmp_path):
    record = raw_record()
    for count, end, words in ((6, 5, "6 pings were announced, and there were 5"), (4, 5, "more pings than the 4"),
                              (5, 0, "there is no ping 0"), (0, 5, "at least one ping")):
        with pytest.raises(ValueError, match=words):
            raw_echoes.write(one_by_one(record, end), tmp_path / f"{count}.nc", count=count)

    def unlike(start):
        yield from one_by_one(record, 2)(start)
        yield raw_record(1, 4, 60)

    with pytest.raises(ValueError, match=r"signal_real of ping 2 is float32 \(4, 60\), and the file has room for"):
        raw_echoes.write(unlike, tmp_path / "a.nc", count=5)
    with pytest.raises(ValueError, match="attribute sonar .* is missing"):
        raw_echoes.write(one_by_one(record.drop_attrs()), tmp_path / "b.nc", count=5)


def test_files_that_are_cut_lie_or_hold_something_else_are_refused(tmp_path):
    record = raw_record()
    raw_echoes.write(one_by_one(record), tmp_path / "a.nc", count=5)
    whole = (tmp_path / "a.nc").read_bytes()
    for length in (0, 100, len(whole) // 2, len(whole) - 1):
        (tmp_path / "cut.nc").write_bytes(whole[:length])
        with pytest.raises(ValueError, match="cut.nc is no netCDF-4 file"):
            raw_echoes.read(tmp_path / "cut.nc")
    with h5py.File(tmp_path / "a.nc", "r+") as file:
        file["pings_written"][()] = 9
    with pytest.raises(ValueError, match="its pings_written is no number of its 5 pings"):
        raw_echoes.read(tmp_path / "a.nc")
    xr.Dataset({"level": ("y", [1.0])}).to_netcdf(tmp_path / "b.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match="b.nc holds no raw echoes: .*lacks signal"):
        raw_echoes.read(tmp_path / "b.nc")
    with h5py.File(tmp_path / "c.nc", "w") as file:
        for name in ("signal_real", "signal_imag"):
            file.create_dataset(name, (1 << 20, 1 << 10, 1 << 10), np.float32).dims[0].label = "ping"
            for place, dim in enumerate(("ping", "rx", "sample")):
                if dim not in file:
                    file.create_dataset(dim, (file[name].shape[place],), "i1", chunks=(1 << 10,)).make_scale(dim)
                file[name].dims[place].attach_scale(file[dim])
    for reader in (raw_echoes.read, mitsonar.read):
        with pytest.raises(ValueError, match="c.nc: it claims .* bytes of numbers"):
            reader(tmp_path / "c.nc")


def test_a_part_that_is_no_such_file_is_refused(tmp_path):
    (tmp_path / "a.nc.part").write_bytes(b"nothing of the kind")
    with pytest.raises(ValueError, match="a.nc.part is no netCDF-4 file"):
        raw_echoes.write(one_by_one(raw_record()), tmp_path / "a.nc", count=5)
    mitsonar.write(raw_record(), tmp_path / "a.nc.nc")
    os.replace(tmp_path / "a.nc.nc", tmp_path / "a.nc.part")
    with pytest.raises(ValueError, match="a.nc.part is whole, or of another program; remove it"):
        raw_echoes.write(one_by_one(raw_record()), tmp_path / "a.nc", count=5)


def test_a_record_in_memory_is_written_so_that_pings_are_read_alone(tmp_path):
    record = raw_record()
    mitsonar.write(record, tmp_path / "a.nc")
    assert same(mitsonar.read(tmp_path / "a.nc"), record)
    with h5py.File(tmp_path / "a.nc") as file:
        assert file["signal_real"].chunks == (1, 4, 50)


def test_programs_that_write_the_same_file_at_once_are_told_to_wait(tmp_path):
    """Another one begins while this one makes its first ping or lays out the file, or ends before it is opened."""
    record, path = raw_record(), tmp_path / "a.nc"
    wait = "a.nc.part is being written by another program; wait until it ends"

    def overtaken(start):
        ping_file.lay_out(raw_echoes.part_of(path), encoded(record.isel(ping=slice(0, 1))), 5)
        yield from one_by_one(record)(start)

    raw_echoes.write(one_by_one(record), path, count=5)
    whole = path.read_bytes()
    raw_echoes.write(overtaken, path, count=5)         # what the other began, and left, goes on
    assert path.read_bytes() == whole and os.listdir(tmp_path) == ["a.nc"]

    lay_out = ping_file.lay_out
    with pytest.MonkeyPatch.context() as patch, pytest.raises(ValueError, match=wait):
        patch.setattr(ping_file, "lay_out", lambda part, *more: (lay_out(part, *more), lay_out(part, *more)))
        raw_echoes.write(one_by_one(record), path, count=5)
    os.remove(raw_echoes.part_of(path))
    with pytest.MonkeyPatch.context() as patch, pytest.raises(ValueError, match=wait):
        patch.setattr(ping_file, "lay_out", lambda part, *more: None)             # finished and taken away
        raw_echoes.write(one_by_one(record), path, count=5)
    assert path.read_bytes() == whole
