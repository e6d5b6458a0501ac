"""Attributes of a bed's patches, glints and weed: what they make, and what is refused."""
import mitsuba as mi
import pytest

from mitsonar.scene.loading import prepare


@pytest.fixture(scope="module", autouse=True)
def ready():
    prepare()


def material(kind="lambert", **attributes):
    return mi.load_dict({"type": kind, **attributes})


@pytest.mark.parametrize("kind", ["lambert", "sediment", "elastic"])
def test_every_law_of_a_rough_surface_has_them(kind):
    varied = material(kind, glints=5.0, weed_cover=0.2, patchiness=3.0)
    assert (varied.glints.per_area, varied.glints.share) == (5.0, pytest.approx(0.3))
    assert varied.variation.weed is not None and varied.variation.patches is not None


@pytest.mark.parametrize("attributes", [{}, {"glints": 0.0, "glint_share": 0.2}, {"weed_cover": 0.0, "weed_db": 3.0}])
def test_none_of_them_is_no_variation(attributes):
    plain = material(**attributes)
    assert plain.glints is None and plain.variation.weed is None and plain.variation.patches is None


@pytest.mark.parametrize("attributes, words", [
    ({"glint_share": 0.2}, "glint_share is given without glints"),
    ({"weed_edge": 0.2}, "weed_edge is given without weed_cover"),
    ({"patch_size": 0.2}, "patch_size is given without patchiness"),
    ({"glints": 0.01}, "glints are 0.01 per m²; give 0.1 to 10000"),
    ({"glints": 5.0, "glint_share": 1.5}, "glint_share"), ({"weed_cover": 1.0}, "weed_cover")])
def test_what_does_not_go_together_is_refused(attributes, words):
    with pytest.raises(Exception, match=words):
        material(**attributes)
