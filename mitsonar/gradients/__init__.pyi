from .elements.elements import ElementModel as ElementModel
from .model import ForwardModel as ForwardModel, Linearised as Linearised, Values as Values
from .parameters.changes import (
    Heights as Heights,
    InDecibels as InDecibels,
    Log as Log,
    Offset as Offset,
    OnNodes as OnNodes,
    Pose as Pose,
)
from .parameters.parametrisation import parametrised as parametrised
from .records.scene_model import SceneModel as SceneModel
from .soundings.sounding_bed import BedGrid as BedGrid
from .soundings.sounding_times import SoundingTimes as SoundingTimes
