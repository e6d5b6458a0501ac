"""Labelled images for training: pictures, masks, COCO and YOLO from the truth that every image carries."""
from ..sources import find_sources
from ..split import deal, read_shares
from .rules import Labels
from .writing import groups_of, write

__all__ = ["Labels", "deal", "find_sources", "groups_of", "read_shares", "write"]
