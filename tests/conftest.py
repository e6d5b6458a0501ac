"""What all tests share: libLLVM chosen before Dr.Jit is imported, the variants, one random generator."""
import multiprocessing
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

import mitsonar  # noqa: F401  (chooses libLLVM: must come before anything that imports Dr.Jit)


def pytest_addoption(parser):
    parser.addoption("--variants", default="llvm_ad_mono",
                     help="Mitsuba variants, separated by commas, in which tests with the fixture `variant` run")
    parser.addoption("--regenerate", action="store_true", help="rewrite the stored results of tests/regression")


def pytest_configure():
    # In the background of a shell, and by many a job runner, Ctrl-C is ignored: by every child too that a test starts
    # and interrupts.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)


TYPE_CHECKER = pytest.StashKey()   # of the whole suite: it runs beside the other tests, which leave half a core idle
WHOLE_SUITE = 1000                 # tests


def pytest_collection_finish(session):
    """Start pyright, which takes most of a minute of one core, where many other tests run before it is asked for."""
    asked = any(item.name == "test_pyright_finds_nothing" for item in session.items)
    alone = not hasattr(session.config, "workerinput")         # not one of several processes
    if alone and asked and len(session.items) > WHOLE_SUITE and not session.config.option.collectonly:
        output = tempfile.TemporaryFile("w+", encoding="utf-8")
        program = Path(__file__).with_name("inputs") / "typed_sources.py"
        child = subprocess.Popen([sys.executable, str(program)], stdin=subprocess.DEVNULL, stdout=output,
                                 stderr=subprocess.STDOUT)
        session.config.stash[TYPE_CHECKER] = child, output


def pytest_unconfigure(config):
    child, _ = config.stash.get(TYPE_CHECKER, (None, None))
    if child is not None and child.poll() is None:
        child.terminate()
        child.wait()


@pytest.fixture
def type_checker(request):
    """The child that runs beside the tests since the suite began, and the file it writes to; None, None without."""
    return request.config.stash.get(TYPE_CHECKER, (None, None))


def pytest_generate_tests(metafunc):
    if "variant" in metafunc.fixturenames:
        metafunc.parametrize("variant", metafunc.config.getoption("--variants").split(","), indirect=True)


def pytest_collection_modifyitems(items):
    for item in items:
        parameters = item.callspec.params if hasattr(item, "callspec") else {}
        if str(parameters.get("variant")).startswith("cuda"):
            item.add_marker(pytest.mark.gpu)


def pytest_runtest_setup(item):
    if item.get_closest_marker("gpu"):
        import drjit as dr

        if not dr.has_backend(dr.JitBackend.CUDA):
            pytest.skip("no usable CUDA device here")


@pytest.fixture
def variant(request):
    """The name of a Mitsuba variant that is set and in which kernels compile."""
    import drjit as dr
    import mitsuba as mi

    if request.param.startswith("scalar") or request.param not in mi.variants():
        raise pytest.UsageError(f"--variants takes JIT variants of {mi.variants()}, not {request.param}")
    mi.set_variant(request.param)
    # One thread makes Mitsuba's EXR reader and writer wait for ever.
    dr.set_thread_count(max(2, dr.thread_count()))
    return request.param


@pytest.fixture(scope="session")
def dask_workers():
    """Asked for by tests that start workers of Dask: a few semaphores each, which may find no room."""
    try:
        [multiprocessing.Semaphore() for _ in range(32)]
    except (ImportError, OSError) as error:        # the former where there is no such thing at all
        pytest.skip(f"no semaphores for Dask's workers, which stand in /dev/shm on Linux: {error}")


@pytest.fixture
def rng():
    """A NumPy random generator with the same numbers for every test and run."""
    import numpy as np

    return np.random.default_rng(20240611)
