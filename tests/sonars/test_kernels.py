"""Kernels depend on what a scene is made of, not on its numbers: another range, sound speed or beam compiles nothing.

The test counts hashes of kernels, so that those which Dr.Jit keeps on disk count as well. In each scene every
number differs from those of all others. A number that stood in a kernel would make another one in every scene.
"""
import gc
import itertools

import drjit as dr
import pytest
from exhaustive import thinned
from numbered_scenes import KINDS, numbered
from sonar_scenes import forward_looking, lambert, sidescan

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


def share_their_kernels(scenes):
    """Hold that no scene has kernels which the first does not have.

    Kernels count the shapes and materials that are alive, also those of other tests, which may go while the first
    scene is rendered. So it is rendered once more where another has a kernel that it did not have: with what is alive
    now, its numbers are still its own.
    """
    gc.collect()
    first, *others = scenes
    known = kernels(first, 0)
    for number, scene in enumerate(others, 1):
        gc.collect()               # materials of a scene that is still there count on from those of the one before
        found = kernels(scene, number)
        if found - known:
            gc.collect()
            known |= kernels(first, 0)
        assert len(found - known) == 0, f"scene {number} compiles {len(found - known)} kernels anew"


@pytest.mark.parametrize("scenes", thinned(SCENES, 2))
@pytest.mark.parametrize("kind", KINDS)
def test_scenes_that_differ_in_numbers_alone_share_their_kernels(variant, rng, kind, scenes):
    share_their_kernels(numbered(kind, rng) for _ in range(scenes))


@pytest.mark.parametrize("sonar", [forward_looking, sidescan])
def test_fields_of_other_numbers_of_targets_share_their_kernels(variant, sonar):
    def scene(number, count):
        shapes = {"seabed": {"type": "seabed", "depth": 14.0, "length": 60.0, "width": 60.0,
                             "spacing": 1.0 - 0.1 * number, "bsdf": lambert(-27.0 - number)},
                  "stones": {"type": "targets", "species": "rounded_stone", "count": count, "seed": number,
                             "area": "4, 4, 14, 14", "bed": {"type": "ref", "id": "seabed"}, "bsdf": lambert(-15.0)}}
        options = ({"sensor": {"receive_elements": 6, "beams": 9}, "integrator": {"cell": 0.3}}
                   if sonar is forward_looking else {"film": {"bins": 60, "range": 25.0}, "integrator": {"rays": 2000}})
        return sonar(shapes, depth=10.0, **options)

    share_their_kernels(itertools.starmap(scene, enumerate((2, 3, 5))))
