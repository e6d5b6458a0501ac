"""Surveyed seabed (`bathymetry`): the mesh of a GeoTIFF, BAG, netCDF, ... file, of an array, or of x, y, z as text.

Lines of x, y, z that form a lattice keep that lattice. Scattered soundings are gridded at ``resolution``, by default
their mean distance; places farther than three times that from any sounding stay holes. Triangles that touch a node
without depth are left out. ``relief`` does not depend on which part of the file is used; with it, set the
``mesh_resolution`` of the material to the ``resolution``. Several surveys in one scene need a common ``local_origin``.

If a survey is coarse compared with the sonar's bins, its triangles show in the picture; ``smooth_normals`` removes
them. Use it where nodes lie more than about three bins apart. With ``relief`` or a fine survey leave it out: there it
only flattens slopes.

A bed with a sediment map and without a bsdf gets the material `sediment`, whose names the table of classes uses:

.. code-block:: xml

    <shape type="bathymetry" id="seabed">
        <string name="filename" value="area.bag"/>
        <string name="sediment_map" value="classes.tif"/>
        <string name="sediment_classes" value="1: clay, 7: medium sand, nodata: sandy silt"/>
    </shape>

Another bsdf can read the classes from the mesh attribute ``face_sediment_class``, numbered in the order of the table;
codes with the same name share a number. Near a border, ``face_second_class`` is the class on the other side and
``face_second_share`` its share; without these two, borders are sharp:

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
from mitsonar.scene.queries.height_field import withhold

from ..attributes import Attributes, Boolean, Choice, File, Integer, Nested, Number, Numbers, Text, TextOrFile
from .grid_mesh import SMOOTH_NORMALS, TO_WORLD, fill, triangulate
from .scoured import SCOUR, STANDING, Ground, scour_about_standing

MOST_NODES = 5e7        # 100 million triangles: about 10 GB once Embree has built its tree

ATTRIBUTES = (
    File("filename", text="file of the survey"),
    Numbers("crop", default=None, count=4,
            text='"west, south, east, north" limits of the part to use; or write `crop_centre` and `crop_size`'),
    Numbers("crop_centre", default=None, count=2, otherwise="the file's",
            text='"east, north" of the middle of the part to use'),
    Numbers("crop_size", default=None, count=2, unit="m", otherwise="the file's",
            text='"width, height" of the part to use'),
    Choice("crop_frame", default="projected", choices=("projected", "local"),
           text="frame of the crop and its centre: the file's coordinates, or metres from the middle of the file"),
    Number("resolution", default=0.0, minimum=0, unit="m", text="node distance; 0: as in the file"),
    Choice("vertical", default="auto", choices=("auto", "elevation", "depth"),
           text="sign of depths in the file: that of most values, positive up, or positive down"),
    Integer("band", default=1, minimum=1, text="band of the file"),
    Text("variable", default=None, text="name of the grid, for a netCDF file with several grids"),
    Number("nodata", default=None, otherwise="the file's", text="fill value of nodes without depth"),
    Text("crs", default=None, otherwise="the file's", text='coordinate system such as "EPSG:4326"'),
    Number("spacing", default=0.0, minimum=0, unit="m",
           text="node distance of an `.npy` array, whose rows run north; required for arrays"),
    Numbers("local_origin", default=None, count=2, unit="m", otherwise="middle of the part, rounded",
            text="\"east, north\" of the scene's x = y = 0"),
    Choice("holes", default="cut", choices=("cut", "filled"),
           text="`filled`: holes surrounded by soundings are filled by the smoothest bed"),
    Number("holes_max", default=None, above=0, unit="m", text="width of the widest hole to fill"),
    Boolean("relief", default=False,
            text="true: where `resolution` is finer than the file, add relief that continues the file's spectrum"),
    Integer("relief_seed", default=0, minimum=0, text="seed of the relief"),
    Number("relief_w2", default=None, minimum=0, unit="m^(4-γ)", otherwise="as measured",
           text="spectral strength of the relief"),
    Number("relief_gamma", default=None, above=2, below=4, otherwise="as measured",
           text="spectral exponent γ of the relief"),
    File("sediment_map", default=None, text="raster of sediment classes in any coordinate system, mapped to the bed"),
    TextOrFile("sediment_classes", default=None, sign=":",
               text='meaning of the codes of the map: "1: clay, 7: medium sand, nodata: sand", or a CSV file of '
                    'code, sediment'),
    Text("sediment_map_crs", default=None, otherwise="the map's or survey's", text="coordinate system of the map"),
    Number("sediment_border", default=None, minimum=0, unit="m", otherwise="a cell of the map",
           text="width of the transition between two sediments, patch by patch; 0: sharp borders"),
    *SCOUR, STANDING, SMOOTH_NORMALS, TO_WORLD,
    Nested("bsdf", default=None, otherwise="`sediment` of the map, else Mitsuba's `diffuse`",
           text="material of the bed"),
)


class Bathymetry(mi.Mesh):
    """Mesh of a surveyed seabed; the object's attributes refer to the shape before ``to_world``."""
    # local_origin [m]; bathymetry_bounds [m]

    seabed = True
    ground: Ground | None = None

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
        scour_about_standing(attributes, self)
        if table is not None:
            for name, values in (("sediment_class", painting.number), ("second_class", painting.other),
                                 ("second_share", painting.share)):
                painted: Any = mi.Float(values.astype(np.float32))
                self.add_attribute(f"face_{name}", 1, painted)
        else:
            withhold(self)                             # attributes of faces need the faces
        self.sediments = [] if table is None else table.sediments
        self.survey = survey
        self.local_origin = survey.local_origin
        self.crs = survey.crs
        self.bathymetry_bounds = survey.bounds
        self._description = (f"Bathymetry[{path}: {survey.y.size} x {survey.x.size} nodes, {survey.valid.mean():.0%} "
                             f"with depth, taken as {survey.vertical}, local origin {survey.local_origin}]")

    def to_string(self) -> str:
        """Return the source of the bed and how it was read."""
        return self._description


def _relief(attributes):
    """Return the relief below the survey's resolution, or None."""
    given = attributes.given("relief_seed", "relief_w2", "relief_gamma")
    if not attributes.relief:
        if given:
            raise attributes.error(f"{given[0]} is written without relief; write relief true.")
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
    """Return the material of a bed without a bsdf."""
    return mi.load_dict({"type": "sediment", "classes": ", ".join(table.sediments),
                         **{name: {"type": "mesh_attribute", "name": f"face_{name}"}
                            for name in ("sediment_class", "second_class", "second_share")}})


mi.register_shape("bathymetry", Bathymetry)
