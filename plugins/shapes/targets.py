"""Random targets (`targets`): meshes or stones strewn at random over the seabed that it refers to by `<ref>`.

For an attribute of two numbers, "low, high", values are drawn uniformly between them. The first seabed referred to
bears the targets; they keep clear of all other shapes referred to, such as other `targets`. Labels consist of species,
shape and number: ``tyre.mines.3``. The species ``rounded_stone`` and ``angular_stone`` need no meshes: each target is
one of 24 stones of about a metre, so that ``scale`` is its length in metres.

.. code-block:: xml

    <shape type="targets" id="mines">
        <string name="meshes" value="targets"/>
        <string name="count" value="5, 20"/>
        <ref id="seabed"/>
        <ref id="steel"/>
    </shape>
"""
import functools
import os
import warnings
import weakref
import zlib
from dataclasses import replace

import mitsuba as mi
import numpy as np

from mitsonar.io.scene_files import meshes
from mitsonar.io.scene_files.mesh_lists import MeshStatement, statement
from mitsonar.scene.errors import plain
from mitsonar.scene.protocols import is_seabed, strewn_shape
from mitsonar.seabed.bed import Bed
from mitsonar.seabed.bodies import Body
from mitsonar.seabed.placement import Rules, draw_count, place
from mitsonar.seabed.scour import Footprint
from mitsonar.seabed.stones import KINDS, stones

from ..attributes import Attributes, Boolean, Choice, Files, Integer, Nested, Number, Numbers, Range, Text
from ..attributes.input_files import resolved
from .grid_mesh import MATERIAL, GridMesh, fill
from .scoured import SCOUR, cut, mesh_arrays, scour_of, vertices_before

MOST_FACES = 5_000_000
SMALL, MOST_KEPT = 1_000_000, 64   # bytes of a mesh file that is kept, and number of those
SPECK = 0.001                      # [m] side of the one buried triangle of a shape without targets

ATTRIBUTES = (
    Files("meshes", default=None, otherwise="needed but for stones",
          text='folder of `.ply` and `.obj` files beside the scene, or "mine.ply, rock.obj": metres, z up, '
               "front to +y, the origin anywhere, unless meshes.toml beside them states other units; their names are "
               "species"),
    Text("species", default=None, otherwise="all",
         text='species to use: "cylinder, tyre", or stones that need no mesh: "rounded_stone, angular_stone"'),
    Numbers("weights", default=None, otherwise="alike", text='relative frequency of each species: "3, 1"'),
    Range("count", minimum=0, maximum=100_000, whole=True, text='number of targets: 12, or "3, 8"'),
    Integer("seed", default=0, minimum=0,
            text="seed of the draw, which also depends on the shape's id; target k does not depend on the number of "
                 "targets after it"),
    Numbers("area", default=None, count=4, unit="m", otherwise="the seabed's",
            text='"west, south, east, north" limits within which targets lie wholly'),
    Numbers("exclude", default=(), unit="m", text="boxes that targets do not touch, four numbers each"),
    Number("spacing", default=0.0, minimum=0, unit="m",
           text="least distance between the targets' bounding circles"),
    Choice("crowded", default="refuse", choices=("refuse", "fewer"),
           text="reaction if targets find no room: an error that states how many fit, or a warning and a field "
                "without the others"),
    Range("scale", default=(1.0,), minimum=1e-6, maximum=1e6, text="factor of size"),
    Range("burial", default=(0.0,), minimum=0, maximum=1,
          text="share of the height that lies below the mean bed under the footprint"),
    Range("height", default=(0.0,), minimum=0, maximum=10_000, unit="m",
          text="height over where the target would lie: for fish, and mines on a mooring, which is not drawn"),
    Range("heading_deg", default=(0.0, 360.0), minimum=-360, maximum=720, unit="degrees",
          text="compass heading of the target's front"),
    Range("tilt_deg", default=(0.0,), minimum=0, maximum=180, unit="degrees", text="tilt in a random direction"),
    Choice("pose", default="upright", choices=("upright", "rest", "any"),
           text="pose: as the mesh stands; on any side that it rests on, with the probability of a random fall; in "
                "any attitude"),
    Boolean("along_slope", default=False,
            text="true: upright relative to the bed under the footprint; false: relative to the horizon"),
    *SCOUR,
    Nested("shape", many=True, default=None, otherwise="needed",
           text="by `<ref>`: the seabed, and shapes to keep clear of"),
    MATERIAL,
)


