"""What all tests share: libLLVM chosen before Dr.Jit is imported, the variants, memory given back, one generator."""
import ctypes
import gc
import multiprocessing
import os
import re
import signal
import sys

import pytest

import mitsonar.device.turns  # chooses libLLVM: must come before anything that imports Dr.Jit

# For the processes of pytest-xdist, which take the cores already, and for those that tests start. Threads of OpenBLAS
# wait for each other by spinning: 200 SVDs of 200 x 200 on two busy cores take 14 s of CPU with two, 1.5 s with one.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_addoption(parser):
    parser.addoption("--variants", default="llvm_ad_mono",
                     help="Mitsuba variants, separated by commas, in which tests with the fixture `variant` run")
    parser.addoption("--regenerate", action="store_true", help="rewrite the stored results of tests/regression")


def pytest_configure(config):
    # In the background of a shell, and by many a job runner, Ctrl-C is ignored: by every child too that a test starts
    # and interrupts.
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    # Files begin in the order in which they were collected, also where pytest-xdist shares them out.
    config.option.loadscopereorder = False


def pytest_generate_tests(metafunc):
    if "variant" in metafunc.fixturenames:
        metafunc.parametrize("variant", metafunc.config.getoption("--variants").split(","), indirect=True)


# Files of minutes come first: at the end they would leave the other process of two without work.
FIRST = ("tests/structure/test_linters.py", "tests/structure/test_documentation.py")


def pytest_collection_modifyitems(config, items):
    for item in items:
        parameters = item.callspec.params if hasattr(item, "callspec") else {}
        if str(parameters.get("variant")).startswith("cuda"):
            item.add_marker(pytest.mark.gpu)
    items.sort(key=lambda item: not item.nodeid.startswith(FIRST))
    if not re.search(r"\bexhaustive\b", config.option.markexpr) and not any("::" in one for one in config.args):
        kept = [item for item in items if item.get_closest_marker("exhaustive") is None]
        config.hook.pytest_deselected(items=[item for item in items if item.get_closest_marker("exhaustive")])
        items[:] = kept


def pytest_collection_finish():
    """What was imported and collected stays: collections of garbage need not look at it again and again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_teardown(item, nextitem):
    """Release the memory that Dr.Jit holds for arrays to come, and the pictures that a file keeps for its own tests.

    Without, a process of the suite grows beyond 3 GB. Kernels take no part in it: without them 2 MB less.
    """
    yield
    if nextitem is None or nextitem.path != item.path:
        for one in vars(item.module).values():
            if hasattr(one, "cache_clear") and one.__module__ == item.module.__name__:
                one.cache_clear()
        gc.collect()
    if (drjit := sys.modules.get("drjit")) is not None:
        drjit.flush_malloc_cache()
    if sys.platform == "linux" and (nextitem is None or nextitem.path != item.path):
        getattr(ctypes.CDLL(None), "malloc_trim", int)(0)         # which musl has not


def pytest_runtest_setup(item):
    if (drjit := sys.modules.get("drjit")) is not None:
        # Processes of pytest-xdist take the cores already: beside each other they are a fifth faster without Dr.Jit's
        # workers, which look for work for 20 ms after a kernel.
        drjit.set_thread_count(1 if "PYTEST_XDIST_WORKER" in os.environ else max(2, drjit.thread_count()))
    if item.get_closest_marker("gpu"):
        import drjit as dr

        if not dr.has_backend(dr.JitBackend.CUDA):
            pytest.skip("no usable CUDA device here")


@pytest.fixture
def variant(request):
    """The name of a Mitsuba variant that is set and in which kernels compile."""
    import mitsuba as mi

    if request.param.startswith("scalar") or request.param not in mi.variants():
        raise pytest.UsageError(f"--variants takes JIT variants of {mi.variants()}, not {request.param}")
    mi.set_variant(request.param)
    return request.param


@pytest.fixture
def two_threads():
    """For tests in which Mitsuba itself reads or writes EXR: with one thread it waits forever."""
    with mitsonar.device.turns.at_least_two_threads():
        yield


@pytest.fixture
def exact(variant):
    """For tests that compare bits: on a GPU they skip."""
    if variant.startswith("cuda"):
        pytest.skip("sums on a GPU are atomic: their last bits vary")


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
