"""HDF5 files and Zarr stores that send their reader to other files: refused before a byte of these is read.

Every other file here is a pipe into which nobody writes: what opens one never ends, and the test would hang.
"""
import os
import shutil

import h5py
import numpy as np
import pytest
import rasterio
import xarray as xr
from h5py import h5d, h5p, h5s, h5t
from rasterio.transform import from_origin
from raw_record import raw_record
from soundings_line import soundings_line
from synthetic_sidescan import sidescan

import mitsonar
from mitsonar.io import survey_lines
from mitsonar.io.grids import bathymetry
from mitsonar.io.records import raw_echoes
from mitsonar.io.records.ping_file import PingFile
from mitsonar.io.records.self_contained import DataElsewhere, check_hdf5
from mitsonar.io.scene_files import scattering_tables


@pytest.fixture
def pipe(tmp_path):
    os.mkfifo(tmp_path / "secret.bin")
    return str(tmp_path / "secret.bin")


def external_link(group, name, shape, other):
    group[name] = h5py.ExternalLink(other, "/" + name)


def raw_storage(group, name, shape, other):
    group.create_dataset(name, shape, "f4", external=[(other, 0, h5py.h5f.UNLIMITED)])


def virtual(group, name, shape, other):
    layout = h5py.VirtualLayout(shape, "f4")
    layout[...] = h5py.VirtualSource(other, name, shape)
    group.create_virtual_dataset(name, layout)


def virtual_of_itself(group, name, shape, other):
    virtual(group, name, shape, ".")


def growing_virtual(group, name, shape, other):
    """A virtual dataset whose shape is that of its source: HDF5 opens the source to learn it."""
    place = h5s.create_simple((8,), (h5s.UNLIMITED,))
    place.select_hyperslab((0,), (h5s.UNLIMITED,), (1,), (1,))
    plan = h5p.create(h5p.DATASET_CREATE)
    plan.set_virtual(place, other.encode(), b"x", place)
    h5d.create(group.id, name.encode(), h5t.IEEE_F32LE, place, plan)


WAYS = {external_link: "a link to another file", raw_storage: "external raw storage", virtual: "a virtual dataset",
        virtual_of_itself: "a virtual dataset", growing_virtual: "a virtual dataset"}


def lead_away(path, name, way, other):
    """Replace a variable of a file."""
    with h5py.File(path, "a") as file:
        shape = file[name].shape
        del file[name]
        way(file, name, shape, other)


def image(path):
    mitsonar.write(sidescan(4, 6), path)
    return "level", mitsonar.read


def plain_hdf5(path):
    mitsonar.write(sidescan(4, 6), path.with_suffix(".h5"))
    path.with_suffix(".h5").rename(path)
    return "level", mitsonar.read


def echoes(path):
    mitsonar.write(raw_record(), path)
    return "signal_real", raw_echoes.read


def soundings(path):
    mitsonar.write(soundings_line(2, 6), path)
    return "travel_time", lambda path: list(survey_lines.read_blocks(path))


def table(path):
    xr.Dataset({"target_strength_db": ("frequency_khz", [-10.0, -11.0])}, {"frequency_khz": [90.0, 100.0]}).to_netcdf(
        path, engine="h5netcdf")
    return "target_strength_db", scattering_tables.read


def grid(path):
    xr.Dataset({"z": (("y", "x"), np.full((5, 6), -20.0))}, {"x": 2.0 * np.arange(6), "y": 2.0 * np.arange(5)}
               ).to_netcdf(path, engine="h5netcdf")
    return "z", bathymetry.read


@pytest.mark.parametrize("kind", [image, plain_hdf5, echoes, soundings, table, grid])
def test_data_in_another_file_are_refused_and_never_opened(tmp_path, pipe, kind):
    name, read = kind(tmp_path / "whole.nc")
    read(tmp_path / "whole.nc")
    for way, said in WAYS.items():
        path = shutil.copy(tmp_path / "whole.nc", tmp_path / "a.nc")
        lead_away(path, name, way, pipe)
        with pytest.raises(ValueError, match=f"a.nc: '{name}' in it is {said}, and a record must hold its own data"):
            read(path)


@pytest.mark.parametrize("way", [virtual, external_link])
def test_a_part_that_leads_away_is_not_gone_on_with(tmp_path, pipe, way):
    raw_echoes.write(lambda start: iter([raw_record(1)]), tmp_path / "a.nc", count=1)
    os.replace(tmp_path / "a.nc", tmp_path / "a.nc.part")
    lead_away(tmp_path / "a.nc.part", "signal_real", way, pipe)
    with pytest.raises(ValueError, match=f"cannot go on with .*a.nc.part: .* is {WAYS[way]}"):
        raw_echoes.write(lambda start: iter([raw_record(1)]), tmp_path / "a.nc", count=1)
    with pytest.raises(ValueError, match=f"cannot go on with .*a.nc.part: .* is {WAYS[way]}"):
        PingFile(tmp_path / "a.nc.part", 1)


