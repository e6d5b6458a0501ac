"""Shape ``bathymetry``: the seabed of a survey file."""
import numpy as np

import mitsuba as mi
from mitsonar.io import bathymetry, sediment_map
from mitsonar.plugins.attributes import Attributes
from mitsonar.plugins.shapes.grid_mesh import fill, triangulate

_MOST_NODES = 5e7  # 100 million triangles: about 10 GB once Embree has built its tree


class Bathymetry(mi.Mesh):
    """Mesh a survey: GeoTIFF, BAG, netCDF, ESRI ASCII, what else GDAL opens, an ``.npy`` array, or x, y, z as text.

    ================ =========== ===========================================================================
    ``filename``                 the survey, beside the scene file or an absolute path
    ``crop``                     "west, south, east, north" of the part to use
    ``crop_centre``              "east, north" of its middle instead, by default the middle of the file
    ``crop_size``                "width, height" of it [m]
    ``crop_frame``   projected   crop and centre in the file's own coordinates, or "local": metres from the
                                 middle of the file
    ``resolution``   0           distance of the nodes [m]; 0: the file's
    ``vertical``     auto        "elevation" (positive up), "depth" (positive down), or by the sign of most
    ``band``         1           band of the file
    ``variable``                 grid of a netCDF file that holds several
    ``nodata``                   fill value, where the file does not declare it
    ``crs``                      coordinate system, where the file does not name it: "EPSG:4326"
    ``spacing``                  distance of the nodes of an ``.npy`` array [m]
    ``local_origin``             "east, north" that becomes x = y = 0, by default the middle of the part in
                                 use, rounded to metres; several surveys in one scene need a common one
    ``holes``        cut         or "filled": by the smoothest bed through their rims, where the part in use
                                 surrounds them
    ``holes_max``                width of the widest hole to fill [m]
    ``relief``       false       below the file's own resolution, relief that continues its spectrum; the
                                 ``resolution`` must be finer
    ``relief_seed``  0           realisation of it
    ``relief_w2``                spectral strength [m^(4 - gamma)] and
    ``relief_gamma``             exponent of it, by default as measured on the file
    ``sediment_map``             raster of sediment classes, in any coordinate system
    ``sediment_classes``         what its codes are: "1: clay, 7: medium sand, nodata: sand", or a CSV file with
                                 columns code and sediment; "nodata" is where the map has none
    ``sediment_map_crs``         coordinate system of a map that names none, by default the survey's
    ``to_world``                 applied to the finished mesh
    ================ =========== ===========================================================================

    Where relief is added, give materials that know ``mesh_resolution`` the ``resolution``. Triangles that
    touch a node without depth are left out. Attributes of the object, all before ``to_world``:
    ``survey`` (the `mitsonar.io.bathymetry.Bathymetry` itself), ``local_origin`` [m], ``crs`` and
    ``bathymetry_bounds`` (west, south, east, north [m] in ``crs``).

    .. code-block:: python

        "bed": {"type": "bathymetry", "filename": "survey.bag", "crop_size": "600, 400", "resolution": 1.0,
                "bsdf": {"type": "lambert"}}

    With a map, facets have the attribute ``face_sediment_class``, the place of their sediment in the attribute
    ``sediments`` of the object: the classes in their order, those of one name once. Without a bsdf of its own the bed
    has a `sediment` of these classes; one that is written reads them by its ``sediment_class``:

    .. code-block:: xml

        <bsdf type="sediment">
            <string name="classes" value="clay, medium sand, sand"/>
            <texture name="sediment_class" type="mesh_attribute">
                <string name="name" value="face_sediment_class"/>
            </texture>
        </bsdf>

    The class attribute ``seabed`` is True: whoever looks for the seabed finds it by that.
    """

    seabed = True

    def __init__(self, props):
        attributes = Attributes(props)
        path = attributes.file("filename")
        options = {"crop": attributes.numbers("crop", None, count=4),
                   "centre": attributes.numbers("crop_centre", None, count=2),
                   "size": attributes.numbers("crop_size", None, count=2, unit="m"),
                   "frame": attributes.text("crop_frame", "projected", choices=("projected", "local")),
                   "resolution": attributes.number("resolution", 0.0, unit="m", minimum=0) or None,
                   "vertical": attributes.text("vertical", "auto", choices=("auto", "elevation", "depth")),
                   "band": attributes.integer("band", 1, minimum=1),
                   "variable": attributes.text("variable", None),
                   "nodata": attributes.number("nodata", None),
                   "crs": attributes.text("crs", None) or None,
                   "spacing": attributes.number("spacing", 0.0, unit="m", minimum=0) or None,
                   "local_origin": attributes.numbers("local_origin", None, count=2, unit="m"),
                   "holes": attributes.text("holes", "cut", choices=("cut", "filled")),
                   "holes_max": attributes.number("holes_max", None, unit="m", above=0),
                   "relief": _relief(attributes)}
        table, map_path, map_crs = _sediment_map(attributes)
        to_world = attributes.matrix()
        attributes.finish()
        survey = bathymetry.read(path, **options)
        if survey.heights.size > _MOST_NODES:
            raise attributes.error(f"{survey.y.size} x {survey.x.size} nodes are more than {_MOST_NODES:.0e}; use a "
                                   "coarser resolution or crop.")
        grid = triangulate(survey.x, survey.y, survey.heights, to_world)
        if len(grid.faces) == 0:
            raise attributes.error(f"{path}: the part in use holds no two neighbouring nodes with depths.")
        if table is not None:
            numbers = sediment_map.read(map_path, survey, table, grid.cells, crs=map_crs)
            if attributes.object(mi.BSDF, None) is None:
                props["bsdf"] = _material(table)
        super().__init__("bathymetry", len(grid.vertices), len(grid.faces), props=props, has_vertex_texcoords=True)
        fill(self, grid)
        if table is not None:
            self.add_attribute("face_sediment_class", 1, mi.Float(numbers.astype(np.float32)))
        self.sediments = [] if table is None else table.sediments
        self.survey = survey
        self.local_origin = survey.local_origin
        self.crs = survey.crs
        self.bathymetry_bounds = survey.bounds
        self._description = (f"Bathymetry[{path}: {survey.y.size} x {survey.x.size} nodes, {survey.valid.mean():.0%} "
                             f"with depth, taken as {survey.vertical}, local origin {survey.local_origin}]")

    def to_string(self):
        """Say where the bed comes from and how it was read."""
        return self._description


