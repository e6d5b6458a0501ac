from .picture import as_image as as_image
from .reading import read as read, recognised as recognised