class Targets(mi.Mesh):
    """Random targets on a seabed."""
    # part_of_face (F,)

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        rules, scour = _rules(attributes), scour_of(attributes)
        if attributes.given("to_world"):
            raise attributes.error("to_world is given; targets lie where their seabed is: leave it out.")
        shapes = attributes.shape
        bed_shape = next((shape for shape in shapes if is_seabed(shape)),
                         next((shape for shape in shapes if strewn_shape(shape) is None), None))
        if bed_shape is None:
            raise attributes.error('a seabed is missing; refer to one: <ref id="seabed"/>.')
        self.mesh_sources: dict[str, tuple[str, MeshStatement]] = {}       # path and statement by species
        species = _species(attributes, self.mesh_sources)
        if rules.weights is not None and len(rules.weights) != len(species):
            raise attributes.error(f"weights are {len(rules.weights)} numbers for {len(species)} species "
                                   f"({', '.join(kind[0].name for kind in species)}); give one each.")
        bodies = [body for kind in species for body in kind]
        weights = np.ones(len(species)) if rules.weights is None else rules.weights
        rules = replace(rules, weights=np.concatenate([np.full(len(kind), weight / len(kind))
                                                       for kind, weight in zip(species, weights)]))
        identity = props.id() or "targets"
        stream = attributes.seed, zlib.crc32(identity.encode())   # two shapes of one seed are not alike
        self.bears, self.bed = bed_shape, (bed := _bed(attributes, bed_shape))
        taken = [circle for shape in shapes if shape is not bed_shape for circle in _circles(shape)]
        low, high = attributes.count
        count, faces = draw_count(low, high, stream), max(len(body.faces) for body in bodies)
        if count * faces > MOST_FACES:
            raise attributes.error(f"{count} targets of up to {faces} triangles are more than {MOST_FACES} together; "
                                   "use fewer, or coarser meshes.")
        try:
            targets = place(bodies, bed, rules, count=count, seed=stream, taken=taken, crowded=attributes.crowded)
        except ValueError as error:
            raise attributes.error(f"{error}.") from None
        floating = next((target for target in targets if target.height and target.vertices[:, 2].min() > 0), None)
        if floating is not None:
            raise attributes.error(f"target {floating.number}, of height {floating.height:.4g} m, floats above the sea "
                                   "surface (z = 0); give a height below the depth of the seabed.")
        if len(targets) < count:
            warnings.warn(f"{identity}: {len(targets)} of {count} targets found room", stacklevel=2)
        if scour is not None:
            marks = [Footprint.of(target.vertices, target.body.faces, target.position[2]) for target in targets
                     if target.height == 0]
            cut(attributes, bed_shape, scour, [mark for mark in marks if mark is not None])
        classes = {name: source.class_name or name for name, (_, source) in self.mesh_sources.items()}
        self.part_names = tuple(f"{classes.get(target.body.name, target.body.name)}.{identity}.{target.number}"
                                for target in targets)
        self.placed = {name: _record_of(target) for name, target in zip(self.part_names, targets)}
        if targets:
            mesh = _joined(targets)
            self.part_of_face = np.repeat(np.arange(len(targets), dtype=np.uint32),
                                          [len(target.body.faces) for target in targets])
        else:
            # Mitsuba cannot trace a scene with an empty mesh: a speck under the bed, which belongs to it, is unheard
            mesh = _speck(bed)
            self.part_names, self.part_of_face = (bed_shape.id() or bed_shape.class_name(),), np.zeros(1, np.uint32)
        super().__init__("targets", len(mesh.vertices), len(mesh.faces), props=props, has_vertex_texcoords=True)
        fill(self, mesh)

    def to_string(self) -> str:
        return f"Targets[{', '.join(self.placed) or 'none'}]"


