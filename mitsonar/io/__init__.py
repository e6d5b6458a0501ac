"""Files in and out: records and datasets, no science."""
