"""A running co-simulation FMU with displacement and velocity in and one force out."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory

from klack.errors import ConvergenceError
from klack.mechanics.fmu_child import ADVANCE, FORCE, RUN
from klack.mechanics.fmu_file import FmuDescription, unpack_fmu
from klack.mechanics.fmu_process import FmuFailed, FmuProcess
from klack.units import format_si

__all__ = ["TIME_LIMIT", "FmuSlave", "FmuWiring"]

TIME_LIMIT = 30.0
"""Time [s] for one call of an FMU; a step takes microseconds, an initialisation some seconds."""

_LARGEST = 1e9  # [N], the weight of 100 000 t: no force in a valve


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuWiring:
    """Variables of the FMU that are joined, and their size in SI.

    Parameters
    ----------
    displacement, velocity
        Name of an input, and its unit [m or m/s per unit].
    force
        Name of an output, and its unit [N per unit].
    parameters
        Parameters and start values, in the units of the FMU.
    """

    displacement: tuple[str, float] | None
    velocity: tuple[str, float] | None
    force: tuple[str, float]
    parameters: Mapping[str, float]


class FmuSlave:
    """One FMU in a process of its own; :meth:`begin` first, again for each new run.

    Every fault of the FMU becomes a :class:`~klack.errors.ConvergenceError` with its name and the
    simulated time: a status of failure, a crash, an end of its process, no answer within the time
    limit, and a force that is NaN or above 1e9 N.

    Parameters
    ----------
    time_limit [s]
        For one call.
    """

    def __init__(
        self, fmu: FmuDescription, wiring: FmuWiring, time_limit: float = TIME_LIMIT
    ) -> None:
        self.fmu, self.wiring, self.time_limit = fmu, wiring, time_limit
        self._folder = TemporaryDirectory(prefix="klack-fmu-", ignore_cleanup_errors=True)
        self._library = unpack_fmu(fmu, Path(self._folder.name))
        self._process: FmuProcess | None = None
        motion = (wiring.displacement, wiring.velocity)
        self._per_metre, self._per_speed = (1.0 / item[1] if item else 0.0 for item in motion)
        self._unit = wiring.force[1]

    def begin(self) -> None:
        """Make a new instance and enter its initialisation, in which forces can be read."""
        self.close()
        motion = (self.wiring.displacement, self.wiring.velocity)
        variables = self.fmu.variables
        given = {
            "version": self.fmu.version,
            "library": str(self._library),
            "resources": str(Path(self._folder.name) / "resources"),
            "token": self.fmu.token,
            "parameters": [
                (variables[name].reference, variables[name].kind, value)
                for name, value in self.wiring.parameters.items()
            ],
            "inputs": [variables[item[0]].reference if item else None for item in motion],
            "force": variables[self.wiring.force[0]].reference,
        }
        try:
            self._process = FmuProcess(given, self.time_limit)
        except FmuFailed as error:
            raise self._failed("in its initialisation", f"{error}") from None

    def force(self, displacement: float, velocity: float) -> float:
        """Force [N] at displacement [m] and velocity [m/s], in the initialisation."""
        return self._asked(FORCE, 0.0, 0.0, displacement, velocity)

    def run(self) -> None:
        """End the initialisation."""
        self._asked(RUN, 0.0, 0.0, 0.0, 0.0)

    def advance(self, time: float, step: float, displacement: float, velocity: float) -> float:
        """Continue from ``time`` by ``step`` [s] to a force [N]; inputs hold from the start."""
        return self._asked(ADVANCE, time, step, displacement, velocity)

    def close(self) -> None:
        """End its process; the next :meth:`begin` makes a new one."""
        if self._process is not None:
            self._process.close()
            self._process = None

    def _asked(
        self, what: int, time: float, step: float, displacement: float, velocity: float
    ) -> float:
        assert self._process is not None
        motion = displacement * self._per_metre, velocity * self._per_speed
        try:
            force = self._process.call(what, time, step, *motion) * self._unit
        except FmuFailed as error:
            raise self._failed(_when(what, time, step), f"{error}") from None
        if not abs(force) <= _LARGEST:
            got = f"a force of {force:.4g} N" if isfinite(force) else f"{force} as its force"
            self.close()
            raise self._failed(_when(what, time, step), f"answered with {got}")
        return force

    def _failed(self, when: str, what: str) -> ConvergenceError:
        return ConvergenceError(
            f"{self.fmu.path.name}: the FMU {what}, {when}.\n"
            f"Try: 'fmpy simulate {self.fmu.path.name}' alone, other parameters, a shorter "
            f"coupling_step; a time_limit above {self.time_limit:g} s if it needs that long."
        )


def _when(what: int, time: float, step: float) -> str:
    if what == ADVANCE:
        return f"in its step from {format_si(time, 's', 8)} to {format_si(time + step, 's', 8)}"
    return "in its initialisation, at 0 s"