@pytest.mark.parametrize("way", [raw_storage, virtual, external_link])
def test_a_bag_that_leads_away(tmp_path, pipe, way):
    path = tmp_path / "a.bag"
    with rasterio.open(path, "w", driver="BAG", height=6, width=8, count=1, dtype="float32", nodata=1e6,
                       crs="EPSG:32632", transform=from_origin(5e5, 6e6, 2, 2)) as bag:
        bag.write(np.full((6, 8), -20, np.float32), 1)
    bathymetry.read(path)
    with h5py.File(path, "a") as file:
        del file["BAG_root/elevation"]
        way(file["BAG_root"], "elevation", (6, 8), pipe)
    with pytest.raises(ValueError, match=f"^{path}: 'elevation' in it is {WAYS[way]}"):
        bathymetry.read(path)
    behind = tmp_path / "behind.bag"                   # HDF5 may begin after 512 bytes of something else
    behind.write_bytes(bytes(512) + path.read_bytes())
    with pytest.raises(ValueError, match=f"behind.bag: 'elevation' in it is {WAYS[way]}"):
        bathymetry.read(behind)


@pytest.mark.parametrize("way", WAYS)
def test_what_leads_away_is_found_wherever_it_is(tmp_path, pipe, way):
    def behind_a_soft_link(file):
        way(file.create_group("a"), "far", (3,), pipe)
        file["near"] = h5py.SoftLink("/a/far")

    def in_a_cycle(file):
        file.create_group("a")["up"] = file["/"]
        way(file["a"], "far", (3,), pipe)

    for build in (lambda file: way(file.create_group("a/b/c"), "far", (3,), pipe), behind_a_soft_link, in_a_cycle):
        with h5py.File(tmp_path / "a.h5", "w") as file:
            build(file)
        with pytest.raises(DataElsewhere, match=f"'far' in it is {WAYS[way]}"):
            check_hdf5(tmp_path / "a.h5")


def test_links_within_a_file_and_odd_types_are_no_reason_to_refuse_it(tmp_path):
    path = tmp_path / "a.nc"
    mitsonar.write(sidescan(4, 6), path)
    with h5py.File(path, "a") as file:
        group = file.create_group("a")
        group["up"], group["self"], group["level"] = file["/"], group, file["level"]           # cycles of hard links
        group["there"], group["dangling"] = h5py.SoftLink("/level"), h5py.SoftLink("/nowhere")
        group["to"], group["fro"] = h5py.SoftLink("/a/fro"), h5py.SoftLink("/a/to")
        group.create_dataset("ragged", (2,), h5py.vlen_dtype("f4"))
        group.create_dataset("reference", data=file["level"].ref, dtype=h5py.ref_dtype)
        group["region"] = file["level"].regionref[0:2]
        group["type"] = np.dtype([("r", "f4"), ("i", "f4")])
    check_hdf5(path)
    assert mitsonar.read(path).identical(sidescan(4, 6))


@pytest.mark.parametrize("depth, said", [(100, "'far' in it is a link"), (101, "nested more than 100 deep")])
def test_groups_within_groups_are_looked_through_and_are_not_too_deep(tmp_path, depth, said):
    """At some thousands the HDF5 library overflows its stack when it is asked for a name, and the process ends."""
    mitsonar.write(sidescan(4, 6), tmp_path / "deep.nc")
    with h5py.File(tmp_path / "deep.nc", "a") as file:
        group = file
        for _ in range(depth):
            group = group.create_group("g")
        group["far"] = h5py.ExternalLink("x", "y")
    with pytest.raises(ValueError, match=f"deep.nc.*{said}"):
        mitsonar.read(tmp_path / "deep.nc")


@pytest.mark.parametrize("version", [2, 3])
def test_a_zarr_store_holds_ordinary_files_alone(tmp_path, pipe, version):
    pytest.importorskip("zarr")
    store = tmp_path / "a.zarr"
    sidescan(4, 6).to_zarr(store, zarr_format=version)
    mitsonar.read(store)
    chunk = next(one for one in (store / "level").rglob("*") if one.is_file() and "z" not in one.name)
    chunk.rename(tmp_path / "kept")
    for make, kind in ((lambda: chunk.symlink_to(pipe), "a symbolic link"), (lambda: os.mkfifo(chunk), "a pipe")):
        make()
        with pytest.raises(ValueError, match=f"cannot read .*a.zarr: level/.* in it is {kind}"):
            mitsonar.read(store)
        chunk.unlink()
    (tmp_path / "kept").rename(chunk)
    (store / "more").symlink_to(tmp_path)
    with pytest.raises(ValueError, match="more in it is a symbolic link"):
        mitsonar.read(store)


def test_a_damaged_zarr_store_is_refused_in_a_sentence(tmp_path):
    pytest.importorskip("zarr")
    store = tmp_path / "a.zarr"
    sidescan(4, 6).to_zarr(store, zarr_format=2, consolidated=False)
    about = store / "level" / ".zarray"
    about.write_text(about.read_text().replace('"filters": null', '"filters": [{"id": "pickle"}]'))
    with pytest.raises(ValueError, match="cannot read .*a.zarr: this Zarr store is damaged, or of a kind"):
        mitsonar.read(store)