def _rules(attributes):
    if attributes.area is not None:
        _check_box(attributes, "area", attributes.area)
    exclude = attributes.exclude
    if exclude.size % 4:
        raise attributes.error(f"exclude holds {exclude.size} numbers; expected four a box: west, south, east, north.")
    for box in exclude.reshape(-1, 4):
        _check_box(attributes, "exclude", box)
    weights = attributes.weights
    if weights is not None and not (weights.min() >= 0 and weights.sum() > 0):
        raise attributes.error("weights are not at least 0, one of them above; give shares such as 3, 1, 1.")
    heading, tilt = (tuple(np.deg2rad(degrees)) for degrees in (attributes.heading_deg, attributes.tilt_deg))
    return Rules(area=attributes.area, exclude=exclude.reshape(-1, 4), weights=weights, heading=heading, tilt=tilt,
                 spacing=attributes.spacing, scale=attributes.scale, burial=attributes.burial,
                 height=attributes.height, pose=attributes.pose, along_slope=attributes.along_slope)


def _check_box(attributes, name, box):
    if not (box[0] < box[2] and box[1] < box[3]):
        raise attributes.error(f"{name} is {', '.join(f'{value:g}' for value in box)}; expected west, south, east, "
                               "north [m], west below east and south below north.")


def _files(attributes, text):
    """Return the paths of the meshes and the SHA-256 of their content by species, sorted for a folder."""
    folder = resolved(text.strip())
    try:
        if not text.strip():
            raise ValueError('meshes is empty; give a folder, or files such as "mine.ply, rock.obj"')
        if os.path.isdir(folder):
            paths = [str(path) for path in meshes.listed(folder)]
        elif not text.lower().strip().endswith(meshes.KINDS):
            raise ValueError(f'meshes names "{text}", which is no folder; it is looked for beside the scene, then '
                             "where you are")
        else:
            paths = [resolved(name.strip()) for name in text.split(",")]
        contents = [meshes.check_target(path) for path in paths]
    except (ValueError, OSError) as error:
        raise attributes.error(f"{error}.") from None
    known = {}
    for path, content in zip(paths, contents):
        stem = os.path.splitext(os.path.basename(path))[0]
        if "." in stem or stem in known:
            said = ("has a dot in its name, where its class would end" if "." in stem
                    else f"is called as {known[stem][0]}")
            raise attributes.error(f"the mesh {path} {said}; rename it.")
        known[stem] = path, content
    return known


def _species(attributes, sources):
    """Return the bodies of each species in use, one or many, and add paths and statements of meshes to ``sources``."""
    names = [name.strip() for name in (attributes.species or "").split(",") if name.strip()]
    if attributes.meshes is None and not (names and set(names) <= set(KINDS)):
        raise attributes.error(f"meshes is missing; give a folder or files, or species that need none: "
                               f"{', '.join(KINDS)}.")
    files = {} if attributes.meshes is None else _files(attributes, attributes.meshes)
    taken = [name for name in KINDS if name in files]
    if taken:
        raise attributes.error(f"the mesh {files[taken[0]][0]} has the name of the stones {taken[0]}; rename it.")
    names = names or list(files)
    unknown = [name for name in names if name not in (*files, *KINDS)]
    if unknown:
        raise attributes.error(f'no species is called "{unknown[0]}"; meshes holds {", ".join(files) or "none"}, and '
                               f'there are {" and ".join(KINDS)}.')
    if len(set(names)) < len(names):
        raise attributes.error("species names one twice; to have it drawn more often, give weights.")
    try:
        sources.update({name: (files[name][0], statement(files[name][0])) for name in names if name in files})
    except (ValueError, OSError) as error:
        raise attributes.error(f"{error}.") from None
    return [stones(name) if name in KINDS else (_body(attributes, files[name][0], files[name][1], sources[name][1]),)
            for name in names]


