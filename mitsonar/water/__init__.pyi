from .absorption import (
    absorption_db as absorption_db,
    ainslie_mccolm_db as ainslie_mccolm_db,
    francois_garrison_db as francois_garrison_db,
    thorp_db as thorp_db,
)
from .noise import (
    ambient_noise_db as ambient_noise_db,
    noise_components_db as noise_components_db,
    thermal_noise_db as thermal_noise_db,
)
from .profile import SoundSpeedProfile as SoundSpeedProfile
from .seawater import sound_speed as sound_speed
from .volume import VolumeScattering as VolumeScattering, volume_reverberation_db as volume_reverberation_db
