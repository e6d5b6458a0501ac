# In a checkout the package mitsonar.plugins is the folder plugins/ at the top: here checkers and editors find it.
from plugins import (
    LOCK as LOCK,
    PLUGINS as PLUGINS,
    attributes as attributes,
    install as install,
    page as page,
    reference as reference,
    register as register,
)
