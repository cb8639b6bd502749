"""A co-simulation FMU of another tool as the controller of a controlled component.

A case never names it: its binary is a program with the rights of the user, so that whoever runs the
case gives it, on the command line or in Python.  It runs in a process of its own.  At time zero its
output is read in its initialisation; at every later sampling instant it gets the signals, advances
by one sample time, and its output holds until the next instant.
"""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from klack.control.controlled import Controlled
from klack.control.law import Law
from klack.errors import InputError
from klack.input.problem import nearest, one_of
from klack.input.section import instead_of_file
from klack.mechanics.fmu_child import ADVANCE, FORCE, RUN
from klack.mechanics.fmu_file import FmuDescription, FmuVariable, describe_fmu
from klack.mechanics.fmu_slave import TIME_LIMIT, FmuInstance
from klack.units import KINDS, parse_quantity

__all__ = ["FmuController", "controlled_by_fmu"]

AnyControlled = TypeVar("AnyControlled", bound=Controlled)

_AFFINE = "degC"
_WORDS = {"V": "voltage", "N": "force", "Pa": "pressure"}


@dataclass(frozen=True, kw_only=True)
class FmuController:
    """A law that an FMU computes; made by :func:`controlled_by_fmu`.

    Parameters
    ----------
    inputs
        Input of the FMU for each sensor, and the unit of the signal over that of the input.
    output
        Output of the FMU, and its unit in V, N or Pa.
    parameters
        Parameters and start values, in the units of the FMU.
    time_limit [s]
        Of one call.
    """

    fmu: FmuDescription
    inputs: Mapping[str, tuple[str, float]]
    output: tuple[str, float]
    parameters: Mapping[str, float] = field(default_factory=dict)
    time_limit: float = TIME_LIMIT

    @property
    def told(self) -> str:
        """Its file, for the record of a run."""
        digest = hashlib.sha256(self.fmu.path.read_bytes()).hexdigest()[:12]
        return f"the FMU {self.fmu.path.name} (SHA-256 {digest}...)"

    def begin(self, period: float) -> Law:
        """Fresh instance as a function, in steps of ``period`` [s]."""
        return _Running(self)


class _Running(FmuInstance):
    def __init__(self, controller: FmuController) -> None:
        super().__init__(
            controller.fmu,
            inputs=[name for name, _ in controller.inputs.values()],
            output=controller.output[0],
            parameters=controller.parameters,
            time_limit=controller.time_limit,
            advice="another sample time",
        )
        self._of, self._last = controller, 0.0

    def __call__(self, time: float, signals: Mapping[str, float]) -> float:
        inputs = [signals[name] * size for name, (_, size) in self._of.inputs.items()]
        if self._process is None:
            self.begin()
            output = self.ask(FORCE, 0.0, 0.0, *inputs)
            self.ask(RUN, 0.0, 0.0, *inputs)
        else:
            output = self.ask(ADVANCE, self._last, time - self._last, *inputs)
        self._last = time
        return output * self._of.output[1]


def controlled_by_fmu(
    component: AnyControlled,
    file: str | Path,
    *,
    inputs: Mapping[str, str] | None = None,
    output: str | None = None,
    parameters: Mapping[str, float] | None = None,
    time_limit: float = TIME_LIMIT,
) -> AnyControlled:
    """Controlled component whose controller is an FMU for co-simulation, 2.0 or 3.0.

    Parameters
    ----------
    component
        With its sensors and its sample time; a law that it has is replaced.
    inputs
        Input of the FMU for each sensor, by default of the same name.  Signals are converted to the
        units that the inputs declare.
    output
        By default the only one, or the one called voltage, force or pressure.  One without a unit
        is in V, N or Pa.
    parameters, time_limit
        As of :class:`FmuController`.

    Raises
    ------
    InputError
        For a file that is no such FMU, and for names and units that do not fit.
    """
    path = Path(file).expanduser()
    if kind := instead_of_file(path):
        raise InputError(
            "controller",
            got=f"'{file}', {kind}",
            expected="an FMU for co-simulation",
            hint="check the spelling; the path is relative to the current folder.",
        )
    fmu = describe_fmu(path.resolve())
    found = _output(fmu, output, _WORDS.get(component.output_unit, ""))
    _require_settable(fmu, parameters or {})
    law = FmuController(
        fmu=fmu,
        inputs=_joined(fmu, component, inputs or {name: name for name in component.sensors}),
        output=(found.name, 1.0 / _size(fmu, component.output_unit, found)),
        parameters=dict(parameters or {}),
        time_limit=time_limit,
    )
    return component.model_copy(update={"controller": None}).by(law)


