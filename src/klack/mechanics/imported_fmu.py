"""A functional mock-up unit of another tool as a force on a body."""

from collections.abc import Iterable, Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.errors import InputError
from klack.input.problem import CaseProblem, nearest, one_of, problem_at, refuse_key_if
from klack.input.section import InputPath, Number
from klack.mechanics.fmu_coupling import STATES, FmuCoupling
from klack.mechanics.fmu_file import FmuDescription, FmuVariable, describe_fmu
from klack.mechanics.fmu_slave import TIME_LIMIT, FmuSlave, FmuWiring
from klack.network.component import Component
from klack.network.port import ELEMENT, Port
from klack.network.rows import Book, Channel, Rows
from klack.network.step_function import python_step
from klack.units import FORCE, LENGTH, SPEED, Kind, Time, parse_quantity

__all__ = ["ImportedFmu"]

_MOST_NAMES = 20


class ImportedFmu(Component):
    r"""Co-simulation FMU (FMI 2.0 or 3.0) that answers a motion with a force.

    It gets the displacement of ``end`` against ``base`` along +z since the start, and its rate, and
    gives the force along +z on ``end`` (and the opposite on ``base``): that of a spring is negative
    for a positive displacement.  Variables without a declared unit are in m, m/s, N.

    Exchange at every ``coupling_step`` (:mod:`klack.mechanics.fmu_coupling`); its energy error is
    the entry ``<component> coupling error`` of the energy balance.

    Limits: a force that depends on the motion stiffly makes the explicit coupling unstable; for a
    stiffness k against a mass m keep the coupling step well below :math:`\sqrt{m/k}`.  The static
    equilibrium takes its force at rest from its initialisation, which is right only for forces
    without memory.  A run cannot continue from a stored state.

    The binary has the rights of the user.  It runs in a process of its own: its faults, and a call
    longer than ``time_limit``, stop the run with a message
    (:class:`klack.mechanics.fmu_slave.FmuSlave`).

    Source: Functional Mock-up Interface 2.0.4 and 3.0.1; S. Sadjina et al., Engineering with
    Computers 33 (2017) 607.
    """

    type: ClassVar[str] = "fmu"
    ports: ClassVar[Mapping[str, Port]] = {
        "end": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
    }

    file: InputPath = Field(description="FMU for co-simulation, relative to the case.")
    coupling_step: Time = Field(
        gt=0, description="Time between two exchanges, in whole steps of the time loop."
    )
    displacement: str | None = Field(
        default=None, description="Input for the displacement of 'end' relative to 'base'."
    )
    velocity: str | None = Field(
        default=None, description="Input for the mean velocity since the last exchange."
    )
    force: str = Field(description="Output with the force along +z on 'end'.")
    parameters: Mapping[str, Number] = Field(
        default_factory=dict,
        description="Parameters and start values by name, in the units of the FMU.",
    )
    extrapolation: Literal["linear", "hold"] = Field(
        default="linear", description="Force between two exchanges: linear, or hold the last value."
    )
    time_limit: Time = Field(
        default=TIME_LIMIT,
        gt=0,
        description="Longest wall-clock time that one call of the FMU may take.",
    )

    @model_validator(mode="after")
    def _variables_exist(self) -> Self:
        if self.displacement is None and self.velocity is None:
            raise CaseProblem(
                (),
                got="neither 'displacement' nor 'velocity'",
                expected="at least one input for the motion",
                hint=f"inputs of {self.file.name}: {_some(self._named('input'))}.",
            )
        self._wiring()
        return self

    def _description(self) -> FmuDescription:
        with problem_at("file"):
            return describe_fmu(self.file)

    def _named(self, *causalities: str) -> list[str]:
        found = self._description().variables.values()
        return [item.name for item in found if item.causality in causalities]

    def _wiring(self) -> FmuWiring:
        def joined(key: str, name: str | None, kind: Kind) -> tuple[str, float] | None:
            if name is None:
                return None
            return name, _unit(key, self._variable((key,), name, "input"), kind)

        output = self._variable(("force",), self.force, "output")
        for name in self.parameters:
            self._parameter(name)
        return FmuWiring(
            displacement=joined("displacement", self.displacement, LENGTH),
            velocity=joined("velocity", self.velocity, SPEED),
            force=(self.force, _unit("force", output, FORCE)),
            parameters=self.parameters,
        )

    def _variable(self, key: tuple[str, ...], name: str, *causalities: str) -> FmuVariable:
        """Variable of that name and role; a real number unless it is a parameter."""
        known = self._description().variables
        fitting = self._named(*causalities)
        if name not in fitting:
            other = f", which is '{known[name].causality}'" if name in known else ""
            raise CaseProblem(
                key,
                got=f"'{name}'{other}",
                expected=f"an {' or '.join(causalities)} of {self.file.name}: {_some(fitting)}",
                hint=nearest(name, fitting, "inspect it with: fmpy info."),
            )
        refuse_key_if(
            known[name].kind != "real" and key[0] != "parameters",
            key,
            got=f"'{name}', which is not a single real number",
            expected="a real variable",
            hint="take another one.",
        )
        return known[name]

    def _parameter(self, name: str) -> None:
        settable = self._description().variables.values()
        names = [
            item.name
            for item in settable
            if item.variability != "constant"
            and item.causality in ("parameter", "structuralParameter", "local", "output")
            and item.kind != "other"
        ]
        if name not in names:
            raise CaseProblem(
                ("parameters", name),
                got=f"'{name}'",
                expected=f"a parameter or start value of {self.file.name}: {_some(names)}",
                hint=nearest(name, names, "inspect it with: fmpy info."),
                on_key=True,
            )

    def add_rows(self, rows: Rows) -> None:
        """Add one element with its own instance of the FMU."""
        slave = FmuSlave(self._description(), self._wiring(), self.time_limit)
        coupling = FmuCoupling(slave, self.coupling_step, self.extrapolation)
        rows.element(
            python_step(coupling, parameters=0, states=STATES, inputs=6, outputs=4 + STATES),
            ports=(rows.port("end"), rows.port("base")),
            parameters=(),
            state=(0.0,) * STATES,
            books=(Book("work", "supply"), Book("coupling error", "loss")),
            channels=(Channel("force of the FMU", "N", 3, derived=True),),
            interval=self.coupling_step,
        )


def _unit(key: str, variable: FmuVariable, kind: Kind) -> float:
    """Unit of a variable in SI; 1 if it declares none."""
    if not variable.unit or variable.unit == "1":
        return 1.0
    try:
        return parse_quantity(f"1 {variable.unit}", kind, variable.name)
    except InputError as error:
        raise CaseProblem(
            (key,),
            got=f"'{variable.name}' in '{variable.unit}'",
            expected=f"{kind.name}",
            hint="take another variable.",
        ) from error


def _some(names: Iterable[str]) -> str:
    listed = list(names)
    more = f", ... ({len(listed)} in all)" if len(listed) > _MOST_NAMES else ""
    return one_of(listed[:_MOST_NAMES]) + more
