"""From what an echo sounder measures, angles and times, to soundings; and the planning of surveys.

    record        what a line of soundings holds: one `xarray.Dataset`, whoever made it
"""
