# In a checkout the package mitsonar.plugins is the folder plugins/ at the top: here checkers and editors find it.
from plugins import (
    BASES as BASES,
    MODULES as MODULES,
    PLUGINS as PLUGINS,
    attributes as attributes,
    install as install,
    instruments as instruments,
    page as page,
    reference as reference,
)
