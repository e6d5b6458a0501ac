"""What is copied to the device has one alignment, whatever it was before: Dr.Jit compiles it into kernels."""
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from mitsonar.device.arrays import upload


def kernels(values):
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        dr.eval(dr.sqrt(upload(mi.Float64, values)) + 1)
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}


@pytest.mark.parametrize("kind", [np.float32, np.int64, np.float64])
@pytest.mark.parametrize("first", [0, 1, 3])
def test_values_of_any_type_and_place_use_the_same_kernel(variant, kind, first):
    values = np.arange(2000).astype(kind)[first:first + 1500]
    assert kernels(values) == kernels(np.arange(1500.0))
    np.testing.assert_array_equal(upload(mi.Float64, values).numpy(), values)
