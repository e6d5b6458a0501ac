"""Dr.Jit's workers end while NumPy works, so that none looks for work on the cores that it needs."""
import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.turns import workers_ended


@pytest.fixture(autouse=True)
def llvm(variant):
    if not variant.startswith("llvm"):
        pytest.skip("a GPU has no workers")


def test_workers_are_there_again_afterwards_whatever_happens():
    threads = dr.thread_count()
    with workers_ended() as there:
        assert there == threads and dr.thread_count() == 1
        with workers_ended() as fewer:             # as in a function that is called by another
            assert fewer == 1
        assert dr.thread_count() == 1
    assert dr.thread_count() == threads
    with pytest.raises(ZeroDivisionError), workers_ended():
        raise ZeroDivisionError
    assert dr.thread_count() == threads


def test_kernels_run_without_workers():
    numbers = dr.arange(mi.Float, 100_000)
    with workers_ended():
        total = dr.sum(numbers * 2)
        assert total.numpy()[0] == pytest.approx(99_999 * 100_000, rel=1e-6)
    assert (numbers + 1).numpy()[-1] == 100_000


def test_no_thread_looks_for_work_meanwhile():
    """After a kernel a worker would look for work for 20 ms: as much CPU time as passes, with the fewest threads."""
    spent = []
    for _ in range(5):
        dr.eval(numbers := dr.arange(mi.Float, 1 << 20) + 1)
        numbers.numpy()
        with workers_ended():
            before = time.process_time()
            time.sleep(0.02)
            spent.append(time.process_time() - before)
    assert np.median(spent) < 0.005
