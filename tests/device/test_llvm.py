"""The libLLVM that Dr.Jit gets: 17 or newer, the closest to the tested 19, or none at all.

Folders of stand-ins named like the real files show the choice; a process of its own shows what Dr.Jit really loads.
"""
import os
import shutil
import subprocess
import sys
import tempfile
import types
from pathlib import Path

import pytest

from mitsonar.device import llvm

ROOT = Path(__file__).resolve().parents[2]
CHOICES = [
    # (installed, in our cache, chosen)
    (["libLLVM-15.so.1", "libLLVM.so.19.1"], [], "libLLVM.so.19.1"),
    (["libLLVM-14.0.6.so.1", "libLLVM-15.so.1", "libLLVM-16.so.1"], [], None),
    (["libLLVM-15.so.1"], ["libLLVM.so.19.1"], "libLLVM.so.19.1"),
    (["libLLVM-17.so.1", "libLLVM.so.18.1"], [], "libLLVM.so.18.1"),
    (["libLLVM.so.22.1", "libLLVM.so.19.1", "libLLVM-17.so.1"], [], "libLLVM.so.19.1"),
    (["libLLVM.so.18.1", "libLLVM.so.20.1"], [], "libLLVM.so.20.1"),
    (["libLLVMSPIRVLib.so.19.1", "libLLVMCore.a", "libLLVM-19.txt"], [], None),
    ([], [], None),
]


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine whose only libraries are stand-ins: call it with the names installed and those in our cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "caches"))
    monkeypatch.delenv(llvm.VARIABLE, raising=False)
    system, private = tmp_path / "system", Path(llvm.private_folder()) / "usr/lib/any-linux-gnu"
    monkeypatch.setattr(llvm, "_folders", lambda: [str(system), str(private)])
    head = Path(os.path.realpath(sys.executable)).read_bytes()[:20]

    def fill(installed, cached=()):
        for folder, names in ((system, installed), (private, cached)):
            folder.mkdir(parents=True)
            for name in names:
                (folder / name).write_bytes(head)
        return system

    return fill


@pytest.mark.parametrize("installed, cached, chosen", CHOICES)
def test_the_closest_to_the_tested_version_is_chosen(machine, installed, cached, chosen):
    machine(installed, cached)
    found = llvm.locate()
    assert (found and os.path.basename(found)) == chosen
    assert os.environ[llvm.VARIABLE] == (found or llvm.NOTHING)


def test_an_installed_library_comes_before_our_copy(machine):
    system = machine(["libLLVM.so.19.1"], ["libLLVM.so.19.1"])
    assert llvm.locate() == str(system / "libLLVM.so.19.1")
    assert llvm.origin(llvm.locate()) == "system"


def test_a_link_counts_as_what_it_leads_to(machine):
    system = machine(["libLLVM-15.so.1"])
    (system / "libLLVM.so").symlink_to("libLLVM-15.so.1")
    (system / "libLLVM.so.19.1").symlink_to("gone")
    assert llvm.locate() is None


def test_a_library_for_another_processor_is_passed_over(machine):
    system = machine(["libLLVM.so.19.1", "libLLVM-17.so.1"])
    head = bytearray((system / "libLLVM.so.19.1").read_bytes())
    head[18] ^= 0xFF
    (system / "libLLVM.so.19.1").write_bytes(head)
    assert llvm.locate() == str(system / "libLLVM-17.so.1")


def test_the_variable_is_honoured_when_new_enough(machine, tmp_path, monkeypatch):
    machine(["libLLVM.so.19.1"])
    mine = tmp_path / "libLLVM.so.21.1"
    mine.touch()
    monkeypatch.setenv(llvm.VARIABLE, str(mine))
    assert llvm.locate() == str(mine)
    assert llvm.origin(llvm.locate()) == llvm.VARIABLE


@pytest.mark.parametrize("name", ["libLLVM-15.so.1", "missing.so"])
def test_the_variable_is_refused_with_a_warning_otherwise(machine, name, monkeypatch):
    system = machine(["libLLVM-15.so.1", "libLLVM.so.19.1"])
    monkeypatch.setenv(llvm.VARIABLE, str(system / name))
    with pytest.warns(UserWarning, match="not LLVM 17 or newer"):
        assert llvm.locate() == str(system / "libLLVM.so.19.1")


def test_a_library_whose_name_tells_nothing_is_asked(tmp_path, monkeypatch):
    real, copy = os.environ[llvm.VARIABLE], tmp_path / "libLLVM.so"
    if real == llvm.NOTHING:
        pytest.skip("no libLLVM here, only an NVIDIA driver")
    try:
        os.link(real, copy)
    except OSError:  # on another disk
        shutil.copy(real, copy)
    monkeypatch.setenv("LD_LIBRARY_PATH", os.path.dirname(real))  # for what our own copy needs beside it
    assert llvm.major_version(str(copy)) == llvm.major_version(real)


def test_a_broken_library_has_no_version(tmp_path):
    (tmp_path / "libLLVM.so").write_bytes(b"\x7fELF, and no more")
    assert llvm.major_version(str(tmp_path / "libLLVM.so")) == -1


def test_check_refuses_an_old_library_that_is_already_loaded(monkeypatch):
    loaded = types.SimpleNamespace(detail=types.SimpleNamespace(llvm_version=lambda: (15, 0, 6)))
    monkeypatch.setitem(sys.modules, "drjit", loaded)
    with pytest.raises(llvm.BackendError, match="LLVM 15"):
        llvm.check()


