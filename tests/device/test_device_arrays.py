"""Arrays on the device: work where a mask holds; one alignment of all copies, which Dr.Jit compiles into kernels."""
import drjit as dr
import numpy as np
import pytest
from drjit.auto import Bool, Float, Float64, UInt32

from mitsonar.device.arrays import upload, where_any


@pytest.mark.parametrize("share", [0.0, 0.01, 1.0])
def test_work_where_a_mask_holds_scatters_those_entries(variant, rng, share):
    chosen, values = rng.random(5000) < share, rng.random(5000).astype(np.float32)
    count, total, number = dr.zeros(UInt32, 64), dr.zeros(UInt32, 64), dr.arange(UInt32, 5000)
    mask, value = upload(UInt32, chosen.astype(np.uint32)) != 0, upload(Float, values)

    def add(active: Bool) -> None:
        dr.scatter_add(count, UInt32(1), number % 64, active)
        dr.scatter_add(total, UInt32(value * 1000), number % 64, active)

    where_any(mask, add)
    dr.eval(count, total)
    at = np.arange(5000) % 64
    np.testing.assert_array_equal(count.numpy(), np.bincount(at[chosen], minlength=64))
    np.testing.assert_array_equal(total.numpy(), np.bincount(
        at[chosen], weights=(values[chosen] * np.float32(1000)).astype(np.uint32), minlength=64))


def kernels(values):
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        dr.eval(dr.sqrt(upload(Float64, values)) + 1)
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.float64])
@pytest.mark.parametrize("first", [0, 1, 3])
def test_values_of_any_type_and_place_use_the_same_kernel(variant, kind, first):
    values = np.arange(2000).astype(kind)[first:first + 1500]
    assert kernels(values) == kernels(np.arange(1500.0))
    np.testing.assert_array_equal(upload(Float64, values).numpy(), values)
