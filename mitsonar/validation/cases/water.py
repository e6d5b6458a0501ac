"""Sound speed, absorption and ambient noise against printed numbers and other implementations."""
import gsw
import numpy as np

from mitsonar.water.absorption import absorption_db
from mitsonar.water.noise import ambient_noise_db, thermal_noise_db
from mitsonar.water.seawater import sound_speed

from ..case import Case, Compared, Curve, Panel, Table, worst

LATITUDE = 45.0
SPEEDS = {                         # temperature [deg C], salinity, depth [m] -> m/s by formula
    "teos-10": {(10, 35, 0): 1489.78863, (10, 35, 50): 1490.60958, (15, 35, 20): 1507.00371,
                (4, 35, 1000): 1482.98378, (20, 30, 5): 1515.94989, (8, 0, 5): 1439.23023, (25, 38, 50): 1538.43433},
    "chen-millero": {(10, 35, 0): 1489.83212, (10, 35, 50): 1490.66208, (15, 35, 20): 1507.01051,
                     (4, 35, 1000): 1483.25596, (20, 30, 5): 1515.97919, (8, 0, 5): 1439.22061,
                     (25, 38, 50): 1538.49333},
    "mackenzie": {(10, 35, 0): 1489.80340, (10, 35, 50): 1490.61882, (15, 35, 20): 1507.01829,
                  (4, 35, 1000): 1482.95520, (20, 30, 5): 1515.86970, (25, 38, 50): 1538.36104},
    "medwin": {(10, 35, 0): 1489.99, (10, 35, 50): 1490.79, (15, 35, 20): 1507.12375, (4, 35, 1000): 1482.73856,
               (20, 30, 5): 1515.90, (8, 0, 5): 1438.60848, (25, 38, 50): 1538.42625},
}
WONG_ZHU = {                       # Wong and Zhu (1995), Table III: pressure [bar], temperature, salinity -> m/s
    (0, 0, 35): 1449.139, (0, 0, 25): 1435.790, (200, 0, 30): 1475.448, (100, 10, 25): 1494.127,
    (300, 30, 35): 1595.909, (500, 20, 35): 1604.492, (1000, 0, 35): 1623.150, (400, 10, 40): 1562.547}
MACKENZIE = (25.0, 35.0, 1000.0), 1550.744         # Mackenzie (1981), printed check
KHZ = (10, 50, 100, 300, 500, 900)
ABSORPTION = {                     # temperature, salinity, depth, pH -> dB/km at KHZ
    "francois-garrison": {
        (10, 35, 0, 8.0): (0.96264, 15.39191, 33.63032, 73.13931, 124.67276, 299.46258),
        (10, 35, 50, 8.0): (0.95647, 15.28317, 33.39953, 72.75268, 124.17761, 298.62886),
        (4, 35, 200, 7.9): (1.10516, 14.70786, 26.80241, 64.44847, 129.11862, 353.69978),
        (20, 35, 10, 8.1): (0.76682, 13.00925, 38.03664, 101.86179, 146.54070, 274.05515),
        (25, 38, 20, 8.2): (0.78823, 12.33799, 39.63395, 128.08330, 179.04252, 295.76395),
        (8, 0.5, 10, 7.0): (0.04805, 1.05375, 3.79591, 30.94084, 84.88211, 273.60828),
        (5, 33, 100, 8.0): (1.04265, 14.30259, 26.91451, 64.00081, 126.05011, 341.14967)},
    "ainslie-mccolm": {
        (10, 35, 0, 8.0): (0.98657, 15.70968, 34.34102, 76.15058, 132.09674, 322.30851),
        (10, 35, 50, 8.0): (0.97956, 15.58486, 34.07518, 75.68291, 131.45504, 321.10420),
        (4, 35, 200, 7.9): (1.12085, 14.84259, 27.03723, 65.98877, 133.36515, 367.43860),
        (20, 35, 10, 8.1): (0.78622, 13.09952, 38.83190, 107.11640, 155.02028, 290.60312),
        (25, 38, 20, 8.2): (0.81293, 12.13002, 39.72978, 136.38547, 192.26447, 313.57350),
        (8, 0.5, 10, 7.0): (0.05147, 1.12318, 4.05088, 33.33742, 91.61658, 295.53863),
        (5, 33, 100, 8.0): (1.06282, 14.46953, 27.16811, 65.82963, 131.24767, 358.18527)},
    "thorp": {(10, 35, 0, 8.0): (1.189830, 17.529923, 34.318963, 69.196189, 118.403343, 286.891705)},
}
NOISE_KHZ = (10, 30, 100, 300, 500)
NOISE = {                          # wind [m/s] -> dB re 1 µPa²/Hz at NOISE_KHZ, shipping 1/2
    0: (29.3547, 21.2689, 25.1331, 34.5441, 38.9796), 5: (46.0899, 37.0227, 28.9437, 34.6219, 38.9898),
    10: (53.0359, 43.9496, 34.2035, 34.9222, 39.0306)}
