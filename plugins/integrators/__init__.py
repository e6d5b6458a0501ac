"""From scene to echoes."""
