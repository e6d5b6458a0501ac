from .comparing import compare as compare
from .record import LineComparison as LineComparison
