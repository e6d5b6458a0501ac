"""What the formats of soundings hold of the record, for the words on what they do not."""

__all__ = ["COLUMN", "SOUNDINGS"]

SOUNDINGS = frozenset({
    "cast_depth", "cast_sound_speed", "transmit_offset", "receive_offset", "transmit_mounting", "receive_mounting",
    "motion_time", "motion_x", "motion_y", "motion_depth", "motion_roll", "motion_pitch", "motion_heading",
    "ping_time", "ping_x", "ping_y", "ping_depth", "ping_roll", "ping_pitch", "ping_heading", "head_sound_speed",
    "sector_frequency", "sector_delay", "sector_angle", "sector_pulse_length", "sector_bandwidth",
    "sector_source_level_db", "sector_absorption_db", "travel_time", "angle", "transmit_angle", "sector", "depth",
    "x", "y", "across_track", "along_track", "detection", "quality", "uncertainty", "horizontal_uncertainty",
    "backscatter_db", "snippet_rate", "snippet_start", "snippet_db", "head",
})
COLUMN = frozenset({"column_angle", "column_sector", "column_start", "column_rate", "column_level_db"})
