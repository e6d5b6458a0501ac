"""Random targets (`targets`): meshes of a folder, strewn over a seabed.

- ``meshes``: folder of ``.ply`` and ``.obj`` files beside the scene, or some files "mine.ply, rock.obj": metres, z up,
  front to +y, the origin anywhere. A file's name is its species
- ``species`` [all]: those to use, "cylinder, tyre"
- ``weights`` [all alike]: how often each is drawn, one number a species
- ``count``: how many, or "3, 8": from 3 to 8
- ``seed`` [0]: number of the draw, which differs by the shape's id too; target k does not depend on how many follow
- ``area`` [the seabed's] [m]: "west, south, east, north", within which they lie wholly
- ``exclude`` [m]: boxes like it that none reaches into, four numbers each
- ``spacing`` [m, 0]: least distance between their bounding circles
- ``scale`` [1], ``burial`` [0]: factor of size; share of the height below the bed
- ``heading_deg`` ["0, 360"], ``tilt_deg`` [0]: compass heading of the front; angle of leaning, in any direction
- ``pose`` ["upright"]: as the mesh stands, or "rest": on any side it can rest on, or "any": in any attitude
- ``along_slope`` [false]: stand at right angles to the bed beneath, not to the horizon

Where one number is given the value is fixed; two, "low, high", are drawn from evenly. The first shape referred to is
the seabed; others, such as another `targets`, are kept clear of.

.. code-block:: xml

    <shape type="targets" id="mines">
        <string name="meshes" value="targets"/>
        <string name="count" value="5, 20"/>
        <ref id="seabed"/>
        <ref id="steel"/>
    </shape>
"""
import os
import zlib

import numpy as np

import mitsuba as mi
from mitsonar.io import meshes
from mitsonar.plugins.attributes import Attributes
from mitsonar.scene.errors import plain
from mitsonar.seabed import Bed, Body, Rules, draw_count, place

from .grid_mesh import GridMesh, fill

MOST_FACES = 5_000_000
SPECK = 0.001                      # [m] side of the one buried triangle of a shape without targets


class Targets(mi.Mesh):
    """See the module's text.

    Attributes
    ----------
    part_names : tuple of str
        "SPECIES.ID.K" of each target, K from 1.
    part_of_face : array (F,) of uint32
        Index into `part_names`.
    placed : dict of str to dict
        Plain JSON of each target by name: ``species``, ``position`` [m] (middle of the footprint, at the mean height of
        the bed), ``radius`` [m] of the bounding circle, ``heading_deg``, ``tilt_deg``, ``tilt_heading_deg``, ``scale``,
        ``burial``.
    """

    def __init__(self, props):
        attributes = Attributes(props)
        name, species = attributes.text("meshes"), attributes.text("species", None)
        low, high = _pair(attributes, "count", None, minimum=0, maximum=100_000, whole=True)
        seed = attributes.integer("seed", 0, minimum=0)
        rules = _rules(attributes)
        attributes.finish()
        if attributes.given("to_world"):
            raise attributes.error("to_world is given; targets lie where their seabed is: leave it out.")
        shapes = attributes.objects(mi.Shape)
        bed_shape = next((shape for shape in shapes if getattr(shape, "seabed", False)),
                         next((shape for shape in shapes if not hasattr(shape, "placed")), None))
        if bed_shape is None:
            raise attributes.error('a seabed is missing; refer to one: <ref id="seabed"/>.')
        bodies = [_body(attributes, path) for path in _chosen(attributes, _files(attributes, name), species)]
        if rules.weights is not None and len(rules.weights) != len(bodies):
            raise attributes.error(f"weights are {len(rules.weights)} numbers for {len(bodies)} species "
                                   f"({', '.join(body.name for body in bodies)}); give one each.")
        identity = props.id() or "targets"
        stream = seed, zlib.crc32(identity.encode())   # two shapes of one seed are not alike
        bed = _bed(attributes, bed_shape)
        taken = [circle for shape in shapes if shape is not bed_shape for circle in _circles(shape)]
        count, faces = draw_count(low, high, stream), max(len(body.faces) for body in bodies)
        if count * faces > MOST_FACES:
            raise attributes.error(f"{count} targets of up to {faces} triangles are more than {MOST_FACES} together; "
                                   "use fewer, or coarser meshes.")
        try:
            targets = place(bodies, bed, rules, count=count, seed=stream, taken=taken)
        except ValueError as error:
            raise attributes.error(f"{error}.") from None
        self.part_names = tuple(f"{target.body.name}.{identity}.{target.number}" for target in targets)
        self.placed = {name: _told(target) for name, target in zip(self.part_names, targets)}
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

    def to_string(self):
        return f"Targets[{', '.join(self.placed) or 'none'}]"


def _pair(attributes, name, default, *, whole=False, unit=None, **bounds):
    """Read one number or "low, high", as a pair; `bounds` hold for both."""
    expected = (f"{'a whole number' if whole else 'a number'} or two, \"low, high\","
                f" from {bounds['minimum']:g} to {bounds['maximum']:g}{f' [{unit}]' if unit else ''}")
    values = attributes.numbers(name, unit=unit) if default is None else attributes.numbers(name, default, unit=unit)
    values = [float(value) for value in values]
    pair = tuple(values * 2 if len(values) == 1 else values)
    if len(pair) != 2 or not bounds["minimum"] <= pair[0] <= pair[1] <= bounds["maximum"] \
            or whole and any(value % 1 for value in pair):
        raise attributes.error(f"{name} is {', '.join(f'{value:g}' for value in values)}; expected {expected}.")
    return tuple(int(value) for value in pair) if whole else pair


