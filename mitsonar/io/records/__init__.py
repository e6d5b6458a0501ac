"""Records of mitsonar in files: EXR, netCDF, HDF5, GeoTIFF."""
