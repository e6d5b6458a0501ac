"""Write grids of soundings as surfaces for hydrographic software: depth and uncertainty in one file.

    .bag    Bathymetric Attributed Grid 1.6.2 (Open Navigation Surface)     elevation = - depth
    .h5     S-102 Bathymetric Surface 3.0.0 (IHO, 2024)                     depth, positive down

Nodes are the middles of the grid's cells, the first row in the south; empty nodes hold 1e6. Uncertainty is that of the
grid (a standard deviation) or, of a grid that has none, the standard deviation of the soundings in a cell, which is
unknown (1e6) where there is one.

GDAL makes the BAG. It is copied data set by data set after that, since GDAL stores the time at which it wrote.
"""
from __future__ import annotations

import os
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
import xarray as xr

from mitsonar.device.earth import metric_system, transformed
from mitsonar.device.files import FilePath, replacing
from mitsonar.version import __version__

__all__ = ["SUFFIXES", "write"]

BAG, S102 = ".bag", ".h5"
SUFFIXES = (BAG, S102)
EMPTY = np.float32(1e6)
NO_DATE = "1970-01-01T00:00:00Z"
LOCAL = 24                         # S-100's code of a datum that its list lacks
# S-100 part 17: codes of vertical datums, by name without spaces and case.
DATUMS = {"meanlowwatersprings": 1, "mlws": 1, "meansealevel": 3, "msl": 3, "lowestlowwater": 4, "meanlowwater": 5,
          "mlw": 5, "lowestlowwatersprings": 6, "indianspringlowwater": 8, "meanlowerlowwater": 12, "mllw": 12,
          "lowwater": 13, "lw": 13, "meanhighwater": 16, "mhw": 16, "meanhighwatersprings": 17, "mhws": 17,
          "highwater": 18, "meanhigherhighwater": 21, "mhhw": 21, "lowestastronomicaltide": 23, "lat": 23,
          "localdatum": 24, "internationalgreatlakesdatum1985": 25, "igld1985": 25, "meanwaterlevel": 26, "mwl": 26,
          "lowerlowwaterlargetide": 27, "llwlt": 27, "higherhighwaterlargetide": 28, "hhwlt": 28,
          "highestastronomicaltide": 30, "hat": 30, "balticseachartdatum2000": 44, "bscd2000": 44,
          "hydrographiczero": 49}
S102_SYSTEMS = {4326, 5041, 5042, *range(32601, 32661), *range(32701, 32761)}
RANGES = (("depth", "-14", "11050", "closedInterval"), ("uncertainty", "0", "", "geSemiInterval"))


def write(chart: xr.Dataset, path: FilePath) -> tuple[str, ...]:
    """Write a grid of soundings as a BAG or as S-102, whole or not at all.

    Parameters
    ----------
    chart : xarray.Dataset
        Grid that `mitsonar.hydrography.gridding.gridded` returns. The attributes ``crs`` and, if present,
        ``vertical_datum`` and ``start`` (the date of the file) go into the file.
    path : str or path
        Output file, .bag or .h5.

    Returns
    -------
    tuple of str
        Remarks on what the format cannot hold.

    Raises
    ------
    ValueError
        If the grid has no depth or no coordinate system in metres, or one that S-102 does not allow.
    FileNotFoundError, PermissionError, OSError
        If the file cannot be written there.
    """
    crs = chart.attrs.get("crs")
    if crs is None:
        raise ValueError("the lines name no coordinate system, and a BAG or S-102 needs one; name it in the scene "
                         "(crs), or write a GeoTIFF.")
    system = metric_system(crs)
    depth = chart["depth"].values[::-1]
    if not np.isfinite(depth).any():
        raise ValueError("no cell of the grid has a depth; take fewer soundings a cell (--least) or larger cells.")
    own = "uncertainty" in chart
    spread = chart["uncertainty"] if own else chart["deviation"].where(chart["count"] > 1)
    layers = depth.astype(np.float32), spread.values[::-1].astype(np.float32)
    with replacing(path) as temporary:
        if os.path.splitext(path)[1].lower() == BAG:
            return _write_bag(chart, system, layers, own, temporary)
        return _write_s102(chart, system, layers, temporary)


