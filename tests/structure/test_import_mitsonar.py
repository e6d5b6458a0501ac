"""``import mitsonar`` is cheap, and makes the plugins known to Mitsuba whichever of the two is imported first."""
import importlib
import inspect
import os
import subprocess
import sys
from pathlib import Path

import pytest
from small_scene import TEXT

from mitsonar.device import llvm
from mitsonar.device.lazy import homes_of

ROOT = Path(__file__).resolve().parents[2]
STUBS = [pytest.param(stub, id=str(stub.parent.relative_to(ROOT)))
         for stub in sorted((ROOT / "mitsonar").rglob("__init__.pyi"))]

# Stands for the real plugins: counts the calls and proves that Mitsuba is complete when they come.
RECORDER = """
import sys, types
calls = []
recorder = types.ModuleType("mitsonar.plugins")
recorder.install = lambda: calls.append(sys.modules["mitsuba"].variants())
sys.modules["mitsonar.plugins"] = recorder
"""
ORDERS = {
    "mitsonar first": "import mitsonar, mitsuba",
    "mitsuba first": "import mitsuba, mitsonar",
    "by a submodule": "import mitsonar; from mitsuba import chi2",
    "asked about before": "import mitsonar, importlib.util; importlib.util.find_spec('mitsuba'); import mitsuba",
    "dr.jit between": "import drjit, mitsonar, mitsuba",
    "twice": "import mitsonar, mitsuba; del sys.modules['mitsonar']; import mitsonar",
}


def python(code, *options):
    """Run `code` in a process of its own and return what it printed.

    Dr.Jit before mitsonar needs a system that has libatomic; the library path stands for one where mitsonar brought it.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "LD_LIBRARY_PATH": os.path.dirname(os.environ[llvm.VARIABLE])}
    child = subprocess.run([sys.executable, *options, "-c", code], env=environment, capture_output=True, text=True,
                           stdin=subprocess.DEVNULL, check=False)
    assert child.returncode == 0, child.stderr
    return child.stdout.strip()


def test_import_costs_nothing():
    """Under 0.3 s, as the best of three: other work on the machine must not decide."""
    code = "import sys, time; start = time.perf_counter(); import mitsonar; print(time.perf_counter() - start)"
    assert min(float(python(code)) for _ in range(3)) < 0.3


def test_import_brings_no_heavy_package():
    loaded = python("import mitsonar, sys; print(*{name.split('.')[0] for name in sys.modules})").split()
    assert not set(loaded) & {"numpy", "scipy", "xarray", "matplotlib", "rasterio", "drjit", "mitsuba"}


def test_type_checkers_and_completion_see_every_public_name():
    """The stub is the one list: of type checkers, of ``__all__`` and of completion."""
    import mitsonar

    assert set(mitsonar.__all__) == {name for name in dir(mitsonar) if not name.startswith("_")}
    assert {"render", "load_file", "water", "seabed", "scenes", "plugins"} <= set(mitsonar.__all__)


@pytest.mark.parametrize("stub", STUBS)
def test_every_public_name_leads_somewhere(stub):
    package = importlib.import_module(".".join(stub.relative_to(ROOT).parent.parts))
    for name in package.__all__:
        assert getattr(package, name) is not None
    with pytest.raises(AttributeError, match="it has"):
        package.no_such_name


def test_every_public_module_can_be_imported_by_its_name():
    """``from mitsonar.water import sound_speed`` works, and so does `mitsonar.water`; completion knows its names."""
    import mitsonar

    modules = [name for name in mitsonar.__all__ if inspect.ismodule(getattr(mitsonar, name))]
    assert len(modules) > 15
    for name in modules:
        module = importlib.import_module(f"mitsonar.{name}")
        assert module is getattr(mitsonar, name)
        assert set(getattr(module, "__all__", ())) <= set(dir(module)), name


def test_help_is_short_about_what_arrays_are_made_of():
    """NumPy's union of all that an array can be made of is a screen long; help shows its name."""
    import mitsonar

    for name in ("propagation", "scattering", "seabed", "signal", "sonar", "water"):
        module = getattr(mitsonar, name)
        for function in filter(inspect.isfunction, (getattr(module, public) for public in module.__all__)):
            assert "numpy._typing" not in str(inspect.signature(function)), f"{name}.{function.__name__}"


