"""Check that records hold all of their own data, and refer to no other file.

HDF5 can keep the numbers of a dataset in any other file (external raw storage, virtual datasets), and a group can be a
link to another file. A Zarr store is a folder, whose entries can be symbolic links. Libraries follow all of them, so a
record from a stranger could read files that only its reader may, or wait for a pipe for ever. Every reader of such a
record therefore calls one of these checks first. The checks read no numbers.
"""
import os
import stat

from mitsonar.device.files import FilePath

DEEPEST = 100                      # groups within groups; the HDF5 library ends the process at some thousands


class DataElsewhere(ValueError):
    """Report a record that refers to data outside itself; the message does not name the file."""


def check_hdf5(path: FilePath) -> None:
    """Check that an HDF5 or netCDF-4 file refers to no other file and has no virtual dataset."""
    import h5py
    from h5py import h5d, h5g, h5l, h5o

    with h5py.File(path, "r") as file:
        groups, seen = [(h5g.open(file.id, b"/"), 0)], set()
        while groups:
            group, depth = groups.pop()
            if depth > DEEPEST:
                raise RuntimeError(f"its groups are nested more than {DEEPEST} deep")
            for name in group:
                kind = group.links.get_info(name).type
                if kind == h5l.TYPE_SOFT:              # leads to a place in this file, which is visited anyway
                    continue
                if kind != h5l.TYPE_HARD:
                    raise _elsewhere(name, "a link to another file")
                about = h5o.get_info(group, name)
                if (about.fileno, about.addr) in seen:             # another name of the same object, or a cycle
                    continue
                seen.add((about.fileno, about.addr))
                if about.type == h5o.TYPE_GROUP:
                    groups.append((h5g.open(group, name), depth + 1))
                elif about.type == h5o.TYPE_DATASET:
                    layout = h5d.open(group, name).get_create_plist()
                    if layout.get_layout() == h5d.VIRTUAL:
                        raise _elsewhere(name, "a virtual dataset")
                    if layout.get_external_count():
                        raise _elsewhere(name, "external raw storage")


def check_store(folder: FilePath) -> None:
    """Check that a Zarr store has nothing but folders and ordinary files in it."""
    folders = [os.fspath(folder)]
    while folders:
        with os.scandir(folders.pop()) as entries:
            for entry in entries:
                mode = entry.stat(follow_symlinks=False).st_mode
                if stat.S_ISDIR(mode):
                    folders.append(entry.path)
                elif not stat.S_ISREG(mode):
                    kind = "a symbolic link" if stat.S_ISLNK(mode) else "a pipe or a device"
                    raise DataElsewhere(f"{os.path.relpath(entry.path, folder)} in it is {kind}, and a store must hold "
                                        "its own data; replace it by the file itself.")


def _elsewhere(name: bytes, kind: str) -> DataElsewhere:
    """Return the error for a part of a file whose data lie elsewhere."""
    return DataElsewhere(f"{name.decode(errors='replace')!r} in it is {kind}, and a record must hold its own data; "
                         "copy the data into the file.")
