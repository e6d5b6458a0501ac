"""Track of a synthetic aperture from the echoes of overlapping pings."""