def _relief(attributes):
    """What is asked for below the survey's resolution, or None."""
    asked = attributes.boolean("relief", False)
    options = {"seed": attributes.integer("relief_seed", 0, minimum=0),
               "w2": attributes.number("relief_w2", None, minimum=0),
               "gamma": attributes.number("relief_gamma", None, above=2, below=4)}
    given = attributes.given("relief_seed", "relief_w2", "relief_gamma")
    if given and not attributes.given("relief"):
        raise attributes.error(f"{given[0]} is written without relief; write relief true.")
    try:
        return bathymetry.Relief(**options) if asked else None
    except ValueError as error:
        raise attributes.error(str(error)) from None


def _sediment_map(attributes):
    """The class table, the map's path and its coordinate system; None where none is written."""
    path = attributes.file("sediment_map", None)
    classes = attributes.text("sediment_classes", None)
    crs = attributes.text("sediment_map_crs", None)
    if path is None or not classes:
        given = attributes.given("sediment_map", "sediment_classes", "sediment_map_crs")
        if path or classes or crs:
            raise attributes.error(f"{given[0]} is written alone; a map needs sediment_map and sediment_classes.")
        return None, None, None
    if ":" not in classes:
        classes = attributes.file("sediment_classes")
    try:
        return sediment_map.ClassTable.of(classes), path, crs
    except ValueError as error:
        raise attributes.error(str(error)) from None


def _material(table):
    """The bsdf of a bed that has none of its own."""
    return mi.load_dict({"type": "sediment", "classes": ", ".join(table.sediments),
                         "sediment_class": {"type": "mesh_attribute", "name": "face_sediment_class"}})


mi.register_shape("bathymetry", Bathymetry)
