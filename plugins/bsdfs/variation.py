"""Variation of a bed's strength from place to place: attributes that every law of a rough surface has."""
from dataclasses import dataclass

import mitsuba as mi

from mitsonar.device.arrays import arrays_of, upload
from mitsonar.scattering.surfaces.glints import FEWEST, MOST, Glints
from mitsonar.scattering.surfaces.patches import LARGEST_SHAPE, SMALLEST_SHAPE, Patches
from mitsonar.scattering.surfaces.weed import Weed, WeedField
from mitsonar.units import power_from_db

from ..attributes import Angle, Attributes, Number

PATCHES = (
    Number("patchiness", default=None, minimum=SMALLEST_SHAPE, maximum=LARGEST_SHAPE,
           text="shape ν of the gamma distribution by which strength varies between squares, so that echoes are "
                "K-distributed; none where it is not written"),
    Number("patch_size", default=1.0, above=0, unit="m", text="side of these squares"),
    Number("patch_border", default=0.0, minimum=0, unit="m",
           text="width over which one square goes over into the next, at most their side; 0: steps; resolution cells "
                "on a border are less patchy"),
)
GLINTS = (
    Number("glints", default=0.0, minimum=0, maximum=MOST, unit="1/m²",
           text="density of shells and pebbles that stand out of the speckle as strong scatterers, at least "
                f"{FEWEST:g}: 1 to 10 on clean sand, 10 to 100 where shell lies; 0: none; the mean strength stays"),
    Number("glint_share", default=0.3, minimum=0, maximum=1,
           text="of the mean strength that glints have, 0.1 to 0.5; a resolution cell of the area A has the second "
                "moment of K with ν = `glints` A / `glint_share`²"),
)
WEED = (
    Number("weed_cover", default=0.0, minimum=0, maximum=0.999,
           text="share of the bed in patches of weed, of irregular outline; 0: none"),
    Number("weed_db", default=6.0, minimum=-40, maximum=40, unit="dB",
           text="strength of weed over the bed's: 3 to 10 for grass on sand, less than 0 for mud or mats of algae"),
    Number("weed_size", default=4.0, above=0, unit="m", text="width of patches and of gaps between them, about"),
    Number("weed_edge", default=0.5, minimum=0, unit="m",
           text="width over which a patch ends, mean from 10 % to 90 %; 0: steps"),
    Number("weed_stretch", default=1.0, minimum=1, maximum=1000,
           text="length of patches over their width; 5 to 30 make ribbons of sand or gravel"),
    Angle("weed_heading_deg", default=0.0, text="compass direction along which they are long"),
)
VARIATION = *PATCHES, *GLINTS, *WEED


@dataclass(frozen=True, kw_only=True)
class Variation:
    """Variation of a material's strength."""

    patches: Patches | None = None
    weed: WeedField | None = None
    glints: Glints | None = None  # they vary the amplitudes of scatterers, see `echoes.scatterers.scatterers`

    def of(self, strength: mi.Float, place: mi.Point3f, active: mi.Bool | bool) -> mi.Float:
        """Return strengths [-] (R,) of a law as they are at places [m] (R,), means over glints."""
        if self.patches is not None:
            strength = strength * self.patches.at(place.x, place.y, active)
        if self.weed is not None:
            strength = strength * self.weed.at(place.x, place.y)
        return strength


def variation_of(attributes: Attributes) -> Variation:
    """Return the variation of the attributes in `VARIATION`."""
    for first, *others in ([declared.name for declared in kind] for kind in (PATCHES, GLINTS, WEED)):
        if not attributes.given(first) and (written := attributes.given(*others)):
            raise attributes.error(f"{written[0]} is given without {first}; give both or neither.")
    return Variation(patches=_patches(attributes), weed=_weed(attributes), glints=_glints(attributes))


def _patches(attributes):
    if attributes.patchiness is None:
        return None
    if attributes.patch_border > attributes.patch_size:
        raise attributes.error(f"patch_border is {attributes.patch_border:g} m, and patches are "
                               f"{attributes.patch_size:g} m wide; give at most that.")
    return Patches(attributes.patchiness, attributes.patch_size, arrays_of(mi.Float), upload, attributes.patch_border)


def _glints(attributes):
    if not attributes.glints:
        return None
    try:
        return Glints(per_area=attributes.glints, share=attributes.glint_share)
    except ValueError as error:
        raise attributes.error(error) from None


def _weed(attributes):
    if not attributes.weed_cover:
        return None
    return Weed(cover=attributes.weed_cover, strength=float(power_from_db(attributes.weed_db)),
                size=attributes.weed_size, edge=attributes.weed_edge, stretch=attributes.weed_stretch,
                heading=attributes.weed_heading_deg).on(arrays_of(mi.Float))
