"""Dr.Jit's workers end while NumPy works, so that none looks for work on the cores that it needs."""
import time

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

import mitsonar.scene.loading
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


def test_one_thread_reads_images(tmp_path, two_threads):
    """Mitsuba's reader of EXR waits for a worker forever where there is none."""
    mi.Bitmap(np.ones((4, 4, 3), np.float32)).write(str(tmp_path / "grey.exr"))
    (tmp_path / "scene.xml").write_text("""<scene version="3.0.0"><shape type="rectangle"><bsdf type="diffuse">
        <texture type="bitmap" name="reflectance"><string name="filename" value="grey.exr"/></texture>
        </bsdf></shape></scene>""", encoding="utf-8")
    mitsonar.scene.loading.prepare()               # which leaves the number of threads alone from here on
    threads = dr.thread_count()
    try:
        dr.set_thread_count(1)
        assert len(mitsonar.load_file(tmp_path / "scene.xml").shapes()) == 1
        assert dr.thread_count() == 1
    finally:
        dr.set_thread_count(threads)
