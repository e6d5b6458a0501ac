"""A sonar that is stepped: one ping after the other, at poses that are given as they come."""
from __future__ import annotations

from collections.abc import Generator
from contextlib import contextmanager
from types import TracebackType

import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike

from mitsonar.device.files import FilePath
from mitsonar.device.turns import TURN, one_at_a_time
from mitsonar.io.records.records import SonarImage, SonarSignals, not_all_nan
from mitsonar.scene.errors import as_exception
from mitsonar.survey.kinds import stepped_kind_of
from mitsonar.survey.pressure.signals import received_signals
from mitsonar.survey.stepping import SteppedRun
from mitsonar.water.profile import SoundSpeedProfile

from .images import checked_seed, checked_snippets, opened, provenance, read_profile, read_reference

ZERO = (0.0, 0.0, 0.0)


class Sonar:
    """Hold a sonar that can be stepped: its next ping may depend on what it has received.

    Parameters
    ----------
    scene : mitsuba.Scene, or str or path
        A scene as in `mitsonar.render`. The route of its sensor is the plan of what all pings share: its speed is the
        greatest that a ping may have, its interval is the default one, and time window, sampling rate and the sound
        speed of the beams are those at its depth.
    seed : int
        Seed of rays, scatterers (unless the scene sets ``ground_seed``) and noise, as in `mitsonar.render`.
    sensor : int or str
        Number or id of one of the scene's sensors.
    **parameters
        Values for the ``$parameters`` of a scene that is given by name or path, as in `mitsonar.load_file`.

    Raises
    ------
    FileNotFoundError, TypeError
        As in `mitsonar.render`.
    ValueError
        As in `mitsonar.render`, or if the kind of sonar makes one record of all its pings together.

    Notes
    -----
    The scene is loaded and its tables are made once, when the sonar is made. A ping at another depth makes a table of
    rays for that depth, as `mitsonar.frames` does; no kernel is compiled for it. Memory does not grow with the number
    of pings. The same calls give the same bytes, and the poses of a planned track that is steady while echoes arrive
    give the pictures of `mitsonar.frames`.
    """

    @one_at_a_time
    def __init__(self, scene: mi.Scene | FilePath, seed: int = 0, *, sensor: int | str = 0,
                 **parameters: object) -> None:
        self._seed = checked_seed(seed)
        opened_scene, sonar, integrator = opened(scene, sensor, parameters)
        stepped_kind_of(sonar)
        self._name, self._pings = f'{sonar.kind} "{sonar.id()}"', 0
        try:
            run = SteppedRun(opened_scene, sonar, integrator, self._seed)
        except RuntimeError as error:
            raise as_exception(error) from error
        self._run: SteppedRun | None = run
        self._origin = provenance(opened_scene, sonar, run.survey)

    def ping(self, *, position: ArrayLike, attitude: ArrayLike = ZERO, velocity: ArrayLike = ZERO,
             turn_rate: ArrayLike = ZERO, time: float | None = None) -> SonarImage:
        """Send the next ping, and return its picture.

        Parameters
        ----------
        position : (3,) [m]
            Place of the sonar at the transmission, in the scene's frame: x east, y north, z up from the sea surface,
            or from the datum of a tide.
        attitude : (3,) [rad]
            Roll, pitch and heading, of a rotating head those of its platform. If left out: level, towards north.
        velocity : (3,) [m/s]
            Velocity in the scene's frame, constant while echoes arrive. If left out: at rest.
        turn_rate : (3,) [rad/s]
            Angular velocity about the axes of the scene's frame, constant while echoes arrive; a turn to starboard is
            negative about z. If left out: none.
        time : float [s]
            Time of the transmission. If left out: the time of the last ping plus the interval of the scene's route;
            for the first ping, the time at which the route begins.

        Returns
        -------
        SonarImage
            Picture of the ping: a frame as from `mitsonar.frames`, the row of a sidescan, the step of a rotating
            head.

        Raises
        ------
        ValueError
            If a number is not finite or a shape is wrong, time runs back, the sonar is above the surface, under the
            bed or beyond the scene, or it is faster than the scene's route. The sonar then stays at its last ping.
        """
        with self._sent(position, attitude, velocity, turn_rate, time) as (run, ping):
            return SonarImage.of(not_all_nan(run.frame(ping)).assign_attrs({**self._origin, **run.stated}))

    def signals(self, *, position: ArrayLike | None = None, attitude: ArrayLike = ZERO, velocity: ArrayLike = ZERO,
                turn_rate: ArrayLike = ZERO, time: float | None = None) -> SonarSignals:
        """Return the signals of the receive elements at the last ping or, with a position, at the next one.

        Parameters
        ----------
        position, attitude, velocity, turn_rate, time
            As in `ping`, for the next ping. Without them: the last ping, also one whose picture was asked for.

        Returns
        -------
        SonarSignals
            Signals of one ping, as from `mitsonar.element_signals`.

        Raises
        ------
        ValueError
            As in `ping`, or if the last ping was asked for and there was none.
        """
        with self._sent(position, attitude, velocity, turn_rate, time) as (run, ping):
            record = run.record()
            array = received_signals(record, [ping])
            return SonarSignals.of(not_all_nan(array).assign_attrs(
                seed=self._seed, kernel=record.kernel, return_path=record.return_path,
                **{**self._origin, **run.stated}))

    def soundings(self, profile: SoundSpeedProfile | FilePath | None = None, *,
                  tide: float | FilePath | None = None, separation: float | FilePath | None = None,
                  heights: str = "tide", column: bool = False, snippets: int = 0,
                  position: ArrayLike | None = None, attitude: ArrayLike = ZERO, velocity: ArrayLike = ZERO,
                  turn_rate: ArrayLike = ZERO, time: float | None = None) -> SonarImage:
        """Return the soundings of a multibeam at the last ping or, with a position, at the next one.

        Parameters
        ----------
        profile, tide, separation, heights, column, snippets
            As in `mitsonar.soundings`.
        position, attitude, velocity, turn_rate, time
            As in `ping`, for the next ping. Without them: the last ping, also one whose picture was asked for.

        Returns
        -------
        SonarImage
            Soundings of one ping, as from `mitsonar.soundings`, with the motion about this ping.

        Raises
        ------
        ValueError
            As in `ping` and `mitsonar.soundings`, or if the last ping was asked for and there was none.
        """
        samples, cast = checked_snippets(snippets), read_profile(profile)
        by = read_reference(tide, separation, heights)
        with self._sent(position, attitude, velocity, turn_rate, time) as (run, _):
            image = run.sounded(cast, by, column=column, snippets=samples)
            origin = {**self._origin, **run.stated, "seed": self._seed}
            return SonarImage.of(image.assign_attrs({**origin, **image.attrs, "seed": self._seed}))

    def move(self, name: str, *, position: ArrayLike, attitude: ArrayLike = ZERO, velocity: ArrayLike = ZERO,
             turn_rate: ArrayLike = ZERO, time: float | None = None) -> None:
        """Move an object of the scene for the next ping; it goes on from there at constant rates until moved again.

        Parameters
        ----------
        name : str
            The ``id`` of a shape ``moving``.
        position : (3,) [m]
            Place of the object's origin, in the scene's frame.
        attitude : (3,) [rad]
            Roll, pitch and heading. If left out: level, towards north.
        velocity : (3,) [m/s]
            Velocity in the scene's frame. If left out: at rest.
        turn_rate : (3,) [rad/s]
            Angular velocity about the axes of the scene's frame. If left out: none.
        time : float [s]
            Time at which the object is there. If left out: that of the next ping.

        Raises
        ------
        ValueError
            If no shape of this name moves, a number is not finite or a shape is wrong, or the place is not in the
            water.
        """
        with TURN:
            if self._run is None:
                raise ValueError("this sonar is closed; make another one to move objects")
            self._run.move(name, position, attitude, velocity, turn_rate, time)

    @contextmanager
    def _sent(self, position: ArrayLike | None, attitude: ArrayLike, velocity: ArrayLike, turn_rate: ArrayLike,
              time: float | None) -> Generator[tuple[SteppedRun, int], None, None]:
        """Go to the next ping, or stay at the last one without a position; go back if the work there fails."""
        with TURN:
            run = self._run
            if run is None:
                raise ValueError("this sonar is closed; make another one to send pings")
            before = now = run.latest
            if position is not None:
                now = run.step(position, attitude, velocity, turn_rate, time)
            elif time is not None or any(np.any(given) for given in (attitude, velocity, turn_rate)):
                raise ValueError("attitude, velocity, turn_rate or time was given without a position; give the "
                                 "position of the next ping, or nothing for the last one")
            if now is None:
                raise ValueError("the last ping was asked for, and this sonar has sent none; give a position")
            run.go(now)
            try:
                yield run, now.ping
            except BaseException as error:
                run.go(before)
                if isinstance(error, RuntimeError):
                    raise as_exception(error) from error
                raise
            self._pings = now.ping + 1

    @property
    def pings(self) -> int:
        """Number of pings that the sonar has sent."""
        return self._pings

    def close(self) -> None:
        """Free the memory of the sonar's tables; a closed sonar sends no pings."""
        self._run = None

    def __enter__(self) -> Sonar:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None,
                 trace: TracebackType | None) -> None:
        self.close()

    def __repr__(self) -> str:
        run = self._run
        state = "closed" if run is None else f"next at {run.next_time:.6g} s"
        return f"Sonar({self._name}, seed {self._seed}, {self._pings} pings, {state})"
