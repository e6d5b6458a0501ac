"""A Mitsuba scene as sound meets it: loading, errors, geometry, labels, materials."""