@pytest.mark.parametrize("order", ORDERS)
def test_plugins_are_installed_once_mitsuba_is_there(order):
    expected = "2" if order == "twice" else "1"
    hook = "sum(getattr(finder, '__name__', '') == '_FirstImport' for finder in sys.meta_path)"
    assert python(f"{RECORDER}{ORDERS[order]}; print(len(calls), {hook})") == f"{expected} 0"


def test_a_failing_plugin_is_not_hidden():
    said = python(RECORDER + "recorder.install = lambda: 1 / 0\nimport mitsonar\n"
                  "try: import mitsuba\nexcept ZeroDivisionError: print('told')")
    assert said == "told"


@pytest.mark.parametrize("package", ["drjit", "mitsuba"])
def test_without_a_usable_library_the_import_says_what_to_do(package):
    code = f"""import mitsonar, os
del os.environ[mitsonar.llvm.VARIABLE]
mitsonar.llvm._folders = lambda: []
mitsonar.llvm.has_cuda = lambda: False
try: import {package}
except mitsonar.BackendError as error: print(error)"""
    assert "sudo apt-get install libllvm19 libatomic1" in python(code)


def test_without_mitsuba_the_usual_error_is_seen():
    said = python("import mitsonar\ntry: import mitsuba\nexcept ModuleNotFoundError as error: print(error)", "-S")
    assert said == "No module named 'mitsuba'"


@pytest.mark.parametrize("first", ["mitsonar", "mitsuba"])
def test_every_plugin_is_registered_when_a_variant_is_set(first):
    code = f"""import {first}, sys, mitsonar, mitsuba
mitsuba.set_variant("llvm_ad_mono")
from mitsonar.plugins import MODULES
print([name for name in MODULES if f"mitsonar.plugins.{{name}}" not in sys.modules])"""
    assert python(code) == "[]"


def test_an_unknown_name_lists_the_known_ones():
    import mitsonar

    with pytest.raises(AttributeError, match="load_file"):
        mitsonar.lode_file


def test_every_module_can_be_imported_before_a_variant_is_set():
    """Mitsuba's classes exist only afterwards, so annotations must not look them up at once; plugins wait for it."""
    names = [f"mitsonar.{'.'.join(path.relative_to(ROOT / 'mitsonar').with_suffix('').parts)}".removesuffix(".__init__")
             for path in sorted((ROOT / "mitsonar").rglob("*.py"))]
    names = [name for name in names if name not in ("mitsonar.__main__", "mitsonar.dataset.torch_images",
                                                   "mitsonar.dataset.torch_rendering")]
    code = f"import importlib\nfor name in {names}: importlib.import_module(name)\nprint('imported')"
    assert python(code) == "imported"


# A twentieth of a second of CPU each, or more; pandas comes with xarray.
HEAVY = ("numpy", "xarray", "pandas", "pyarrow", "dask", "matplotlib", "rasterio", "pyproj", "h5netcdf", "rich",
         "scipy.special", "scipy.fft", "scipy.interpolate", "scipy.linalg", "scipy.spatial", "scipy.ndimage",
         "scipy.optimize", "scipy.signal", "scipy.stats", "mitsonar.hydrography.detection.detection",
         "mitsonar.survey.synthetic_aperture.kind", "mitsonar.survey.fan.kind", "mitsonar.survey.sidescan.kind")
PICTURE = {"numpy", "xarray", "pandas"}
SIDESCAN = {*PICTURE, "mitsonar.survey.sidescan.kind"}
MAY_IMPORT = {
    ("--help",): set(),
    ("render", "--help"): set(),
    ("scenes",): set(),
    ("describe", "scene.xml"): {"numpy"},
    ("render", "scene.xml", "-o", "out.exr"): SIDESCAN,
    ("show", "scene.xml", "-o", "out.png"): {*SIDESCAN, "matplotlib"} - {"pandas"},     # xarray waits to be used
    ("render", "forward_looking", "-o", "out.exr", "-D", "pings=1", "-D", "range=20"):
        {*PICTURE, "mitsonar.survey.fan.kind", *(f"scipy.{name}" for name in (
            "special", "fft", "interpolate", "linalg", "spatial", "ndimage", "optimize"))},
}


