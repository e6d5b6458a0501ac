"""Images on maps: mosaics, pictures in metres, places on Earth."""