THERMAL = {1e3: -14.636762, 100e3: 25.363238, 500e3: 39.342638}      # Mellen (1952), 290 K, 1025 kg/m³, 1500 m/s


def _speeds():
    for formula, table in SPEEDS.items():
        got = [sound_speed(*state, LATITUDE, formula=formula) for state in table]
        yield worst(f"sound speed, {formula}", got, list(table.values()), 1e-4, "m/s")
    got = [sound_speed(t, s, -gsw.z_from_p(10.0 * bar, LATITUDE), LATITUDE, formula="chen-millero")
           for bar, t, s in WONG_ZHU]
    yield worst("sound speed, chen-millero, as Wong and Zhu print it", got, list(WONG_ZHU.values()), 6e-4, "m/s")
    state, printed = MACKENZIE
    yield Compared("sound speed, mackenzie, as printed", float(sound_speed(*state, formula="mackenzie")), printed, 6e-4,
              "m/s")


def _absorptions():
    for formula, table in ABSORPTION.items():
        got = [1e3 * absorption_db(1e3 * np.array(KHZ), *state, formula=formula) for state in table]
        yield worst(f"absorption, {formula}, 10 to 900 kHz", got, list(table.values()), 1e-5, "dB/km")


def _noises():
    for wind, levels in NOISE.items():
        got = ambient_noise_db(1e3 * np.array(NOISE_KHZ), wind, 0.5)
        yield worst(f"ambient noise, wind {wind} m/s", got, levels, 1e-4, "dB")
    got = thermal_noise_db(list(THERMAL), temperature=290 - 273.15)
    yield worst("thermal noise", got, list(THERMAL.values()), 1e-6, "dB")


def _run(quick):
    khz = np.geomspace(5, 1000, 200)
    losses = [line for formula, table in ABSORPTION.items() for line in (
        Curve(formula, khz, 1e3 * absorption_db(1e3 * khz, formula=formula)),
        Curve(formula, KHZ, table[10, 35, 0, 8.0], "."))]
    noises = [line for wind, levels in NOISE.items() for line in (
        Curve(f"wind {wind} m/s", khz, ambient_noise_db(1e3 * khz, wind)),
        Curve(f"wind {wind} m/s", NOISE_KHZ, levels, "."))]
    return Table((*_speeds(), *_absorptions(), *_noises()), (
        Panel("10 deg C, 35, surface, pH 8", "frequency [kHz]", "absorption [dB/km]", tuple(losses), "xy"),
        Panel("ambient noise", "frequency [kHz]", "dB re 1 µPa²/Hz", tuple(noises), "x")))


CASE = Case(title="Sound speed, absorption, ambient noise", run=_run, text=(
    "Formulas against numbers printed with them (Wong and Zhu 1995; Mackenzie 1981) and against other implementations "
    "(TEOS-10 by gsw; Francois and Garrison 1982; Ainslie and McColm 1998; Thorp 1967; Wenz 1962 as fitted by Coates "
    "1990; Mellen 1952). The allowed error is the last digit of the numbers. The quick run is the same."))