@pytest.mark.parametrize("command", MAY_IMPORT, ids=lambda command: " ".join(command[:2]))
def test_a_command_imports_no_heavy_module_that_it_does_not_need(tmp_path, command):
    (tmp_path / "scene.xml").write_text(TEXT)
    code = ("import sys; from mitsonar.device.lazy import begin_command; begin_command(); "
            "from mitsonar.cli.setup import bootstrap; bootstrap.missing(); "
            "from mitsonar.cli.main import main; import atexit; "
            f"atexit.register(lambda: print(*['loaded', *({set(HEAVY)} & set(sys.modules))], file=sys.stderr)); "
            "sys.exit(main(sys.argv[1:]))")
    child = subprocess.run([sys.executable, "-c", code, *command], capture_output=True, text=True, check=True,
                           cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)})
    assert set(child.stderr.rpartition("loaded")[2].split()) <= MAY_IMPORT[command]


def test_a_module_alone_is_that_of_its_package():
    """Windows and the chirp transform come without scipy.signal and scipy.stats, and are the same numbers."""
    code = """from mitsonar.device.lazy import module_alone
alone = module_alone("scipy.signal", "windows/_windows.py"), module_alone("scipy.signal", "_czt.py")
import sys, numpy as np
assert "scipy.signal" not in sys.modules
import scipy.signal
for window in ("hann", ("chebwin", 30), ("taylor", 4, 30), ("dpss", 2)):
    assert np.array_equal(alone[0].get_window(window, 33, fftbins=False), scipy.signal.get_window(window, 33, False))
x = np.exp(0.1j * np.arange(50))
assert np.array_equal(alone[1].czt(x, 40, 0.9), scipy.signal.czt(x, 40, 0.9))
print(module_alone("scipy.signal", "of_no_file.py") is scipy.signal is module_alone("scipy.signal", "_czt2.py"))"""
    assert python(code) == "True"


def test_a_command_rewrites_a_function_for_loops_at_its_first_call(tmp_path):
    (tmp_path / "loops.py").write_text("""import drjit as dr
from drjit.llvm import UInt32

@dr.syntax
def halvings(x, most=99):
    '''Count.'''
    n = UInt32(0)
    while (x > 1) & (n < most):
        x >>= 1
        n += 1
    return n
""")
    code = f"""import sys; sys.path.insert(0, {str(tmp_path)!r})
from mitsonar.device.lazy import begin_command
begin_command()
import mitsonar, drjit.ast
before = drjit.ast._syntax_counter
from loops import halvings, UInt32
unused = drjit.ast._syntax_counter - before
print(unused, halvings.__name__, *halvings(UInt32(1, 8, 1000)), *halvings(UInt32(16), most=2),
      drjit.ast._syntax_counter - before)"""
    assert python(code) == "0 halvings 0 3 9 2 1"


def test_xarray_knows_arrays_of_dask_once_dask_is_there():
    """A picture is made and written without Dask, which is imported and recognised when somebody uses it."""
    code = """import sys, tempfile
from mitsonar.device.lazy import begin_command
begin_command()
import mitsonar, numpy as np, xarray as xr
mitsonar.render
picture = xr.Dataset({"level": (("ping", "bin"), np.ones((4, 6)))}, coords={"ping": np.arange(4)})
assert float(picture.level.sum()) == 24 and picture.isel(ping=0).level.values.shape == (6,)
with tempfile.TemporaryDirectory() as folder:
    picture.to_netcdf(folder + "/picture.nc", engine="h5netcdf")
    assert xr.load_dataset(folder + "/picture.nc", engine="h5netcdf").identical(picture)
assert "dask" not in {name.partition(".")[0] for name in sys.modules}
lazy = picture.chunk(ping=2)
import dask.array
masked = xr.DataArray(dask.array.from_array(np.ma.masked_equal(np.arange(4.0), 2.0)))
print(type(lazy.level.data).__module__, float(lazy.level.sum()), np.isnan(masked.compute().values).sum())"""
    assert python(code) == "dask.array.core 24.0 1"


@pytest.mark.parametrize("stub", STUBS)
def test_no_module_takes_the_place_of_a_public_name(stub):
    """Python sets a submodule as an attribute of its package when it is imported, over a function of the same name."""
    homes = homes_of(".".join(stub.relative_to(ROOT).parent.parts), stub)
    assert homes
    for name, home in homes.items():
        is_module = (stub.parent / f"{name}.py").exists() or (stub.parent / name).is_dir()
        assert not is_module or home == f"{'.'.join(stub.relative_to(ROOT).parent.parts)}.{name}", name
