"""Surveyed seabed (`bathymetry`): the mesh of a GeoTIFF, BAG, netCDF, ... file, of an array, or of x, y, z as text.

Text of x, y, z a line is laid on its own lattice if it has one; scattered soundings on a grid of ``resolution``, by
default their mean distance, with holes beyond three times that. Triangles that touch a node without depth are left out.
A part that ``relief`` is laid on shows the same relief as any other part of the file; give materials that know
``mesh_resolution`` the ``resolution`` then. Several surveys in one scene need a common ``local_origin``.

A survey that is coarse against the sonar's bins shows its triangles; ``smooth_normals`` takes them away. Write
it where nodes lie further apart than three bins or so, and not where ``relief`` or a fine survey brings the shape that
sound sees at its resolution: there it only takes off some of the slopes.

Sediments are those of `sediment`, which a bed with a map and without a bsdf has:

.. code-block:: xml

    <shape type="bathymetry" id="seabed">
        <string name="filename" value="area.bag"/>
        <string name="sediment_map" value="classes.tif"/>
        <string name="sediment_classes" value="1: clay, 7: medium sand, nodata: sandy silt"/>
    </shape>

A bsdf of its own reads the classes from the mesh attribute ``face_sediment_class``, numbered in the order of the table,
those of one name once. Across a border, ``face_second_class`` is the class on its other side and ``face_second_share``
that one's share; without them borders are steps:

.. code-block:: xml

    <bsdf type="sediment">
        <string name="classes" value="clay, medium sand, sandy silt"/>
        <texture name="sediment_class" type="mesh_attribute">
            <string name="name" value="face_sediment_class"/>
        </texture>
        <texture name="second_class" type="mesh_attribute">
            <string name="name" value="face_second_class"/>
        </texture>
        <texture name="second_share" type="mesh_attribute">
            <string name="name" value="face_second_share"/>
        </texture>
    </bsdf>
"""
from typing import Any

import mitsuba as mi
import numpy as np

from mitsonar.io.grids import bathymetry, sediment_map

from ..attributes import Attributes, Boolean, Choice, File, Integer, Nested, Number, Numbers, Text, TextOrFile
from .grid_mesh import SMOOTH_NORMALS, TO_WORLD, fill, triangulate

MOST_NODES = 5e7        # 100 million triangles: about 10 GB once Embree has built its tree

ATTRIBUTES = (
    File("filename", text="the survey"),
    Numbers("crop", default=None, count=4, text='"west, south, east, north" of the part to use; or `crop_centre` and '
                                                "`crop_size`"),
    Numbers("crop_centre", default=None, count=2, otherwise="the file's", text='"east, north" of its middle'),
    Numbers("crop_size", default=None, count=2, unit="m", otherwise="the file's", text='its "width, height"'),
    Choice("crop_frame", default="projected", choices=("projected", "local"),
           text="crop and centre in the file's coordinates, or in metres from the middle of the file"),
    Number("resolution", default=0.0, minimum=0, unit="m", text="node distance; 0: the file's"),
    Choice("vertical", default="auto", choices=("auto", "elevation", "depth"),
           text="by the sign of most, positive up, or positive down"),
    Integer("band", default=1, minimum=1, text="of the file"),
    Text("variable", default=None, text="grid of a netCDF file that holds several"),
    Number("nodata", default=None, otherwise="the file's", text="fill value"),
    Text("crs", default=None, otherwise="the file's", text='coordinate system such as "EPSG:4326"'),
    Number("spacing", default=0.0, minimum=0, unit="m", text="node distance of an `.npy` array, whose rows run north; "
                                                             "it needs one"),
    Numbers("local_origin", default=None, count=2, unit="m", otherwise="middle of the part, rounded",
            text='"east, north" that becomes x = y = 0'),
    Choice("holes", default="cut", choices=("cut", "filled"),
           text="`filled`: with the smoothest bed, where surrounded"),
    Number("holes_max", default=None, above=0, unit="m", text="width of the widest hole to fill"),
    Boolean("relief", default=False, text="relief below the file's own resolution that continues its spectrum, where "
                                          "`resolution` is finer"),
    Integer("relief_seed", default=0, minimum=0, text="realisation of it"),
    Number("relief_w2", default=None, minimum=0, unit="m^(4-γ)", otherwise="as measured", text="its spectral strength"),
    Number("relief_gamma", default=None, above=2, below=4, otherwise="as measured", text="its spectral exponent γ"),
    File("sediment_map", default=None, text="raster of sediment classes in any coordinates, painted on the bed"),
    TextOrFile("sediment_classes", default=None, sign=":",
               text='what its codes are: "1: clay, 7: medium sand, nodata: sand", or a CSV file of code, sediment'),
    Text("sediment_map_crs", default=None, otherwise="the map's or survey's", text="coordinate system of the map"),
    Number("sediment_border", default=None, minimum=0, unit="m", otherwise="a cell of the map",
           text="width over which one sediment goes over into the next, patch by patch; 0: steps"),
    SMOOTH_NORMALS, TO_WORLD,
    Nested("bsdf", default=None, otherwise="`sediment` of the map, else Mitsuba's `diffuse`", text="the material"),
)


