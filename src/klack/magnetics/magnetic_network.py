"""A magnetic network of one's own: elements between magnetic nodes, a coil and an armature."""

from collections.abc import Mapping
from typing import ClassVar, Literal, Self

from pydantic import Field, model_validator

from klack.input.problem import CaseProblem, nearest, one_of, problem_at, refuse_key_if
from klack.input.section import Name
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.coupled_table import independent_ways
from klack.magnetics.flux_table import circuit_numbers
from klack.magnetics.gap_range import GapRange
from klack.magnetics.insulation import InsulationClass
from klack.magnetics.magnet_rows import CoilCircuit, magnet_rows, main_circuit
from klack.magnetics.network_elements import CoilElement, MovingGap, NetworkElement, WorkingGaps
from klack.magnetics.network_loops import circuit_of_network
from klack.magnetics.winding import REFERENCE_TEMPERATURE, WindingTemperature
from klack.network.component import Component
from klack.network.port import COIL, ELEMENT, Port
from klack.network.rows import Rows
from klack.units import Current, Length, Resistance

__all__ = ["MagneticNetwork"]


class MagneticNetwork(Component):
    r"""Coil and armature with a magnetic circuit of one's own.

    Elements join magnetic nodes, which have no names beyond those in ``between``.  The fluxes into
    each node add up to zero, the magnetomotive forces round each closed path too:

    .. math::

        \sum_{b \in \text{path}} \pm\bigl[\Theta_b(\varphi_b, x) - \Theta_{0,b}
            + S_b\dot\varphi_b - N_b i\bigr] = 0, \qquad
        u = R i + \sum_b N_b \dot\varphi_b, \qquad
        F = -\tfrac12\sum_b R_b'(x)\,\varphi_b^2 .

    Elements ``coil`` of one electric circuit are in series with its driver, at ``terminals`` or at
    the port of one of the ``circuits``.  The circuits, windings closed through a resistance
    (``shorted-coil``) and with a constant current (``bias-coil``) are coupled by the fluxes they
    share, which is their mutual inductance.

    Every circuit must drive some loop without eddy currents that no other drives alike, its
    leakage; otherwise its current would jump with the voltage.

    Limits: one moving direction, at most 6 independent loops and 8 circuits.
    Sources: Roters 1941; Woodson & Melcher 1968; loops by a spanning tree, Kirchhoff 1847.
    """

    type: ClassVar[str] = "magnetic-network"
    ports: ClassVar[Mapping[str, Port]] = {
        "armature": ELEMENT,
        "base": Port("mechanical", ELEMENT.role, optional=True),
        "terminals": COIL,
    }

    def port_kinds(self) -> Mapping[str, Port]:
        """Armature, base, terminals, and one port for each further circuit."""
        return {**self.ports, **dict.fromkeys(self.circuits, COIL)}

    resistance: Resistance = Field(gt=0, description="Of coils and harness, at 20 degC.")
    winding_temperature: WindingTemperature = Field(
        default=REFERENCE_TEMPERATURE, description="Of the copper, -200 to 1085 degC."
    )
    insulation_class: InsulationClass = None
    gap: Length = Field(gt=0, description="Working gap at the start, without residual gaps.")
    closes: Literal["upward", "downward"] = Field(
        default="upward", description="Armature motion that closes the gap; upward opens a valve."
    )
    elements: Mapping[Name, NetworkElement] = Field(
        min_length=2, description="Elements by name, each between two magnetic nodes."
    )
    circuits: Mapping[Name, CoilCircuit] = Field(
        default_factory=dict,
        description="Further electric circuits of its coils by name; each is a port and has its "
        "own driver.",
    )
    start_current: Current = Field(
        default=0.0, ge=0, description="Steady (holding) current before the start."
    )
    start: Literal["demagnetised", "remanent"] = Field(
        default="demagnetised",
        description="State of iron with hysteresis at the start: as new, or as left by saturation.",
    )

    @model_validator(mode="after")
    def _complete(self) -> Self:
        kinds = {element.kind for element in self.elements.values()}
        for kind, words in (("coil", "a coil"), (None, "a gap that moves: kind: pole or face")):
            refuse_key_if(
                kind not in kinds and (kind or not self._moving()),
                ("elements",),
                got=f"elements of the kinds {', '.join(sorted(kinds))}",
                expected=words,
                hint="add it, with the two nodes at its ends.",
            )
        refuse_key_if(
            self.start == "remanent"
            and not any(getattr(element, "hysteresis", None) for element in self.elements.values()),
            ("start",),
            got="start: remanent without hysteresis",
            expected="an element of iron with hysteresis",
            hint="add hysteresis to an element, or remove 'start'.",
        )
        low, high = self.gap_range().valid
        refuse_key_if(
            not low <= self.gap <= high,
            ("gap",),
            got=f"{self.gap:g} m",
            expected=f"{low:g} to {high:g} m, in which all gaps are open",
            hint="check gap and opens_from.",
        )
        self._check_circuits()
        with problem_at("elements"):
            circuit_numbers(self.circuit())
            if self.circuits:
                independent_ways(self.circuit(), ("", *self.circuits))
        return self

    def _check_circuits(self) -> None:
        """Reject circuits without coils, coils of no circuit, and names of other ports."""
        wound: dict[str, list[str]] = {"": [], **{name: [] for name in self.circuits}}
        for name, element in self.elements.items():
            if isinstance(element, CoilElement):
                circuit = element.circuit or ""
                if circuit not in wound:
                    raise CaseProblem(
                        ("elements", name, "circuit"),
                        got=f"'{circuit}'",
                        expected=f"one of circuits: {one_of(self.circuits)}"
                        if self.circuits
                        else "no circuit, because 'circuits' is empty",
                        hint=nearest(circuit, self.circuits, "add it to circuits, or leave it out"),
                    )
                wound[circuit].append(name)
        for name, coils in wound.items():
            refuse_key_if(
                not coils,
                ("circuits", name) if name else ("elements",),
                got="no coil in it" if name else "no coil at the terminals",
                expected="an element of kind coil"
                + (f" with circuit: {name}" if name else " without 'circuit'"),
                hint="the resistance of the network belongs to the coils without 'circuit'.",
            )
            refuse_key_if(
                name in self.ports,
                ("circuits", name),
                got=f"the name '{name}', which is another port",
                expected=f"a name other than {', '.join(self.ports)}",
                hint="name the circuit after its purpose: holding, closing, sensing.",
            )

    def circuit(self) -> MagneticCircuit:
        """Magnetic circuit; its ``x`` is the working gap without residual gaps."""
        gaps = WorkingGaps(start=self.gap, usable=self.gap_range().usable)
        tubes = [tube for name, part in self.elements.items() for tube in part.tubes(name, gaps)]
        return circuit_of_network(tubes, next(iter(self._moving())), self.gap)

    def gap_range(self) -> GapRange:
        """Working gaps [m] at which every moving gap is open and narrower than its face.

        A contact that yields closes some of a residual gap as well: warned of from a quarter, at
        half of it the run stops.
        """
        moving = self._moving().values()
        bounds = [part.bounds(self.gap) for part in moving]
        low, high = max(a for a, _ in bounds), min(b for _, b in bounds)
        residual = min(part.residual_gap for part in moving)
        closed_above = any(part.opens_from is not None for part in moving)
        closed_below = any(part.opens_from is None for part in moving)
        beyond = high - low
        return GapRange(
            valid=(low, high),
            slack=0.25 * residual,
            usable=(
                low - (0.5 * residual if closed_below else beyond),
                high + (0.5 * residual if closed_above else beyond),
            ),
        )

    def add_rows(self, rows: Rows) -> None:
        """Add the coil with its driver."""
        magnet_rows(
            rows,
            self.circuit(),
            self.windings(),
            gap=self.gap,
            closing=self.closes == "upward",
            gap_range=self.gap_range(),
            remanent=self.start == "remanent",
            names_loops=True,
        )

    def windings(self) -> dict[str, CoilCircuit]:
        """Electric circuits by port, that of the terminals first."""
        return {"terminals": main_circuit(self), **self.circuits}

    def _moving(self) -> dict[str, MovingGap]:
        return {name: e for name, e in self.elements.items() if isinstance(e, MovingGap)}
