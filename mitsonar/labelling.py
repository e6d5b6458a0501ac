"""Labels for training, by the name that they had before they stood in `mitsonar.dataset.labels`."""
from mitsonar.dataset.labels import Labels, deal, find_sources, groups_of, read_shares, write

__all__ = ["Labels", "deal", "find_sources", "groups_of", "read_shares", "write"]