class Bathymetry(mi.Mesh):
    """See the module's text. Attributes of the object are as before ``to_world``."""
    # local_origin [m]; bathymetry_bounds [m]

    seabed = True

    def __init__(self, props: mi.Properties) -> None:
        attributes = Attributes(props, ATTRIBUTES)
        table = _class_table(attributes)
        path = attributes.filename
        survey = bathymetry.read(
            path, crop=attributes.crop, centre=attributes.crop_centre, size=attributes.crop_size,
            frame=attributes.crop_frame, resolution=attributes.resolution or None, vertical=attributes.vertical,
            band=attributes.band, variable=attributes.variable, nodata=attributes.nodata, crs=attributes.crs or None,
            spacing=attributes.spacing or None, local_origin=attributes.local_origin, holes=attributes.holes,
            holes_max=attributes.holes_max, relief=_relief(attributes))
        if survey.heights.size > MOST_NODES:
            raise attributes.error(f"{survey.y.size} x {survey.x.size} nodes are more than {MOST_NODES:.0e}; use a "
                                   "coarser resolution or crop.")
        grid = triangulate(survey.x, survey.y, survey.heights, attributes.to_world)
        if len(grid.faces) == 0:
            raise attributes.error(f"{path}: the part in use holds no two neighbouring nodes with depths.")
        if table is not None:
            painting = sediment_map.paint(attributes.sediment_map, survey, table, grid.cells,
                                          crs=attributes.sediment_map_crs, border=attributes.sediment_border)
            if attributes.bsdf is None:
                props["bsdf"] = _material(table)
        self.smooth_normals = attributes.smooth_normals
        super().__init__("bathymetry", len(grid.vertices), len(grid.faces), props=props,
                         has_vertex_normals=attributes.smooth_normals, has_vertex_texcoords=True)
        fill(self, grid)
        if table is not None:
            for name, values in (("sediment_class", painting.number), ("second_class", painting.other),
                                 ("second_share", painting.share)):
                painted: Any = mi.Float(values.astype(np.float32))
                self.add_attribute(f"face_{name}", 1, painted)
        self.sediments = [] if table is None else table.sediments
        self.survey = survey
        self.local_origin = survey.local_origin
        self.crs = survey.crs
        self.bathymetry_bounds = survey.bounds
        self._description = (f"Bathymetry[{path}: {survey.y.size} x {survey.x.size} nodes, {survey.valid.mean():.0%} "
                             f"with depth, taken as {survey.vertical}, local origin {survey.local_origin}]")

    def to_string(self) -> str:
        """Say where the bed comes from and how it was read."""
        return self._description


def _relief(attributes):
    """Return the relief below the survey's resolution, or None."""
    given = attributes.given("relief_seed", "relief_w2", "relief_gamma")
    if given and not attributes.given("relief"):
        raise attributes.error(f"{given[0]} is written without relief; write relief true.")
    if not attributes.relief:
        return None
    try:
        return bathymetry.SurveyRelief(seed=attributes.relief_seed, w2=attributes.relief_w2,
                                       gamma=attributes.relief_gamma)
    except ValueError as error:
        raise attributes.error(error) from None


def _class_table(attributes):
    """Return the meaning of the map's codes; None where there is no map."""
    path, classes = attributes.sediment_map, attributes.sediment_classes
    if path is None or not classes:
        given = attributes.given("sediment_map", "sediment_classes", "sediment_map_crs", "sediment_border")
        if path or classes or attributes.sediment_map_crs or attributes.sediment_border is not None:
            raise attributes.error(f"{given[0]} is written alone; a map needs sediment_map and sediment_classes.")
        return None
    try:
        return sediment_map.ClassTable.of(classes)
    except ValueError as error:
        raise attributes.error(error) from None


def _material(table):
    """The bsdf of a bed that has none of its own."""
    return mi.load_dict({"type": "sediment", "classes": ", ".join(table.sediments),
                         **{name: {"type": "mesh_attribute", "name": f"face_{name}"}
                            for name in ("sediment_class", "second_class", "second_share")}})


mi.register_shape("bathymetry", Bathymetry)
