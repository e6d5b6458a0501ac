"""Kernels depend on what a scene is made of, not on its numbers: another range, sound speed or beam compiles nothing.

The test counts hashes of kernels, so that those which Dr.Jit keeps on disk count as well. In each scene every
number differs from those of all others. A number that stood in a kernel would make another one in every scene.
"""
import gc

import drjit as dr
import pytest
from exhaustive import thinned
from numbered_scenes import KINDS, numbered

import mitsonar

# A number in a kernel shows in the second scene. Of six kinds the last 16 of 20 scenes found nothing more. Of the
# synthetic aperture only 6 were counted, whose last compiled 2 kernels in the focuser.
SCENES = [2, 4]


def kernels(scene, seed):
    """The hashes of the kernels that render a scene."""
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        mitsonar.render(scene, seed)
        return {entry["hash"] for entry in dr.kernel_history([dr.KernelType.JIT])}


@pytest.mark.parametrize("scenes", thinned(SCENES, 2))
@pytest.mark.parametrize("kind", KINDS)
def test_scenes_that_differ_in_numbers_alone_share_their_kernels(variant, rng, kind, scenes):
    first = None
    for number in range(scenes):
        found = kernels(numbered(kind, rng), number)
        gc.collect()               # materials of a scene that is still there count on from those of the one before
        first = first or found
        assert len(found - first) == 0, f"scene {number} of {kind} compiles {len(found - first)} kernels anew"
