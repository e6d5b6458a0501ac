"""Small casts of every format, made up: a few samples each, and of recordings the air, the soak and the way up."""

CARIS = """[SVP_VERSION_2]
made_up.svp
Section 2021-100 06:30:00 54:10:30.0 -007:30:00.0
0.5 1490.5
2.0 1490.0
9.0 1486.0
"""

CASTAWAY = """% Device,CC0000001
% Cast time (UTC),2021-04-10 06:30:00
% Start latitude,54.175
% Start longitude,-7.5
%
Pressure (Decibar),Depth (Meter),Temperature (Celsius),Salinity (Practical Salinity Scale),\
Sound velocity (Meters per Second)
0.5,0.5,11.0,33.0,1492.0
2.0,2.0,10.5,33.2,1490.5
9.0,8.9,9.0,34.0,1486.2
"""

# Conductivity [mS/cm], temperature, pressure [dbar], battery, salinity, density, sound speed; salinity by PSS-78
AML = """[cast header]
[Instrument]
Type=Base.X2
DateFormat=ISO
Date=2021-04-10
Time=06:30:00
DisplayTime=yes
DisplayDate=yes
DisplaySalinity=yes
DisplayDensity=yes
DisplaySoundVelocity=yes
DisplayBattery=yes
Latitude=54.175

[Slot 1]
SensorName=SV-C-CT.Xchange CT.X C SN 100001 01/02/21 T SN 100001 01/02/21

[Slot 2]
SensorName=P-T.Xchange P.X SN 100002 01/02/21

[Data.X]
Latitude=No-Lock
Longitude=-7.5

[data]

2021-04-10,06:30:01.10,00.100,12.000,0000.02,007.20,00.062,0999.56,1456.80
2021-04-10,06:30:02.10,36.900,11.000,0000.60,007.20,32.869,1024.84,1490.81
2021-04-10,06:30:03.10,36.800,10.500,0003.00,007.20,33.220,1025.20,1489.51
2021-04-10,06:30:04.10,36.500,09.000,0009.00,007.20,34.318,1026.35,1485.51
2021-04-10,06:30:05.10,36.700,10.000,0004.00,007.20,33.579,1025.56,1488.17
2021-04-10,06:30:06.10,00.200,12.000,0000.01,007.20,00.128,0999.61,1456.90
"""

AML_TITLES = """[cast header]
[Instrument]
Date=04/10/21
Time=06:30:00.5
[data]
Date,Time,SV (m/s),Temperature (C),Depth (m),Calc. SV (m/s)
2021-04-10,06:30:01.10,0.000,12.000,0.02,0.0
2021-04-10,06:30:02.10,1490.85,11.000,0.60,1490.81
2021-04-10,06:30:03.10,1489.54,10.500,3.00,1489.51
2021-04-10,06:30:04.10,1485.53,09.000,9.00,1485.51
"""

AML_NEWER = """[Header]
SerialNumber=100001
Date=2021-04-10
Time=06:30:00.00
GPSLatitude=54.175
GPSLongitude=-7.5
[MeasurementMetadata]
Columns=Date,Time,Pressure,Cond,TempCT,TempSV
Units=yyyy-mm-dd,hh:mm:ss.ss,dbar,S/m,C,C
[MeasurementData]
2021-04-10,06:30:02.10,0.60,3.69,11.0,11.1
2021-04-10,06:30:03.10,3.00,3.68,10.5,10.6
2021-04-10,06:30:04.10,9.00,3.65,9.0,9.1
"""

KONGSBERG = """( SoundVelocity 1.0 0 202104100630 54.175 -7.5 -1 0 0 made_up P 0003 )
0.00 1490.50
2.00 1490.00
9.00 1486.00
"""

