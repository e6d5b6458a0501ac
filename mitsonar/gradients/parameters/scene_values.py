"""Read and write parameters of a scene as NumPy arrays, and attach them as leaves of gradients.

Values are written through `mi.traverse` and its `update`, so that plugins rebuild anything derived from a parameter.
Arrays of vectors have one vector per row; all others have Mitsuba's shape. The ``to_world`` of a sphere, cylinder, disk
or rectangle is a matrix (4, 4), whose last row stays 0, 0, 0, 1.
"""
from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from mitsonar.device.spelling import meant
from mitsonar.scene.protocols import is_sea_surface, target_shape

from ..attached.shapes import as_taken, kind_of
from ..model import Values

_attached: list[SceneValues] = []    # whose leaves are in a scene now: calls look into all materials, of any scene

VECTORS = ("vertex_positions", "vertex_normals", "position_offset", "attitude_offset", "tx_position", "rx_position")
OF_EVERY_MESH = "vertex_positions", "vertex_normals", "vertex_texcoords"
DERIVED = "vertex_normals", "vertex_texcoords"         # normals follow positions; sound reads no others
POSE = "to_world"
OF_ELEMENTS = "tx_position", "rx_position", "tx_delay", "rx_delay", "tx_weight", "rx_weight"
UNITS = {POSE: "1 and m", "vertex_positions": "m", "position_offset": "m", "attitude_offset": "rad",
         "sound_speed": "m/s", "absorption_offset": "dB/m", "absorption_db": "dB/m", "strength": "1", "mu_db": "dB",
         "target_strength_db": "dB", "position": "m"}


def differentiable(scene: mi.Scene) -> list[str]:
    """Return the names of a scene's parameters with gradients."""
    parameters = mi.traverse(scene)
    still, moving = _still(scene, parameters), _transforms(scene)
    return [key for key in parameters.keys() if parameters.flags(key) & mi.ParamFlags.NonDifferentiable.value == 0
            and key.rpartition(".")[2] not in DERIVED and key not in still
            and (key in moving or not _is_transform(parameters[key]))]


def _is_transform(value: Any) -> bool:
    return hasattr(value, "inverse_transpose")


def _transforms(scene: mi.Scene) -> dict[str, int]:
    """Return the names of differentiable poses, of shapes without facets, with the kinds of the shapes."""
    return {f"{shape.id()}.{POSE}": kind_of(shape) for shape in scene.shapes() if kind_of(shape) and shape.id()}


def _still(scene: mi.Scene, parameters: mi.SceneParameters) -> dict[str, str]:
    """Return the parameters that Mitsuba calls differentiable and echoes do not follow, with the reason."""
    shapes = {shape.id(): shape for shape in scene.shapes()}
    found = {}
    for key in parameters.keys():
        owner, _, name = key.rpartition(".")
        if target_shape(shapes.get(key.partition(".")[0])) is not None:
            found[key] = ("a point target's echo stands still in mean levels; mitsonar.differentiable_signals and "
                          "coherent_model move it")
        elif name in OF_ELEMENTS:
            found[key] = ("elements stand still in mean levels; mitsonar.differentiable_signals and coherent_model "
                          "move them")
        elif name == "vertex_positions" and is_sea_surface(shapes.get(owner)):
            found[key] = "the sea surface stands still in gradients"
        elif name == "vertex_positions" and "." in owner and owner not in shapes:
            found[key] = "what instances show stands still in gradients; put the mesh itself into the scene"
    return found


def check_followed(scene: mi.Scene) -> None:
    """Refuse parameters with gradients that levels do not follow: these gradients would be zero."""
    parameters = mi.traverse(scene)
    for key, reason in _still(scene, parameters).items():
        value = parameters[key]
        if dr.is_diff_v(value) and dr.grad_enabled(value):
            raise ValueError(f"{key!r} carries a gradient, and has none: {reason}")