@pytest.mark.parametrize("cuda", [False, True])
def test_check_without_any_library(machine, monkeypatch, cuda):
    machine([])
    monkeypatch.delitem(sys.modules, "drjit", raising=False)
    monkeypatch.setattr(llvm, "has_cuda", lambda: cuda)
    if cuda:
        llvm.check()
    else:
        with pytest.raises(llvm.BackendError, match="apt-get install libllvm19 libatomic1"):
            llvm.check()


def test_provide_on_a_machine_without_apt_gives_the_remedy(machine, monkeypatch, tmp_path):
    machine([])
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(llvm.BackendError, match="no apt-get") as caught:
        llvm.provide(say=lambda line: None)
    assert "elsewhere:" in str(caught.value)


def test_dr_jit_loads_no_old_library_here():
    """With what these tests run on, and with what the machine has by itself: never what Dr.Jit would pick."""
    code = """import mitsonar
try: import drjit; print(drjit.detail.llvm_version()[0])
except mitsonar.BackendError: print(-1)"""
    for variable in (os.environ[llvm.VARIABLE], ""):
        environment = {**os.environ, "PYTHONPATH": str(ROOT), llvm.VARIABLE: variable}
        version = int(subprocess.check_output([sys.executable, "-c", code], env=environment))
        assert version >= llvm.OLDEST or version == -1 and variable != os.environ[llvm.VARIABLE]


class _Features:
    """A libLLVM that sees a processor with these features."""

    def __init__(self, features):
        self.LLVMGetHostCPUFeatures, self.LLVMGetHostCPUName = lambda: features, lambda: b"znver4"


@pytest.mark.parametrize("features, name", [
    (b"+sse4.2,+avx,+avx2,-avx512vl", "AVX2"), (b"+avx2,+avx512f,+avx512vl", "AVX-512"), (b"+avx2,+avx512f", "AVX2"),
    (b"+neon", "NEON"), (b"", "scalar")])
def test_the_instruction_set_is_the_widest_that_llvm_sees(monkeypatch, features, name):
    """Two processors of one name, one with AVX-512 and one without, are told apart."""
    monkeypatch.setattr(llvm.ctypes, "CDLL", lambda path: _Features(features))
    assert llvm.instruction_set() == f"{os.uname().machine} {name} znver4"


def test_the_instruction_set_of_this_machine_is_that_of_its_flags():
    flags = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else ""
    if "avx2" not in flags:
        pytest.skip("the flags of this machine's processor are not to be read, or are not those of x86")
    assert llvm.instruction_set().split()[1] == ("AVX-512" if "avx512vl" in flags else "AVX2")


@pytest.fixture
def homeless(tmp_path, monkeypatch):
    """A user whose home is no folder, so that not even root can write it; the folder of temporary files."""
    (tmp_path / "file").touch()
    for name in ("XDG_CACHE_HOME", "DRJIT_CACHE_DIR", "MPLCONFIGDIR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "file" / "home"))
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", None)
    monkeypatch.setattr(llvm, "_made", [])
    return tmp_path


def test_a_home_that_cannot_be_written_is_replaced_by_a_folder_of_the_users_own(homeless):
    folder = llvm.cache_folder()
    assert folder == llvm.new_folder() == str(homeless / f"mitsonar-{os.getuid()}")
    assert os.stat(folder).st_mode & 0o777 == 0o700
    assert llvm.cache_folder() == folder
    llvm._made.clear()                                     # another process
    assert llvm.cache_folder() == folder and llvm.new_folder() is None


def test_a_temporary_folder_that_others_can_write_is_not_trusted(homeless):
    (homeless / f"mitsonar-{os.getuid()}").mkdir()
    (homeless / f"mitsonar-{os.getuid()}").chmod(0o777)
    folder = llvm.cache_folder()
    assert folder != str(homeless / f"mitsonar-{os.getuid()}") and os.stat(folder).st_mode & 0o777 == 0o700
    assert llvm.cache_folder() == folder


def test_without_a_home_kernels_and_fonts_are_kept_in_our_folder(homeless, monkeypatch):
    monkeypatch.setenv(llvm.VARIABLE, os.environ.get(llvm.VARIABLE, ""))
    llvm.locate()
    assert os.environ["DRJIT_CACHE_DIR"] == os.path.join(llvm.cache_folder(), "drjit")
    assert os.environ["MPLCONFIGDIR"] == os.path.join(llvm.cache_folder(), "matplotlib")
    for name in ("DRJIT_CACHE_DIR", "MPLCONFIGDIR"):
        monkeypatch.delenv(name)


def test_commands_run_without_a_home_and_say_once_what_takes_its_place(homeless):
    library = os.environ[llvm.VARIABLE]
    told = [subprocess.run([sys.executable, "-m", "mitsonar", "scenes"], cwd=ROOT, capture_output=True, text=True,
                           env={**os.environ, llvm.VARIABLE: library}, check=True) for _ in range(2)]
    assert told[0].stdout == told[1].stdout and "sidescan_flat" in told[0].stdout
    assert told[0].stderr.count("\n") == 1 and "Set XDG_CACHE_HOME to a folder that lasts" in told[0].stderr
    assert told[1].stderr == ""
