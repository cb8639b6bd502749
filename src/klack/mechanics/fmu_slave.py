"""A running co-simulation FMU with displacement and velocity in and one force out.

The differences of FMI 2.0 and 3.0 stay in here.
"""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from weakref import finalize

from klack.errors import ConvergenceError, InputError
from klack.mechanics.fmu_file import FmuDescription, unpack_fmu

__all__ = ["FmuSlave", "FmuWiring"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FmuWiring:
    """Which variables of the FMU are joined, and their size in SI.

    Parameters
    ----------
    displacement, velocity : tuple of str and float, or None
        Name of an input, and its unit in SI units [m or m/s per unit].
    force : tuple of str and float
        Name of an output, and its unit [N per unit].
    parameters : mapping of str to float
        Parameters and start values, in the units of the FMU.
    """

    displacement: tuple[str, float] | None
    velocity: tuple[str, float] | None
    force: tuple[str, float]
    parameters: Mapping[str, float]


class FmuSlave:
    """One instance of an FMU; :meth:`begin` first, which may be repeated for a new run.

    Parameters
    ----------
    fmu : FmuDescription
    wiring : FmuWiring
    """

    def __init__(self, fmu: FmuDescription, wiring: FmuWiring) -> None:
        self.fmu, self.wiring = fmu, wiring
        self.messages: deque[str] = deque(maxlen=10)
        self._folder = TemporaryDirectory(prefix="klack-fmu-")
        self._library = unpack_fmu(fmu, Path(self._folder.name))
        self._slave: Any = None
        self._close: finalize | None = None

    def begin(self) -> None:
        """Make a new instance and enter its initialisation, in which forces can be asked for."""
        self.close()
        self._slave = self._guarded("a new instance", self._instance)
        self._close = finalize(self, _free, self._slave, self._folder)
        self._guarded("its parameters", self._set_parameters)
        self._guarded("its initialisation", self._initialise)

    def force(self, displacement: float, velocity: float) -> float:
        """Force [N] at displacement [m] and velocity [m/s]; in initialisation, or after a step."""
        return float(self._guarded("its output", lambda: self._exchange(displacement, velocity)))

    def run(self) -> None:
        """End the initialisation."""
        self._guarded("the end of its initialisation", lambda: self._slave.exitInitializationMode())

    def advance(self, time: float, step: float, displacement: float, velocity: float) -> float:
        """Go on from ``time`` by ``step`` [s]; inputs hold from the start of the step.

        Returns
        -------
        float
            Force [N] at the end of the step.
        """

        def go() -> float:
            self._set(displacement, velocity)
            done = self._slave.doStep(time, step)
            if self.fmu.version == 3 and (done[1] or done[2]):
                raise RuntimeError("it stopped before the end of the step")
            return self._get()

        return float(self._guarded(f"its step at {time:.6g} s", go))

    def close(self) -> None:
        """Free the instance; the next :meth:`begin` makes a new one."""
        if self._close is not None:
            self._close.detach()
            _free(self._slave, None)
            self._close = None

    # --------------------------------------------------------------------- FMI 2.0 and 3.0

    def _instance(self) -> Any:
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        given = {
            "guid": self.fmu.token,
            "modelIdentifier": self.fmu.identifier,
            "unzipDirectory": self._folder.name,
            "instanceName": "klack",
            "libraryPath": str(self._library),
        }
        if self.fmu.version == 2:
            slave = FMU2Slave(**given)
            slave.instantiate(callbacks=_callbacks(self.messages))
        else:
            slave = FMU3Slave(**given)
            said = self.messages  # not self: the slave must not keep its owner alive
            slave.instantiate(logMessage=lambda _, __, ___, text: said.append(_decoded(text)))
        return slave

    def _set_parameters(self) -> None:
        for name, value in self.wiring.parameters.items():
            variable = self.fmu.variables[name]
            words = {"real": "Float64", "integer": "Int32", "boolean": "Boolean"}
            if self.fmu.version == 2:
                words = {"real": "Real", "integer": "Integer", "boolean": "Boolean"}
            number: Any = value if variable.kind == "real" else int(value)
            getattr(self._slave, f"set{words[variable.kind]}")([variable.reference], [number])

    def _initialise(self) -> None:
        if self.fmu.version == 2:
            self._slave.setupExperiment(startTime=0.0)
            self._slave.enterInitializationMode()
        else:
            self._slave.enterInitializationMode(startTime=0.0)

    def _exchange(self, displacement: float, velocity: float) -> float:
        self._set(displacement, velocity)
        return self._get()

    def _set(self, displacement: float, velocity: float) -> None:
        for joined, value in (
            (self.wiring.displacement, displacement),
            (self.wiring.velocity, velocity),
        ):
            if joined is not None:
                reference = self.fmu.variables[joined[0]].reference
                write = self._slave.setReal if self.fmu.version == 2 else self._slave.setFloat64
                write([reference], [value / joined[1]])

    def _get(self) -> float:
        name, unit = self.wiring.force
        read = self._slave.getReal if self.fmu.version == 2 else self._slave.getFloat64
        return float(read([self.fmu.variables[name].reference])[0]) * unit

    def _guarded(self, what: str, action: Callable[[], Any]) -> Any:
        """Turn whatever fmpy raises into words, with the last thing that the FMU said."""
        try:
            return action()
        except InputError:
            raise
        except Exception as error:  # fmpy raises plain exceptions, one kind for every status
            said = f" It says: {self.messages[-1]}" if self.messages else ""
            raise ConvergenceError(
                f"{self.fmu.path.name}: the FMU failed in {what} ({error}).{said}\n"
                "Try: a shorter coupling_step, other parameters, and 'fmpy simulate' alone."
            ) from error


def _free(slave: Any, folder: TemporaryDirectory[str] | None) -> None:
    slave.freeInstance()
    if folder is not None:
        folder.cleanup()


def _callbacks(messages: deque[str]) -> Any:
    """Callbacks of FMI 2.0 that keep what the FMU says instead of printing it."""
    from fmpy import calloc, free
    from fmpy.fmi2 import (
        fmi2CallbackAllocateMemoryTYPE,
        fmi2CallbackFreeMemoryTYPE,
        fmi2CallbackFunctions,
        fmi2CallbackLoggerTYPE,
        fmi2StepFinishedTYPE,
    )

    def keep(_: Any, __: Any, ___: Any, ____: Any, text: Any) -> None:
        messages.append(_decoded(text))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(keep)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    callbacks.stepFinished = fmi2StepFinishedTYPE()
    return callbacks


def _decoded(text: Any) -> str:
    return text.decode(errors="replace") if isinstance(text, bytes) else str(text)
