"""Protocols of mitsonar's materials and shapes, and the functions that recognise them among Mitsuba's own.

Plugins stand above scenes, and Mitsuba makes their classes anew for every variant. They are therefore recognised by
their members; `plugins/contracts.py` makes type checkers compare every plugin with its protocol.
"""
from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

if TYPE_CHECKING:
    import mitsuba as mi
    import numpy as np

    from mitsonar.scattering.bodies.scattering_functions import ScatteringFunction
    from mitsonar.scattering.surfaces.glints import Glints


@runtime_checkable
class SoundMaterial(Protocol):
    """Material that scatters or reflects by a law of frequency and sound speed; see `plugins.bsdfs.material`."""

    @property
    def textured(self) -> bool:
        """Return True if any parameter is read from a texture."""
        ...

    @property
    def smooth(self) -> bool:
        """Return True if it reflects and scatters nothing; it is then a `SmoothMaterial`."""
        ...

    @property
    def reflects(self) -> bool:
        """Return True if it has a coherent reflection coefficient."""
        ...

    @property
    def mirror(self) -> bool:
        """Return True if it mirrors all sound, as a calm sea surface does."""
        ...

    @property
    def coherence(self) -> float | mi.Texture:
        """Return the coherence of its scatterers between any two passes."""
        ...

    @property
    def glints(self) -> Glints | None:
        """Return the strong scatterers among its scatterers."""
        ...

    def check(self, frequency: float, sound_speed: float) -> None:
        """Refuse frequencies [Hz] and sound speeds [m/s] outside the validity of the law."""
        ...

    def patchy_strength(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                        sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return the scattering strength σ [-] (R,) between directions wi and wo."""
        ...

    def coherence_at(self, si: mi.SurfaceInteraction3f, active: mi.Bool | bool = True) -> mi.Float:
        """Return the coherence (R,) at interactions."""
        ...

    def coherent_reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                            sound_speed: mi.Float, lowest_wavenumber: mi.Float,
                            active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return the real and imaginary parts (R,) of the coherent reflection coefficient, for e^(+iωt)."""
        ...

    def drawn_direction(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, frequency: mi.Float, sound_speed: mi.Float,
                        sample1: mi.Float, sample2: mi.Point2f, active: mi.Bool | bool = True) -> mi.Vector3f:
        """Draw the directions (R,) of scattered rays."""
        ...

    def direction_density(self, si: mi.SurfaceInteraction3f, wi: mi.Vector3f, wo: mi.Vector3f, frequency: mi.Float,
                          sound_speed: mi.Float, active: mi.Bool | bool = True) -> mi.Float:
        """Return the density of `drawn_direction` [1/sr]."""
        ...


@runtime_checkable
class SmoothMaterial(SoundMaterial, Protocol):
    """Material of a smooth surface."""

    def reflection(self, si: mi.SurfaceInteraction3f, sin_grazing: mi.Float, frequency: mi.Float,
                   sound_speed: mi.Float, active: mi.Bool | bool = True) -> tuple[mi.Float, mi.Float]:
        """Return the real and imaginary parts (R,) of the reflection coefficient, for e^(+iωt)."""
        ...


@runtime_checkable
class TargetShape(Protocol):
    """Point target: a shape without facets that rays pass."""

    position: np.ndarray  # (3,) [m]
    target_strength_db: float  # [dB re 1 m²]; NaN if a function of its own scatters
    scattering: ScatteringFunction | None
    rotation: np.ndarray | None  # (3, 3): from the target's axes to the scene's, if it has a function

    def id(self) -> str:
        """Return the name of the shape."""
        ...


@runtime_checkable
class PartedShape(Protocol):
    """Mesh of several parts with names of their own."""

    part_names: tuple[str, ...]
    part_of_face: np.ndarray  # (F,)


@runtime_checkable
class StrewnShape(PartedShape, Protocol):
    """Mesh of targets that were placed at random."""

    @property
    def placed(self) -> Mapping[str, Mapping[str, Any]]:
        """Return entries of the attribute ``objects`` of images, any text or numbers, by the names of parts."""
        ...


@runtime_checkable
class BedShape(Protocol):
    """Shape that may be a seabed."""

    seabed: bool


@runtime_checkable
class SeaSurfaceShape(Protocol):
    """Shape that may be the sea surface."""

    sea_surface: bool


@runtime_checkable
class ShapeWithNormals(Protocol):
    """Mesh that may scatter by normals interpolated between its vertices."""

    smooth_normals: bool


@runtime_checkable
class LocatedShape(Protocol):
    """Shape that has a place on Earth."""

    @property
    def local_origin(self) -> tuple[float, float] | None:
        """Return east and north of the scene's origin [m]."""
        ...

    @property
    def crs(self) -> str | None:
        """Return the coordinate system of `local_origin`."""
        ...


@runtime_checkable
class SceneSonar(Protocol):
    """Sensor that is a sonar, no camera."""

    kind: str
    provenance: dict[str, object] | None  # attributes of results that name the scene: text and parameters of any type
    loaded: dict[str, object] | None  # values of the scene as it was loaded, see `alterations`
    path: str | None  # of the scene's file


def sound_material(bsdf: mi.Object) -> SoundMaterial | None:
    """Return a material of mitsonar's; None for other objects of Mitsuba's."""
    return bsdf if isinstance(bsdf, SoundMaterial) else None


def smooth_material(bsdf: mi.Object) -> SmoothMaterial | None:
    """Return a smooth material; None for others."""
    return bsdf if isinstance(bsdf, SmoothMaterial) and bsdf.smooth else None


def is_smooth(shape: mi.Shape) -> bool:
    """Return True if a shape's material is smooth."""
    return smooth_material(shape.bsdf()) is not None


def is_mirror(shape: mi.Shape) -> bool:
    """Return True if a shape's material mirrors all sound."""
    material = sound_material(shape.bsdf())
    return material is not None and material.mirror


def target_shape(shape: mi.Shape | None) -> TargetShape | None:
    """Return a point target; None for other shapes."""
    return shape if isinstance(shape, TargetShape) else None


def parted_shape(shape: mi.Shape) -> PartedShape | None:
    """Return a mesh of several parts; None for other shapes."""
    return shape if isinstance(shape, PartedShape) else None


def strewn_shape(shape: mi.Shape) -> StrewnShape | None:
    """Return a mesh of targets that were placed at random; None for other shapes."""
    return shape if isinstance(shape, StrewnShape) else None


def is_seabed(shape: mi.Shape) -> bool:
    """Return True if a shape is declared to be a seabed."""
    return isinstance(shape, BedShape) and shape.seabed


def is_sea_surface(shape: mi.Shape | None) -> bool:
    """Return True if a shape is the sea surface."""
    return isinstance(shape, SeaSurfaceShape) and shape.sea_surface


def has_smooth_normals(shape: mi.Shape) -> bool:
    """Return True if a mesh scatters by normals interpolated between its vertices."""
    return isinstance(shape, ShapeWithNormals) and shape.smooth_normals
