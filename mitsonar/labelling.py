"""Labels for training, by the name that they had before they stood in `mitsonar.dataset.labels`."""
from mitsonar.dataset.labels.rules import Labels
from mitsonar.dataset.labels.writing import groups_of, write
from mitsonar.dataset.sources import find_sources
from mitsonar.dataset.split import deal, read_shares

__all__ = ["Labels", "deal", "find_sources", "groups_of", "read_shares", "write"]
