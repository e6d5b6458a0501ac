"""A Mitsuba scene for sound: plugin registration, loading, errors, geometry, labels and materials."""