# In air twice, a soak at 1.2 dbar with a turn at 0.6, the way down with one sample of heave, the way up, in air
SEABIRD = """* Sea-Bird SBE19plus Data File:
* FileName = made_up.hex
** Latitude: 54 10.5 N
** Longitude: 007 30.0 W
* S>* cast   1 10 Apr 2021 06:30:00 samples 1 to 13, avg = 1, stop = mag switch
# nquan = 7
# nvalues = 15
# name 0 = prdM: Pressure, Strain Gauge [db]
# name 1 = c0S/m: Conductivity [S/m]
# name 2 = tv290C: Temperature [ITS-90, deg C]
# name 3 = sal00: Salinity, Practical [PSU]
# name 4 = sigma-\N{LATIN SMALL LETTER E WITH ACUTE}00: Density [sigma-theta, Kg/m^3]
# name 5 = svCM: Sound Velocity [Chen-Millero, m/s]
# name 6 = flag: flag
# start_time = Apr 10 2021 09:00:00 [System UpLoad Time]
# bad_flag = -9.990e-29
*END*
     -0.020   0.010000    12.0000     0.0600     -0.500    1456.80 0.0000e+00
      0.010   0.020000    12.0000     0.1200     -0.400    1456.90 0.0000e+00
      0.700   3.500000    11.9000    30.0000     22.700    1491.90 0.0000e+00
      1.200   3.690000    11.0000    32.8685     24.800    1490.85 0.0000e+00
      1.200   3.690000    11.0000    32.8685     24.800    1490.85 0.0000e+00
      1.190   3.690000    11.0000    32.8685     24.800    1490.85 0.0000e+00
      0.600   3.690000    11.0000    32.8685     24.800    1490.81 0.0000e+00
      0.610   3.690000    11.0000    32.8685     24.800    1490.85 0.0000e+00
      0.900   3.690000    11.0000    32.8685     24.800    1490.81 0.0000e+00
      3.000   3.680000    10.5000    33.2198     25.200    1489.51 0.0000e+00
 -9.990e-29   3.680000    10.5000    33.2198     25.200    1489.51 0.0000e+00
      2.900   3.680000    10.5000    33.2198     25.200    1489.51 0.0000e+00
      9.000   3.650000     9.0000    34.3180     26.300    1485.51 0.0000e+00
      4.000   3.670000    10.0000    33.5788     25.500    1488.17 0.0000e+00
     -0.010   0.100000    12.0000     0.6000     -0.200    1457.50 0.0000e+00
"""

HYPACK = """FTP NEW 3 54.175 -7.5 06:30 04/10/2021
0.0 1490.50
2.0 1490.20
2.0 1489.80
9.0 1486.00
"""

VALEPORT = """Now: 10/04/2021 06:30:00
Battery Level: 1.4V
MiniSVP: S/N 10001
Site info: MADE UP
Calibrated: 04/01/2021
Latitude: 54.175
Mode: P9.999993e-2
Tare: 10.154
Pressure units: dBar
00.010\t12.000\t0000.000
00.600\t11.000\t1490.850
03.000\t10.500\t1489.540
09.000\t09.000\t1485.530
04.000\t10.000\t1488.020
-0.010\t12.000\t0000.000
"""

TABLE = """depth (m),temperature (deg C),salinity (psu),sound_speed (m/s)
0.5,11.0,33.0,1492.0
2.0,10.5,33.2,1490.5
9.0,9.0,34.0,1486.2
"""

CTD_TABLE = """pressure (dbar);temperature (deg C);conductivity (mS/cm)
0,5;11,0;36,9
2,0;10,5;36,8
9,0;9,0;36,5
"""

SAMPLES = {"CARIS SVP": [CARIS], "CastAway CSV": [CASTAWAY], "AML CSV": [AML, AML_TITLES, AML_NEWER],
           "Kongsberg ASVP": [KONGSBERG], "Sea-Bird CNV": [SEABIRD], "HYPACK VEL": [HYPACK],
           "Valeport MiniSVP": [VALEPORT], "table of depth and sound speed": [TABLE, CTD_TABLE]}
