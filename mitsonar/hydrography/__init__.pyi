from . import record as record, survey_orders as survey_orders
from .detection import (
    bottom_backscatter as bottom_backscatter,
    row_angles as row_angles,
    snippets as snippets,
)
from .detection.detection import Detections as Detections, Head as Head, detect as detect
from .detection.sounding_beams import SoundingBeams as SoundingBeams
from .gridding import gridded as gridded, residual as residual
from .reduction import errors as errors, resounding as resounding, smile as smile, uncertainty as uncertainty
from .reduction.attitude import PlatformMotion as PlatformMotion, PlatformPose as PlatformPose
from .reduction.reduction import (
    Installation as Installation,
    Located as Located,
    Measured as Measured,
    located as located,
)
from .reduction.resounding import resounded as resounded