def _joined(
    fmu: FmuDescription, component: Controlled, joined: Mapping[str, str]
) -> dict[str, tuple[str, float]]:
    """Input of each sensor and the size of its signal there."""
    where, sensors = f"{fmu.path.name}: inputs", component.sensors
    taken: dict[str, tuple[str, float]] = {}
    for sensor, name in joined.items():
        if sensor not in sensors:
            raise InputError(
                where,
                got=f"the sensor '{sensor}'",
                expected=f"one of: {one_of(sensors) if sensors else 'no sensors'}",
                hint=nearest(sensor, sensors, "describe it under 'sensors'."),
            )
        variable = _named(fmu, f"input for the sensor '{sensor}'", name, _reals(fmu, "input"))
        taken[sensor] = (name, _size(fmu, sensors[sensor].unit, variable))
    names = {name for name, _ in taken.values()}
    free = [v.name for v in _reals(fmu, "input") if v.name not in names]
    if free:
        raise InputError(
            where,
            got=f"the input '{free[0]}' without a sensor",
            expected="a sensor for each input of the FMU",
            hint=f"add a sensor '{free[0]}' to the component, or name another one in Python.",
        )
    return taken


def _output(fmu: FmuDescription, name: str | None, usual: str) -> FmuVariable:
    """Output of that name; by default the only one, or the usual one."""
    outputs = _reals(fmu, "output")
    if name is not None:
        return _named(fmu, "output", name, outputs)
    if len(outputs) == 1:
        return outputs[0]
    for variable in outputs:
        if variable.name == usual:
            return variable
    listed = one_of([v.name for v in outputs]) if outputs else "none"
    raise InputError(
        f"{fmu.path.name}: output",
        got=f"{len(outputs)} real outputs: {listed}",
        expected=f"one, or one called '{usual}'",
        hint="name it in Python: controlled_by_fmu(..., output=...).",
    )


def _require_settable(fmu: FmuDescription, parameters: Mapping[str, float]) -> None:
    settable = [
        v.name
        for v in fmu.variables.values()
        if v.variability != "constant" and v.causality in ("parameter", "local", "output")
    ]
    for name in parameters:
        if name not in settable:
            raise InputError(
                f"{fmu.path.name}: parameters",
                got=f"'{name}'",
                expected=f"one of: {one_of(settable) if settable else 'no parameters'}",
                hint=nearest(name, settable, "inspect it with: fmpy info."),
            )


def _reals(fmu: FmuDescription, causality: str) -> list[FmuVariable]:
    found = fmu.variables.values()
    return [v for v in found if v.causality == causality and v.kind == "real"]


def _named(fmu: FmuDescription, what: str, name: str, known: list[FmuVariable]) -> FmuVariable:
    for variable in known:
        if variable.name == name:
            return variable
    names = [variable.name for variable in known]
    raise InputError(
        f"{fmu.path.name}: {what}",
        got=f"'{name}'",
        expected=f"a real variable of the FMU: {one_of(names) if names else 'none'}",
        hint=nearest(name, names, "inspect it with: fmpy info."),
    )


def _size(fmu: FmuDescription, unit: str, variable: FmuVariable) -> float:
    """A unit over that of a variable; 1 if it declares none."""
    other = variable.unit
    if other in ("", "1", unit):
        return 1.0
    if _AFFINE not in (unit, other):
        for kind in KINDS:
            try:
                one = parse_quantity(f"1 {unit}", kind, variable.name)
                return one / parse_quantity(f"1 {other}", kind, variable.name)
            except InputError:
                continue
    raise InputError(
        f"{fmu.path.name}: '{variable.name}'",
        got=f"'{other}' for a signal in '{unit}'",
        expected="units of one kind",
        hint="change the unit of the sensor, or use another variable.",
    )
