from .reading import read as read, recognised as recognised
