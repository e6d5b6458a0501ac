from mitsonar.labels.rules import Labels as Labels

from ..sources import find_sources as find_sources
from ..split import deal as deal, read_shares as read_shares
from .reading import LabelledPicture as LabelledPicture, read as read
from .writing import groups_of as groups_of, write as write
