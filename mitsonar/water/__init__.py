"""Water: sound speed, absorption and noise, as plain functions of depth, temperature and salinity."""
from .absorption import absorption_db, ainslie_mccolm_db, francois_garrison_db, thorp_db
from .noise import ambient_noise_db, noise_components_db, thermal_noise_db
from .profile import SoundSpeedProfile
from .seawater import sound_speed
from .volume import VolumeScattering, volume_reverberation_db

__all__ = ["SoundSpeedProfile", "VolumeScattering", "absorption_db", "ainslie_mccolm_db", "ambient_noise_db",
           "francois_garrison_db", "noise_components_db", "sound_speed", "thermal_noise_db", "thorp_db",
           "volume_reverberation_db"]
