# In a checkout the package mitsonar.plugins is the folder plugins/ at the top: where checkers and editors find it.
from plugins import LOCK as LOCK, MODULES as MODULES, install as install, reference as reference, register as register
