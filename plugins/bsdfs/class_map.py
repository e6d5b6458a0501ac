"""Map places to sediments: a texture of class numbers whose borders are gradual."""

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import arrays_of, held
from mitsonar.scattering.surfaces.borders import displacement, drawn

from ..attributes import Attributes, Number, NumberOrTexture, Text

CLASSES = (
    NumberOrTexture("sediment_class", default=None, text="texture of class numbers, from 0, in place of `sediment`"),
    Text("classes", default=None, text='names of these classes: "clay, medium sand, coarse sand"'),
    Number("class_scale", default=1.0, above=0,
           text="what that texture is multiplied by first: 255 for 8-bit images"),
    Number("class_border", default=1.0, minimum=0, unit="pixels",
           text="of a texture made of pixels: width over which one class goes over into the next, patch by patch; 0: "
                "steps"),
    NumberOrTexture("second_class", default=None, text="texture of the class beyond the nearest border"),
    NumberOrTexture("second_share", default=None, text="texture of that one's share, 0 to 1"),
)
TEXTURES = "sediment_class", "second_class", "second_share"


class ClassMap:
    """Return the class numbers at surface interactions."""

    def __init__(self, textures: dict[str, mi.Texture], *, scale: float, count: int, border: float) -> None:
        self.textures, self._scale, self._count = textures, scale, count
        self._lib = arrays_of(mi.Float)
        self._shift = _pixel(textures["sediment_class"]) * border
        # each column: change of u and v for a displacement by w along a side of the pixels
        self._moves = [[dr.opaque(mi.Float, float(part)) for part in row] for row in self._shift]

    def at(self, si: mi.SurfaceInteraction3f, active: mi.Bool | bool) -> mi.UInt32:
        """Return the class number at interactions, UInt32 (R,)."""
        if self._shift.any():
            si = self._displaced(si)
        number = self._read("sediment_class", si, active, self._scale)
        if "second_class" in self.textures:
            share = self.textures["second_share"].eval_1(si, mi.Bool(active))
            there = drawn(self._lib, si.p.x, si.p.y)[0] < share
            number = dr.select(there, self._read("second_class", si, active, self._scale), number)
        return number

    def _read(self, name, si, active, scale):
        return mi.UInt32(held(dr.round(self.textures[name].eval_1(si, active) * scale), 0, self._count - 1))

    def _displaced(self, si):
        """Return the interactions displaced a little, mirrored at the edge of the image."""
        d = displacement(self._lib, si.p.x, si.p.y)
        uv = [self._mirrored(place, row[0] * d[0] + row[1] * d[1]) for place, row in zip((si.uv.x, si.uv.y),
                                                                                     self._moves)]
        aside = mi.SurfaceInteraction3f(si)
        aside.uv = mi.Point2f(*uv)
        return aside

    @staticmethod
    def _mirrored(place, shift):
        there = place + shift
        off = (place >= 0) & (place <= 1) & ((there < 0) | (there > 1))
        return dr.select(off, place - shift, there)


def class_map_of(attributes: Attributes, names: list[str]) -> ClassMap | None:
    """Return the map of the classes of these names, or None."""
    written = attributes.given("class_scale", "class_border", "second_class", "second_share")
    if attributes.sediment_class is None:
        if written:
            raise attributes.error(f"{written[0]} is written without sediment_class; leave it out.")
        return None
    textures = {name: value for name in TEXTURES if (value := getattr(attributes, name)) is not None}
    for name, value in textures.items():
        if isinstance(value, float):
            what = "class numbers" if name != "second_share" else "shares"
            raise attributes.error(f"{name} is a number; give a texture of {what}, or one sediment by name.")
    if len(textures) == 2:
        raise attributes.error(f"{list(textures)[1]} is written alone; give second_class and second_share, or neither.")
    made_of_pixels = bool(_pixel(attributes.sediment_class).any())
    if attributes.given("class_border") and not made_of_pixels:
        raise attributes.error("class_border is written, but sediment_class has no pixels; give second_class and "
                               "second_share in its place.")
    return ClassMap(textures, scale=attributes.class_scale, count=len(names),
                    border=attributes.class_border if made_of_pixels and len(textures) == 1 else 0.0)


def _pixel(texture):
    """Return the sides of a pixel (u and v, columns) in texture coordinates; zeros for a texture without pixels."""
    parameters = mi.traverse(texture)
    if "to_uv" not in parameters or "data" not in parameters:
        return np.zeros((2, 2))
    height, width = np.array(parameters["data"].shape)[:2]
    matrix = np.array(parameters["to_uv"].matrix, float).reshape(-1, np.shape(parameters["to_uv"].matrix)[-1])
    return np.linalg.inv(matrix[:2, :2]) @ np.diag([1 / width, 1 / height])
