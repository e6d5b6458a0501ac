"""Contracts of the plugins, for type checkers alone: each plugin is assigned to the protocol that mitsonar knows it by.

Nothing here runs. A plugin that no longer fulfils its protocol is an error of pyright's in this file.
"""
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mitsonar.gradients.records import pictures
    from mitsonar.scene import moving, protocols
    from mitsonar.survey.echo_sounder.kind import EchoSounderSensor
    from mitsonar.survey.integrator import SoundIntegrator
    from mitsonar.survey.interferometric.plan import InterferometricSensor
    from mitsonar.survey.multibeam.plan import MultibeamSensor
    from mitsonar.survey.sensor import Film
    from mitsonar.survey.synthetic_aperture.plan import StripSensor

    from .bsdfs.elastic import ElasticBed
    from .bsdfs.empirical import Empirical
    from .bsdfs.impedance import Impedance
    from .bsdfs.lambert import Lambert
    from .bsdfs.rigid import Rigid
    from .bsdfs.sediment import SedimentBed
    from .bsdfs.smooth import Smooth
    from .bsdfs.soft import Soft
    from .bsdfs.windy_sea import WindySea
    from .films.sonar_film import SonarFilm
    from .integrators.sonar_path import SonarPath
    from .media.seawater import Seawater
    from .sensors.array_sonar import ArraySonar
    from .sensors.echo_sounder import EchoSounder
    from .sensors.forward_looking import ForwardLooking
    from .sensors.interferometric import Interferometric
    from .sensors.multibeam import Multibeam
    from .sensors.sector_scan import SectorScan
    from .sensors.sidescan import Sidescan
    from .sensors.synthetic_aperture import SyntheticAperture
    from .shapes.bathymetry import Bathymetry
    from .shapes.moving import Moving
    from .shapes.point_target import PointTarget
    from .shapes.sea_surface import SeaSurface
    from .shapes.seabed import Seabed
    from .shapes.targets import Targets

    materials: tuple[type[protocols.SoundMaterial], ...] = (
        Lambert, SedimentBed, ElasticBed, Empirical, WindySea, Smooth, Rigid, Soft, Impedance)
    smooth: tuple[type[protocols.SmoothMaterial], ...] = Smooth, Rigid, Soft, Impedance
    beds: tuple[type[protocols.BedShape], ...] = Seabed, Bathymetry
    with_normals: tuple[type[protocols.ShapeWithNormals], ...] = Seabed, Bathymetry
    located: tuple[type[protocols.LocatedShape], ...] = (Bathymetry,)
    surfaces: tuple[type[protocols.SeaSurfaceShape], ...] = (SeaSurface,)
    targets: tuple[type[protocols.TargetShape], ...] = (PointTarget,)
    movers: tuple[type[moving.MovingShape], ...] = (Moving,)
    strewn: tuple[type[protocols.StrewnShape], ...] = (Targets,)
    waters: tuple[type[pictures.MovingWater], ...] = (Seawater,)
    films: tuple[type[Film], ...] = (SonarFilm,)
    integrators: tuple[type[SoundIntegrator], ...] = (SonarPath,)
    sidescan: type[pictures.MovingSidescan] = Sidescan
    array: type[pictures.MovingArray] = ArraySonar
    forward_looking: type[pictures.MovingForwardLooking] = ForwardLooking
    sector_scan: type[pictures.MovingScanner] = SectorScan
    echo_sounder: type[EchoSounderSensor] = EchoSounder
    multibeam: type[MultibeamSensor] = Multibeam
    interferometric: type[InterferometricSensor] = Interferometric
    synthetic_aperture: type[StripSensor] = SyntheticAperture