def _filled(values):
    return np.where(np.isfinite(values), values, EMPTY).astype(np.float32)


def _described(chart, own):
    """Return one sentence on the layers."""
    spread = "standard deviation of the depth" if own else "standard deviation of the soundings in a cell"
    return (f"Depths of soundings in cells of {chart.attrs['cell']:g} m, rule {chart.attrs['rule']}; uncertainty: "
            f"{spread}. Written by mitsonar {__version__}.")


def _write_bag(chart, system, layers, own, path) -> tuple[str, ...]:
    import rasterio
    from rasterio.errors import RasterioError
    from rasterio.transform import from_origin

    datum = str(chart.attrs.get("vertical_datum") or "unknown").replace('"', "")
    cell, date = chart.attrs["cell"], _date(chart)
    depth, spread = layers
    about = {"ABSTRACT": _described(chart, own), "VERTICAL_UNCERT_CODE": "unknown" if own else "rawStdDev",
             "PROCESS_STEP_DESCRIPTION": f"Soundings gridded by mitsonar {__version__}", "DATE": date[:10],
             "DATETIME": date[:19], "VERT_WKT": f'VERT_CS["{datum} height",VERT_DATUM["{datum}",2005],UNIT["metre",1],'
                                                'AXIS["Gravity-related height",UP]]'}
    with TemporaryDirectory() as folder:
        made = os.path.join(folder, "made.bag")
        try:
            with rasterio.open(made, "w", driver="BAG", height=depth.shape[0], width=depth.shape[1], count=2,
                               dtype="float32", nodata=float(EMPTY), crs=system.to_wkt("WKT1_GDAL"),
                               transform=from_origin(chart["x"].values[0] - cell / 2, chart["y"].values[0] + cell / 2,
                                                     cell, cell),
                               **{f"VAR_{name}": text for name, text in about.items()}) as raster:
                raster.write(_filled(-depth[::-1]), 1)
                raster.write(_filled(spread[::-1]), 2)
        except RasterioError as error:
            raise ValueError(f"cannot write a BAG: {' '.join(str(error).split())}") from None
        with h5py.File(made) as source, h5py.File(path, "w") as file:
            root = file.create_group("BAG_root")
            root.attrs.update(source["BAG_root"].attrs)
            for name, data in source["BAG_root"].items():
                kept = {"compression": "gzip", "fillvalue": data.fillvalue} if data.ndim > 1 else {}
                root.create_dataset(name, data=data[()], maxshape=data.maxshape, chunks=data.chunks, **kept)
                root[name].attrs.update(data.attrs)
    return () if "vertical_datum" in chart.attrs else (
        "the lines name no vertical datum, so that of the BAG is unknown",)


def _date(chart):
    return str(chart.attrs.get("start") or NO_DATE)


