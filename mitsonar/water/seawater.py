"""Sound speed of seawater by TEOS-10.

    p = p(depth, latitude)    SA = SA(salinity, p, longitude, latitude)    c = c(SA, T, p)

T -> ``temperature`` [deg C, ITS-90], in situ. The full Gibbs function is used, not its 75-term fit (rms 0.07 m/s).
"""
import gsw

from .ranges import checked


def sound_speed(temperature, salinity, depth, latitude=45.0, longitude=-20.0):
    """Give the sound speed of seawater from what a CTD measures.

    Parameters
    ----------
    temperature : array [deg C]
        In situ, ITS-90.
    salinity : array [-]
        Practical salinity.
    depth : array [m]
        Positive down.
    latitude, longitude : array [deg]
        Where: gravity changes the pressure at a depth, and the mix of salts differs between seas (by less than
        0.1 m/s together). All arguments broadcast.

    Returns
    -------
    array [m/s]

    Raises
    ------
    ValueError
        If an argument is not finite or outside ``water.ranges.RANGES``; the value is named.

    Notes
    -----
    IOC, SCOR and IAPSO (2010), TEOS-10. Differs from Chen and Millero (1977) by up to 0.1 m/s in shallow water
    and 0.3 m/s at 1000 m.
    """
    temperature, salinity, depth, latitude, longitude = checked(
        "sound speed", temperature=temperature, salinity=salinity, depth=depth, latitude=latitude,
        longitude=longitude)
    pressure = gsw.p_from_z(-depth, latitude)
    absolute_salinity = gsw.SA_from_SP(salinity, pressure, longitude, latitude)
    return gsw.sound_speed_t_exact(absolute_salinity, temperature, pressure)
