# In a checkout the package mitsonar.plugins is the folder plugins/ at the top: this is where checkers and editors find it.
from plugins import LOCK as LOCK, MODULES as MODULES, attributes as attributes, install as install
from plugins import reference as reference, register as register