def _rules(attributes):
    area = attributes.numbers("area", None, count=4, unit="m")
    if area is not None:
        _check_box(attributes, "area", area)
    exclude = attributes.numbers("exclude", np.zeros(0), unit="m")
    if exclude.size % 4:
        raise attributes.error(f"exclude holds {exclude.size} numbers; expected four a box: west, south, east, north.")
    for box in exclude.reshape(-1, 4):
        _check_box(attributes, "exclude", box)
    weights = attributes.numbers("weights", None)
    if weights is not None and not (weights.min() >= 0 and weights.sum() > 0):
        raise attributes.error("weights are not at least 0, one of them above; give shares such as 3, 1, 1.")
    heading, tilt = (tuple(np.deg2rad(_pair(attributes, name, default, unit="degrees", minimum=low, maximum=high)))
                     for name, default, low, high in (("heading_deg", (0.0, 360.0), -360, 720),
                                                      ("tilt_deg", (0.0,), 0, 180)))
    return Rules(area=area, exclude=exclude.reshape(-1, 4), weights=weights, heading=heading, tilt=tilt,
                 spacing=attributes.number("spacing", 0.0, minimum=0, unit="m"),
                 scale=_pair(attributes, "scale", (1.0,), minimum=1e-6, maximum=1e6),
                 burial=_pair(attributes, "burial", (0.0,), minimum=0, maximum=1),
                 pose=attributes.text("pose", "upright", choices=("upright", "rest", "any")),
                 along_slope=attributes.boolean("along_slope", False))


def _check_box(attributes, name, box):
    if not (box[0] < box[2] and box[1] < box[3]):
        raise attributes.error(f"{name} is {', '.join(f'{value:g}' for value in box)}; expected west, south, east, "
                               "north [m], west below east and south below north.")


def _files(attributes, text):
    """Paths of the meshes by species, sorted where a folder is given."""
    resolve = mi.file_resolver().resolve           # a name that is nowhere comes back unchanged
    folder = str(resolve(text.strip()))
    try:
        if not text.strip():
            raise ValueError('meshes is empty; give a folder, or files such as "mine.ply, rock.obj"')
        if os.path.isdir(folder):
            paths = [str(path) for path in meshes.listed(folder)]
        elif not text.lower().strip().endswith(meshes.KINDS):
            raise ValueError(f'meshes names "{text}", which is no folder; it is looked for beside the scene, then '
                             "where you are")
        else:
            paths = [str(resolve(name.strip())) for name in text.split(",")]
        for path in paths:
            meshes.check_target(path)
    except (ValueError, OSError) as error:
        raise attributes.error(f"{error}.") from None
    known = {}
    for path in paths:
        stem = os.path.splitext(os.path.basename(path))[0]
        if "." in stem or stem in known:
            said = "has a dot in its name, where its class would end" if "." in stem else f"is called as {known[stem]}"
            raise attributes.error(f"the mesh {path} {said}; rename it.")
        known[stem] = path
    return known


def _chosen(attributes, files, species):
    names = [name.strip() for name in (species or "").split(",") if name.strip()] or list(files)
    unknown = [name for name in names if name not in files]
    if unknown:
        raise attributes.error(f'no species is called "{unknown[0]}"; meshes holds {", ".join(files)}.')
    if len(set(names)) < len(names):
        raise attributes.error("species names one twice; to have it drawn more often, give weights.")
    return [files[name] for name in names]


def _body(attributes, path):
    """Read a mesh by Mitsuba's own reader."""
    stem, suffix = os.path.splitext(os.path.basename(path))
    try:
        mesh = mi.load_dict({"type": suffix[1:].lower(), "filename": path}, parallel=False, optimize=False)
    except (RuntimeError, UnicodeDecodeError) as error:
        said = plain(error).removeprefix('object "root": ')
        raise attributes.error(f"the mesh {path} cannot be read ({said}); export it again, in triangles.") from None
    try:
        return Body(name=stem, **_arrays(mesh))
    except ValueError as error:
        raise attributes.error(f"{error}.") from None


def _arrays(mesh):
    parameters = mi.traverse(mesh)
    return {"vertices": parameters["vertex_positions"].numpy().reshape(-1, 3),
            "faces": parameters["faces"].numpy().reshape(-1, 3)}


def _bed(attributes, shape):
    if "vertex_positions" not in mi.traverse(shape):
        raise attributes.error(f'the seabed "{shape.id()}" is no mesh; refer to a seabed, bathymetry, ply or obj.')
    try:
        return Bed(**_arrays(shape))
    except ValueError as error:
        raise attributes.error(f"{error}.") from None


def _circles(shape):
    """What a shape occupies, seen from above: (x, y, radius) [m]."""
    placed = getattr(shape, "placed", None)
    if placed is not None:
        return [(*target["position"][:2], target["radius"]) for target in placed.values()]
    low, high = np.array(shape.bbox().min), np.array(shape.bbox().max)
    return [(*((low + high) / 2)[:2], np.hypot(*(high - low)[:2]) / 2)]


def _told(target):
    heading, tilt, tilt_heading = np.rad2deg((target.heading, target.tilt, target.tilt_heading)) % 360
    numbers = {"radius": target.radius, "heading_deg": heading, "tilt_deg": tilt, "tilt_heading_deg": tilt_heading,
               "scale": target.scale, "burial": target.burial}
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
