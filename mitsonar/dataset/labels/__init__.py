"""Labelled images for training: pictures, masks, COCO and YOLO from the ground truth in every image."""
from mitsonar.device.lazy import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
