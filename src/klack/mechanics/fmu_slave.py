"""A running co-simulation FMU, and one with displacement and velocity in and one force out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from tempfile import TemporaryDirectory

from klack.errors import ConvergenceError
from klack.mechanics.fmu_child import ADVANCE, FORCE, RUN
from klack.mechanics.fmu_file import FmuDescription, unpack_fmu
from klack.mechanics.fmu_process import FmuFailed, FmuProcess
from klack.units import format_si

__all__ = ["TIME_LIMIT", "FmuInstance", "FmuSlave", "FmuWiring"]

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


class FmuInstance:
    """One FMU in a process of its own; :meth:`begin` first, again for each new run.

    Every fault of the FMU becomes a :class:`~klack.errors.ConvergenceError` with its name and the
    simulated time: a status of failure, a crash, an end of its process, and no answer within the
    time limit.

    Parameters
    ----------
    inputs
        Names of its inputs; None for one that it does not have.
    parameters
        Parameters and start values, in the units of the FMU.
    time_limit [s]
        For one call.
    advice
        What to try where it fails.
    """

    def __init__(
        self,
        fmu: FmuDescription,
        *,
        inputs: Sequence[str | None],
        output: str,
        parameters: Mapping[str, float],
        time_limit: float,
        advice: str,
    ) -> None:
        self.fmu, self.time_limit, self._advice = fmu, time_limit, advice
        self._folder = TemporaryDirectory(prefix="klack-fmu-", ignore_cleanup_errors=True)
        variables = fmu.variables
        self._given = {
            "version": fmu.version,
            "library": str(unpack_fmu(fmu, Path(self._folder.name))),
            "resources": str(Path(self._folder.name) / "resources"),
            "token": fmu.token,
            "parameters": [
                (variables[name].reference, variables[name].kind, value)
                for name, value in parameters.items()
            ],
            "inputs": [None if name is None else variables[name].reference for name in inputs],
            "force": variables[output].reference,
        }
        self._process: FmuProcess | None = None

    def begin(self) -> None:
        """Make a new instance and enter its initialisation, in which its output can be read."""
        self.close()
        try:
            self._process = FmuProcess(self._given, self.time_limit)
        except FmuFailed as error:
            raise self.failed("in its initialisation", f"{error}") from None

    def ask(self, what: int, time: float, step: float, *inputs: float) -> float:
        """Output after a call of the FMU, all in its units."""
        assert self._process is not None
        try:
            return self._process.call(what, time, step, *inputs)
        except FmuFailed as error:
            raise self.failed(_when(what, time, step), f"{error}") from None

    def close(self) -> None:
        """End its process; the next :meth:`begin` makes a new one."""
        if self._process is not None:
            self._process.close()
            self._process = None

    def failed(self, when: str, what: str) -> ConvergenceError:
        """Error with what the FMU did, and when."""
        name = self.fmu.path.name
        return ConvergenceError(
            f"{name}: the FMU {what}, {when}.\n"
            f"Try: run only 'fmpy simulate {name}', {self._advice}, or a time_limit above "
            f"{self.time_limit:g} s if it needs that long."
        )


class FmuSlave(FmuInstance):
    """An FMU with displacement and velocity in and one force out.

    A force that is NaN or above 1e9 N is a fault, too.
    """

    def __init__(
        self, fmu: FmuDescription, wiring: FmuWiring, time_limit: float = TIME_LIMIT
    ) -> None:
        motion = (wiring.displacement, wiring.velocity)
        super().__init__(
            fmu,
            inputs=[item[0] if item else None for item in motion],
            output=wiring.force[0],
            parameters=wiring.parameters,
            time_limit=time_limit,
            advice="other parameters, a shorter coupling_step",
        )
        self._per_metre, self._per_speed = (1.0 / item[1] if item else 0.0 for item in motion)
        self._unit = wiring.force[1]

    def force(self, displacement: float, velocity: float) -> float:
        """Force [N] at displacement [m] and velocity [m/s], in the initialisation."""
        return self._asked(FORCE, 0.0, 0.0, displacement, velocity)

    def run(self) -> None:
        """End the initialisation."""
        self._asked(RUN, 0.0, 0.0, 0.0, 0.0)

    def advance(self, time: float, step: float, displacement: float, velocity: float) -> float:
        """Continue from ``time`` by ``step`` [s] to a force [N]; inputs hold from the start."""
        return self._asked(ADVANCE, time, step, displacement, velocity)

    def _asked(
        self, what: int, time: float, step: float, displacement: float, velocity: float
    ) -> float:
        motion = displacement * self._per_metre, velocity * self._per_speed
        force = self.ask(what, time, step, *motion) * self._unit
        if not abs(force) <= _LARGEST:
            got = f"a force of {force:.4g} N" if isfinite(force) else f"{force} as its force"
            self.close()
            raise self.failed(_when(what, time, step), f"answered with {got}")
        return force


def _when(what: int, time: float, step: float) -> str:
    if what == ADVANCE:
        return f"in its step from {format_si(time, 's', 8)} to {format_si(time + step, 's', 8)}"
    return "in its initialisation, at 0 s"
