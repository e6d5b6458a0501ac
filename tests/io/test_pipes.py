"""A pipe nobody writes to, a device without end and a folder: every reader refuses them, none waits."""
import os

import pytest

from mitsonar.device import files
from mitsonar.io import casts, reading
from mitsonar.io.grids import bathymetry
from mitsonar.io.records import exr, signals
from mitsonar.io.scene_files import arrays, meshes, pictures, scenes, tables
from mitsonar.io.survey_lines import reading as survey_lines
from mitsonar.io.tracks import tracks

READERS = {"array": arrays.read, "bathymetry": bathymetry.read, "cast": casts.read, "exr": exr.read,
           "attributes": exr.attributes, "mesh": lambda path: meshes.check(path, "ply"), "target": meshes.check_target,
           "picture": pictures.check, "volume": pictures.check_volume, "scene": scenes.root, "signals": signals.read,
           "table": lambda path: tables.records(path, "table"), "track": tracks.read,
           "line": survey_lines.read}
KERNEL = "/proc/self/status"       # as its log, which has no end, but safe to read


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
@pytest.mark.parametrize("read", READERS.values(), ids=READERS)
@pytest.mark.parametrize("kind", ["pipe", "device", "folder", pytest.param("kernel", marks=pytest.mark.skipif(
    not os.path.exists(KERNEL), reason="no files of the kernel here"))])
def test_readers_refuse_what_is_no_ordinary_file(tmp_path, read, kind):
    path = tmp_path / "it.ply"
    {"pipe": os.mkfifo, "device": lambda path: path.symlink_to("/dev/zero"), "folder": os.mkdir,
     "kernel": lambda path: path.symlink_to(KERNEL)}[kind](path)
    with pytest.raises(ValueError, match=r"it\.ply.*(folder|device|pipe|not a file|file of the kernel)"):
        read(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_whatever_is_read_by_its_content_is_no_pipe(tmp_path):
    os.mkfifo(tmp_path / "it")
    with pytest.raises(ValueError, match="it is a device or a pipe"):
        reading.read(tmp_path / "it")


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may read every file")
def test_files_that_may_not_be_read(tmp_path):
    path = tmp_path / "locked"
    path.touch(mode=0)
    with pytest.raises(PermissionError, match="cannot read the mesh .*locked: you may not read it"):
        files.check_readable(path, "the mesh")
