"""Seabed of measured backscatter strength (`empirical`): a table against grazing angle, from a CSV file.

The strength from one angle to another is the mean of both in dB, see `mitsonar.scattering.laws.empirical`.

.. code-block:: xml

    <bsdf type="empirical" id="measured"><string name="filename" value="backscatter.csv"/></bsdf>
"""
import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.arrays import upload
from mitsonar.io.scene_files import backscatter

from ..attributes import Attributes, File
from .material import COHERENCE, Material
from .variation import VARIATION, variation_of

ATTRIBUTES = (
    File("filename", text="CSV: grazing angle [deg], strength [dB]; for several frequencies one column each, called as "
                          '"100 kHz"; the nearest holds beyond them'),
    COHERENCE, *VARIATION,
)


class Empirical(Material):
    """Material with a measured law."""

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        self.variation, self.coherence = variation_of(attributes), attributes.coherence
        self.textured = isinstance(self.coherence, mi.Texture)
        try:
            table = backscatter.read(attributes.filename)
        except ValueError as error:
            raise attributes.error(error) from None
        super().__init__(props)
        self.table = table
        self.angles = upload(mi.Float, table.angles.astype(np.float32))
        self.log_frequencies = upload(mi.Float, np.log(np.asarray(table.frequencies)).astype(np.float32))
        self.strengths_db = upload(mi.Float, table.strengths_db.astype(np.float32))
        dr.eval(self.angles, self.log_frequencies, self.strengths_db)

    def traverse(self, callback: mi.TraversalCallback) -> None:
        super().traverse(callback)
        callback.put("strengths_db", self.strengths_db, mi.ParamFlags.Differentiable)

    def scattering_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                            sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return σ of the law: the geometric mean of the backscatter strengths at both angles."""
        place = _place(self.log_frequencies, dr.log(frequency))
        both = self._half_db(wi, place) + self._half_db(wo, place)
        return dr.select(active, dr.exp(float(np.log(10) / 10) * both) * self._below(wi) * self._below(wo), 0)

    def _half_db(self, w, columns):
        """Return half the backscatter strength [dB] at a direction's grazing angle, held below the first angle."""
        width = len(self.log_frequencies)
        row, rest = _place(self.angles, dr.atan2(w.z, dr.sqrt(w.x * w.x + w.y * w.y)))
        column, part = columns
        found = 0
        for k, share in ((0, 1 - rest), (1, rest)):
            line = dr.minimum(row + k, len(self.angles) - 1) * width
            for j, portion in ((0, 1 - part), (1, part)):
                at = line + dr.minimum(column + j, width - 1)
                found += share * portion * dr.gather(mi.Float, self.strengths_db, at)
        return 0.5 * found

    def _below(self, w):
        """Return the decrease of the root of σ_b below the first angle of the table."""
        return dr.clip(w.z * float(1 / np.sin(self.table.angles[0])), 0, 1)

    def to_string(self) -> str:
        return f"Empirical[{self.table.name}]"


def _place(nodes, value):
    """Return the index of the node before each value, and how far it lies towards the next, 0..1, held beyond."""
    count = len(nodes)
    if count == 1:
        return mi.UInt32(0), mi.Float(0)
    after = dr.binary_search(1, count - 1, lambda index: dr.gather(mi.Float, nodes, index) <= value)
    index = mi.UInt32(after) - 1
    low, high = (dr.gather(mi.Float, nodes, index + k) for k in range(2))
    return index, dr.clip((value - low) / (high - low), 0, 1)


mi.register_bsdf("empirical", Empirical)
