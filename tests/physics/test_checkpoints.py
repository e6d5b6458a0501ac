"""Every checked number of a table kept beside the checkout whose formula is one of ours.

Closed form: the published formulas, computed by other implementations. Bias: none. Tolerances are the table's own,
those of the digits it was checked to; numbers printed with pressure are asked at the depth of that pressure.
"""
import json
from pathlib import Path

import gsw
import numpy as np
import pytest

from mitsonar.scattering import backscatter_strength_db, bubble_loss_db
from mitsonar.water import (absorption_db, ambient_noise_db, noise_components_db, sound_speed, thermal_noise_db,
                            volume_reverberation_db)

TABLE = Path(__file__).resolve().parents[2] / ".." / "shared" / "reference" / "physics_checkpoints.json"
LATITUDE = 45.0
SPEEDS = {"teos_exact": "teos-10", "wong_zhu": "chen-millero", "mackenzie": "mackenzie", "medwin": "medwin",
          "leroy2008": "leroy-robinson-goldsmith"}


def francois_garrison(f_kHz, T, S, D_m, pH):
    """Absorption [dB/km]."""
    return {"alpha": 1000 * absorption_db(1e3 * f_kHz, T, S, D_m, pH, formula="francois-garrison")}


def ainslie_mccolm(f_kHz, T, S, z_km, pH):
    """Absorption [dB/km]."""
    return 1000 * absorption_db(1e3 * f_kHz, T, S, 1e3 * z_km, pH, formula="ainslie-mccolm")


def thorp(f_kHz):
    """Absorption [dB/km]."""
    return 1000 * absorption_db(1e3 * f_kHz, formula="thorp")


def wong_zhu(T90, S, P_bar):
    """Sound speed [m/s]."""
    return sound_speed(T90, S, -gsw.z_from_p(10 * P_bar, LATITUDE), LATITUDE, formula="chen-millero")


def speeds(T90, S, z_m, p_dbar, SA):
    """Sound speed [m/s] by formula."""
    return {name: sound_speed(T90, S, z_m, formula=formula) for name, formula in SPEEDS.items()}


def surface_loss(U_ms, f_kHz, grazing_deg):
    """Loss of a bounce [dB]."""
    return bubble_loss_db(np.radians(grazing_deg), 1e3 * f_kHz, U_ms)


def surface_strength(U_ms, f_kHz, grazing_deg):
    """Backscatter strength [dB]."""
    return {"total_dB": backscatter_strength_db("sea_surface", np.radians(grazing_deg), 1e3 * f_kHz, wind_speed=U_ms)}


def noise(f_kHz, wind_ms, shipping):
    """Level of each component and of all [dB re 1 uPa^2/Hz]."""
    given = 1e3 * f_kHz, wind_ms, shipping
    return [float(level) for level in (*noise_components_db(*given).values(), ambient_noise_db(*given))]


def thermal_noise(f_Hz, T_K, rho, c):
    """Level [dB re 1 uPa^2/Hz]."""
    return thermal_noise_db(f_Hz, T_K - 273.15, c, rho)


def volume_reverberation(SL, R, alpha, Sv, psi, tau):
    """Level [dB re 1 uPa]."""
    return volume_reverberation_db(SL, R, Sv, psi, tau, alpha)


# how the table's name of a formula begins -> what answers it, and the fewest records there are of it
ANSWERS = {
    "Francois-Garrison 1982": (francois_garrison, 28),
    "Ainslie-McColm 1998": (ainslie_mccolm, 28),
    "Thorp": (thorp, 4),
    "Chen-Millero, Wong&Zhu 1995": (wong_zhu, 8),
    "T90 degC, S practical, depth z": (speeds, 7),
    "surface bubble loss": (surface_loss, 4),
    "APL-UW surface backscatter": (surface_strength, 21),
    "Wenz/Coates NL": (noise, 10),
    "Mellen thermal": (thermal_noise, 2),
    "volume reverberation": (volume_reverberation, 1),
}


@pytest.mark.parametrize("formula", ANSWERS)
def test_every_checked_number(formula, record_property):
    if not TABLE.is_file():
        pytest.skip(f"the checked numbers are not beside the checkout ({TABLE})")
    answer, fewest = ANSWERS[formula]
    records = [record for record in json.loads(TABLE.read_text()) if record["formula"].startswith(formula)]
    for record in records:
        size, *words = record["tolerance"].split()
        tolerance = {"rel": float(size), "abs": 0.0} if words == ["rel"] else {"rel": 0.0, "abs": float(size)}
        got, wanted = answer(**record["inputs"]), record["output"]
        if isinstance(got, dict):
            wanted = {name: wanted[name] for name in got}
        assert got == pytest.approx(wanted, **tolerance), record["id"]
    record_property("records", len(records))
    print(f"{formula}: {len(records)} records")
    assert len(records) >= fewest