class SceneValues:
    """Read and write some parameters of a scene."""
    # start [str, array]; units [str, str]

    def __init__(self, scene: mi.Scene, keys: Sequence[str]):
        self._parameters = mi.traverse(scene)
        known = differentiable(scene)
        if not keys:
            raise ValueError(f"no parameter was asked for; give one or more of {', '.join(known)}")
        for key in keys:
            if key not in known and (reason := _still(scene, self._parameters).get(key)):
                raise ValueError(f"{key!r} has no gradient: {reason}")
            owner, _, name = key.rpartition(".")
            if name == POSE and f"{owner}.vertex_positions" in known:
                raise ValueError(f"a mesh such as {owner!r} has no {key!r}: its vertices are where they are; take "
                                 f"{owner}.vertex_positions, or its pose by parametrisation.Pose")
            if key not in known:
                raise ValueError(f"the scene has no parameter {key!r} that gradients could be of{meant(key, known)}; "
                                 f"it has {', '.join(known)}")
        self.keys, self._kinds = tuple(dict.fromkeys(keys)), _transforms(scene)
        self._holder: AttachedValues | None = None      # whose leaves are in the scene now
        self.start = {key: self._array(key) for key in self.keys}
        self.units = {key: UNITS.get(key.rpartition(".")[2], "") for key in self.keys}

    def _array(self, key: str) -> np.ndarray:
        value = self._parameters[key]
        if _is_transform(value):
            return np.array(dr.detach(value.matrix), float).reshape(4, 4)
        value = dr.detach(value)
        array = np.array(value, float)
        if array.ndim > 1 and not dr.is_tensor_v(value):               # Dr.Jit's vectors have their axis first
            array = array.T
        return array.reshape(-1, 3) if key.rpartition(".")[2] in VECTORS else array

    def write(self, values: Values) -> None:
        """Write values into the scene; parameters that are left out have their start values."""
        checked, self._holder = self.checked(values), None
        for key in self.keys:
            new = checked.get(key, self.start[key])
            if not np.array_equal(new, self._array(key)):
                self._parameters[key] = self._put(key, self.value(key, new))
        self._parameters.update()

    def checked(self, values: Values) -> dict[str, np.ndarray]:
        """Return arrays with checked names and shapes, or raise ValueError."""
        found = {}
        for key, value in values.items():
            if key not in self.start:
                raise ValueError(f"{key!r} is none of the parameters{meant(key, self.keys)}: {', '.join(self.keys)}")
            array, shape = np.asarray(value, float), self.start[key].shape
            if array.shape != shape:
                raise ValueError(f"{key} has the shape {array.shape}; give {shape}")
            if not np.all(np.isfinite(array)):
                raise ValueError(f"{key} holds numbers that are not finite")
            found[key] = array
        return found

    def _put(self, key: str, value: Any) -> Any:
        """Return a value in the scene's type: for a matrix, the transform."""
        return type(self._parameters[key])(value) if key in self._kinds else value

    def direction(self, key: str, array: np.ndarray) -> Any:
        """Return a direction in Mitsuba's type."""
        return mi.Matrix4f(array) if key in self._kinds else self.value(key, array)

    def value(self, key: str, array: np.ndarray) -> Any:
        """Return an array in Mitsuba's type: for a transform, its matrix."""
        kind = type(self._parameters[key])
        if key in self._kinds:
            return mi.Matrix4f(as_taken(self._kinds[key], array, key))
        if kind is float:
            return float(array)
        if dr.is_tensor_v(kind):
            return kind(np.ascontiguousarray(array, np.float32))
        if dr.depth_v(kind) > 1:
            return kind(*np.atleast_2d(array).T.tolist()) if array.ndim > 1 else kind(*array.tolist())
        wide = np.float64 if dr.type_v(kind) == dr.VarType.Float64 else np.float32
        return kind(np.ascontiguousarray(array.ravel(), wide))

    def attached(self) -> AttachedValues:
        """Return the parameters as leaves in the scene."""
        leaves = {}
        for key in self.keys:
            leaf = self.value(key, self._array(key))
            dr.enable_grad(leaf)
            leaves[key] = leaf
        found = AttachedValues(self, leaves)
        self.hold(found, leaves)
        return found

    def is_read(self, key: str) -> bool:
        """Return True for the vertices of a mesh with attributes of its own, which textures may read."""
        mesh, _, name = key.rpartition(".")
        own = (other.removeprefix(f"{mesh}.") for other in self._parameters.keys() if other.startswith(f"{mesh}."))
        return name == "vertex_positions" and any(
            other.startswith(("vertex_", "face_")) and other not in OF_EVERY_MESH for other in own)

    def give_up(self, holder: AttachedValues) -> None:
        """Mark a holder's leaves as to be written again at the next call of `hold`."""
        if self._holder is holder:
            self._holder = None

    def hold(self, holder: AttachedValues, leaves: Mapping[str, mi.Float64]) -> None:
        """Write leaves into the scene, unless they are there; nothing else in it carries gradients then."""
        if self._holder is holder:
            return
        while _attached:
            _attached.pop().let_go()
        for key in self._parameters.keys():                            # an earlier model's would push along with ours
            if key not in leaves and dr.grad_enabled(self._parameters[key]):
                self._parameters[key] = dr.detach(self._parameters[key])
        for key, leaf in leaves.items():
            self._parameters[key] = self._put(key, leaf)
        self._parameters.update()
        self._holder = holder
        _attached.append(self)

    def let_go(self) -> None:
        """Detach the values in the scene: products of another model would fail at them."""
        self._holder = None
        for key in self.keys:
            if dr.grad_enabled(self._parameters[key]):
                self._parameters[key] = dr.detach(self._parameters[key])
        self._parameters.update()