def _write_s102(chart, system, layers, path) -> tuple[str, ...]:
    code = system.to_epsg()
    if code not in S102_SYSTEMS:
        raise ValueError(f"the lines lie in {chart.attrs['crs']}, and S-102 takes UTM or UPS zones of WGS 84 only; "
                         "write a BAG, or give scenes and lines such a zone.")
    named = chart.attrs.get("vertical_datum")
    datum = DATUMS.get("".join(str(named).lower().split()))
    cell, (south, west) = chart.attrs["cell"], (chart["y"].values[-1], chart["x"].values[0])
    rows, columns = layers[0].shape
    edges = west - cell / 2, south - cell / 2, west + (columns - 0.5) * cell, south + (rows - 0.5) * cell
    with h5py.File(path, "w") as file:
        _set(file, productSpecification="INT.IHO.S-102.3.0.0", issueDate=_date(chart)[:10].replace("-", ""),
             horizontalCRS=np.int32(code), verticalCS=np.int32(6498), verticalDatum=np.uint16(datum or LOCAL),
             verticalCoordinateBase=_chosen(2, seaSurface=1, verticalDatum=2, seaBottom=3),
             verticalDatumReference=_chosen(1, s100VerticalDatum=1, EPSG=2), **_bounds(_on_globe(system, edges)))
        features = file.create_group("Group_F")
        features["featureCode"] = np.array(["BathymetryCoverage"], h5py.string_dtype())
        columns_of = ("code", "name", "uom.name", "fillValue", "datatype", "lower", "upper", "closure")
        features["BathymetryCoverage"] = np.array(
            [(name, name, "metres", f"{EMPTY:.0f}", "H5T_FLOAT", *limits) for name, *limits in RANGES],
            [(name, h5py.string_dtype()) for name in columns_of])
        coverage = file.create_group("BathymetryCoverage")
        coverage["axisNames"] = np.array(["Easting", "Northing"], h5py.string_dtype())
        _set(coverage, dimension=np.uint8(2), horizontalPositionUncertainty=np.float32(-1),
             verticalUncertainty=np.float32(-1), numInstances=np.uint8(1),
             dataCodingFormat=_chosen(2, fixedStations=1, regularGrid=2, ungeorectifiedGrid=3, movingPlatform=4,
                                      irregularGrid=5, variableCellSize=6, TIN=7, stationwiseFixed=8,
                                      featureOrientedRegularGrid=9),
             commonPointRule=_chosen(2, average=1, low=2, high=3, all=4),
             interpolationType=_chosen(1, nearestneighbor=1, bilinear=5, biquadratic=6, bicubic=7, discrete=10),
             dataOffsetCode=_chosen(5, **{"XMin, YMin": 1, "XMax, YMax": 2, "XMax, YMin": 3, "XMin, YMax": 4,
                                          "Barycenter": 5}))
        _set(coverage, **{"sequencingRule.type": _chosen(1, linear=1, boustrophedonic=2, CantorDiagonal=3, spiral=4,
                                                         Morton=5, Hilbert=6),
                          "sequencingRule.scanDirection": "Easting, Northing"})
        instance = coverage.create_group("BathymetryCoverage.01")
        _set(instance, gridOriginLongitude=west, gridOriginLatitude=south, gridSpacingLongitudinal=float(cell),
             gridSpacingLatitudinal=float(cell), numPointsLongitudinal=np.uint32(columns),
             numPointsLatitudinal=np.uint32(rows), numGRP=np.uint8(1), startSequence="0,0", **_bounds(edges))
        group = instance.create_group("Group_001")
        values = np.empty((rows, columns), [(name, np.float32) for name, *_ in RANGES])
        for (name, *_), layer in zip(RANGES, layers):
            values[name] = _filled(layer)
            known = layer[np.isfinite(layer)] if np.isfinite(layer).any() else np.array([EMPTY])
            _set(group, **{f"minimum{name.capitalize()}": known.min(), f"maximum{name.capitalize()}": known.max()})
        _set(group, timePoint="00010101T000000Z")
        group.create_dataset("values", data=values, compression="gzip",
                             fillvalue=np.array((EMPTY, EMPTY), values.dtype))
    if datum is not None:
        return ()
    return (f"S-102 has no code for the vertical datum {named}, so the file names a local datum" if named else
            "the lines name no vertical datum, so the S-102 names a local one",)


def _on_globe(system, edges):
    """Return west, south, east and north [degrees] of a box (west, south, east, north) [m]."""
    west, south, east, north = edges
    place = np.linspace(0.0, 1.0, 21)
    x = np.concatenate([west + place * (east - west)] * 2 + [np.full(21, west), np.full(21, east)])
    y = np.concatenate([np.full(21, south), np.full(21, north)] + [south + place * (north - south)] * 2)
    longitude, latitude = transformed(system, "EPSG:4326", x, y)
    return longitude.min(), latitude.min(), longitude.max(), latitude.max()


def _bounds(edges) -> dict[str, np.float32]:
    names = ("westBoundLongitude", "southBoundLatitude", "eastBoundLongitude", "northBoundLatitude")
    return {name: np.float32(edge) for name, edge in zip(names, edges)}


def _chosen(value: int, **names: int) -> tuple[int, np.dtype]:
    """Return a value with the HDF5 enumeration that it belongs to."""
    return value, h5py.enum_dtype(names, basetype="u1")


def _set(place: h5py.Group, **values: Any) -> None:
    for name, value in values.items():
        number, kind = value if isinstance(value, tuple) else (value, None)
        place.attrs.create(name, number, dtype=kind)