def _body(attributes, path, content, stated):
    """Return the body of a mesh file; a small one is kept for the next scenes, as its hull takes longer than reading.
    """
    try:
        return (_kept if os.path.getsize(path) < SMALL else _read)(path, content, stated)
    except (RuntimeError, UnicodeDecodeError) as error:
        said = plain(error).removeprefix('object "root": ')
        raise attributes.error(f"the mesh {path} cannot be read ({said}); export it again, in triangles.") from None
    except ValueError as error:
        raise attributes.error(f"{error}.") from None


def _read(path, content, stated):
    """Read a mesh by Mitsuba's own reader."""
    stem, suffix = os.path.splitext(os.path.basename(path))
    mesh = mi.load_dict({"type": suffix[1:].lower(), "filename": path}, parallel=False, optimize=False)
    vertices, faces = mesh_arrays(mesh)
    return Body(name=stem, vertices=stated.placed(vertices), faces=faces)


_kept = functools.lru_cache(maxsize=MOST_KEPT)(_read)                  # by path, content and statement


def _bed(attributes, shape):
    """Return the bed that a shape is; other targets on it have looked its triangles through already."""
    if "vertex_positions" not in mi.traverse(shape):
        raise attributes.error(f'the seabed "{shape.id()}" is no mesh; refer to a seabed, bathymetry, ply or obj.')
    vertices, known = vertices_before(shape), _beds.get(id(shape))
    if known is not None and np.array_equal(known.vertices, vertices):         # not moved between two scenes
        return known
    try:
        made = _beds[id(shape)] = Bed(vertices, mesh_arrays(shape)[1])
    except ValueError as error:
        raise attributes.error(f"{error}.") from None
    return made


# by identity of the shape: targets hold it as long as they hold its bed, so that no other shape has that identity
_beds: weakref.WeakValueDictionary[int, Bed] = weakref.WeakValueDictionary()


def _circles(shape):
    """Return the circle that a shape occupies, seen from above: (x, y, radius) [m]."""
    if (strewn := strewn_shape(shape)) is not None:
        return [(*target["position"][:2], target["radius"]) for target in strewn.placed.values()]
    low, high = np.array(shape.bbox().min), np.array(shape.bbox().max)
    return [(*((low + high) / 2)[:2], np.hypot(*(high - low)[:2]) / 2)]


def _record_of(target):
    heading, tilt, tilt_heading = np.rad2deg((target.heading, target.tilt, target.tilt_heading)) % 360
    numbers = {"radius": target.radius, "heading_deg": heading, "tilt_deg": tilt, "tilt_heading_deg": tilt_heading,
               "scale": target.scale, "burial": target.burial, "height": target.height}
    return {"species": target.body.name, "position": [round(float(value), 4) for value in target.position],
            **{name: round(float(value), 4) for name, value in numbers.items()}}


def _joined(targets):
    vertices = np.concatenate([target.vertices for target in targets]).astype(np.float32)
    first = np.cumsum([0, *(len(target.vertices) for target in targets[:-1])])
    faces = np.concatenate([target.body.faces + start for target, start in zip(targets, first)]).astype(np.uint32)
    return GridMesh(vertices, faces, np.zeros((len(vertices), 2), np.float32))


def _speck(bed):
    west, south, east, north = bed.bounds
    corner = np.array([(west + east) / 2, (south + north) / 2, bed.lowest])
    vertices = (corner + SPECK * np.array([[0, 0, -1], [1, 0, -1], [0, 1, -1]])).astype(np.float32)
    return GridMesh(vertices, np.array([[0, 1, 2]], np.uint32), np.zeros((3, 2), np.float32))


mi.register_shape("targets", Targets)