class AttachedValues:
    """Hold leaves of a scene's parameters."""
    # leaves [str, Dr.Jit array]

    def __init__(self, values: SceneValues, leaves: Mapping[str, mi.Float64]):
        self._values, self._leaves = values, dict(leaves)

    def hold(self) -> None:
        """Write the leaves into the scene again."""
        self._values.hold(self, self._leaves)

    def directions(self, tangents: Values) -> dict[str, np.ndarray]:
        """Return directions of all leaves, 0 where none is given."""
        checked = self._values.checked(tangents)
        return {key: checked.get(key, np.zeros_like(start)) for key, start in self._values.start.items()}

    def set_tangents(self, directions: Mapping[str, np.ndarray]) -> None:
        """Set the tangents of the leaves, and propagate them to copies in plugins.

        A texture keeps a copy of its data, and Dr.Jit needs the tangents of the copy before a law is called. This uses
        up the graph from the leaf to the copy, which is made anew. The same holds for a mesh that a texture reads.
        """
        copied = [key for key, leaf in self._leaves.items() if dr.is_tensor_v(leaf) or self._values.is_read(key)]
        if copied:
            for key in copied:                             # what earlier products left behind leads on from old leaves
                self._leaves[key] = type(self._leaves[key])(dr.detach(self._leaves[key]))
                dr.enable_grad(self._leaves[key])
            self._values.give_up(self)
            self.hold()
        for key, leaf in self._leaves.items():
            dr.clear_grad(leaf)
            dr.set_grad(leaf, self._values.direction(key, directions[key]))
        if copied:
            for key in copied:
                dr.enqueue(dr.ADMode.Forward, self._leaves[key])
            dr.traverse(dr.ADMode.Forward, flags=dr.ADFlag.ClearEdges)
            self._values.give_up(self)

    def clear(self) -> None:
        """Clear the gradients."""
        dr.clear_grad(self._leaves)

    def gradients(self) -> dict[str, np.ndarray]:
        """Return the gradients of the leaves, and clear them."""
        found = {}
        for key, leaf in self._leaves.items():
            array = np.array(dr.grad(leaf), float)
            if array.ndim > 1 and not dr.is_tensor_v(leaf) and not dr.is_matrix_v(leaf):
                array = array.T
            found[key] = array.reshape(self._values.start[key].shape)
        self.clear()
        return found
