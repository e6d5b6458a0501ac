"""Water: sound speed, absorption and noise, as plain functions of depth, temperature and salinity."""
from .absorption import absorption_db, ainslie_mccolm_db, francois_garrison_db
from .profile import SoundSpeedProfile

__all__ = ["SoundSpeedProfile", "absorption_db", "ainslie_mccolm_db", "francois_garrison_db"]
