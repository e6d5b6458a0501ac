"""Synthetic aperture: from the echoes that a moving array records to focused images.

    record           what a strip of raw echoes holds, and what a focused image holds: `xarray.Dataset`s
    compression      pulses to their delays, on a fine time axis
    motion           the trajectory, and polynomials of it over the echoes of a ping
    delays           travel times to moving elements, in one sound speed or through a profile
    grids            ground and slant grids, and those that a record suggests
    back_projection  a ping added to an image, on the device
    focusing         raw echoes to an image, whole or ping by ping
    point_response   width, side lobes, place and level of a point target's image
    micronavigation  the way from ping to ping out of the echoes of overlapping pings, and the track that it makes
    coherence        what lowers the coherence of two echoes; coherence_statistics: how it is estimated, and its chance
    interferometry   heights from two banks of an image
    change           two passes: shift, coherence, and what has changed
    speckle          how an image's intensity fluctuates
"""
