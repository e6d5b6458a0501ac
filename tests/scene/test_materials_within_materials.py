"""What a material holds, when what it holds is shared: each part once, however many ways lead to it."""
from mitsonar.scene import materials


def test_shared_parts_are_found_once(variant):
    import mitsuba as mi

    part = mi.load_dict({"type": "diffuse"})
    for _ in range(5):
        part = mi.load_dict({"type": "blendbsdf", "weight": 0.5, "first": part, "second": part})
    found = materials._inside(part)
    # of each level a weight, of each but the first what it holds, and the reflectance of the last
    assert len(found) == len({id(part) for part in found}) == 11
