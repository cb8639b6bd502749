"""Every component type that a case file may name, and the sections of fluid and gas.

A case file may also name a class of the user's own as ``package.module:Class``, but never has it
imported: the reader of the case gets the class, from Python or by the option ``--component``.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import Any

from klack.errors import InputError, KlackError, refuse_if
from klack.input.problem import CaseProblem, nearest, one_of, refuse_key_if
from klack.input.section import Section
from klack.network.component import Component

__all__ = [
    "COMPONENTS",
    "component_class",
    "component_classes",
    "component_word",
    "fluid_section",
    "gas_section",
    "import_component",
    "source_digests",
    "type_words",
]


# Registering a component type is one line here: type word and where its class is.  The word must be
# the class's own ``type``; words are joined by hyphens, like all words that a case may choose from.
# Nothing is imported before a case asks for it.
COMPONENTS = (
    # mechanics
    ("rigid-mass", "klack.mechanics.rigid_mass.RigidMass"),
    ("flexible-body", "klack.mechanics.flexible_body.FlexibleBody"),
    ("spring", "klack.mechanics.spring.Spring"),
    ("prescribed-motion", "klack.mechanics.prescribed_motion.PrescribedMotion"),
    ("nonlinear-spring", "klack.mechanics.nonlinear_spring.NonlinearSpring"),
    ("surging-spring", "klack.mechanics.surging_spring.SurgingSpring"),
    ("lever", "klack.mechanics.lever.Lever"),
    ("constant-force", "klack.mechanics.force.ConstantForce"),
    ("force-over-time", "klack.mechanics.force.ForceOverTime"),
    ("force-over-stroke", "klack.mechanics.force_over_stroke.ForceOverStroke"),
    ("guide-friction", "klack.mechanics.friction.GuideFriction"),
    ("lugre-friction", "klack.mechanics.lugre_friction.LuGreFriction"),
    ("controlled-force", "klack.mechanics.controlled_force.ControlledForce"),
    ("gravity", "klack.mechanics.gravity.Gravity"),
    ("end-stop", "klack.mechanics.end_stop.EndStop"),
    ("rubber-stop", "klack.mechanics.rubber_stop.RubberStop"),
    ("fmu", "klack.mechanics.imported_fmu.ImportedFmu"),
    # hydraulics
    ("chamber", "klack.hydraulics.chamber.Chamber"),
    ("pressure-source", "klack.hydraulics.pressure_source.PressureSource"),
    ("controlled-pressure", "klack.hydraulics.controlled_pressure.ControlledPressure"),
    ("flow-source", "klack.hydraulics.flow_source.FlowSource"),
    ("pressure-face", "klack.hydraulics.pressure_face.PressureFace"),
    ("land-face", "klack.hydraulics.land_face.LandFace"),
    ("orifice", "klack.hydraulics.orifice.Orifice"),
    ("seat", "klack.hydraulics.seat.Seat"),
    ("conical-seat", "klack.hydraulics.conical_seat.ConicalSeat"),
    ("annulus", "klack.hydraulics.annulus.Annulus"),
    ("unsteady-drag", "klack.hydraulics.unsteady_drag.UnsteadyDrag"),
    ("inertance", "klack.hydraulics.inertance.Inertance"),
    ("line", "klack.hydraulics.line.Line"),
    ("junction", "klack.hydraulics.junction.Junction"),
    ("check-valve", "klack.hydraulics.check_valve.CheckValve"),
    ("relief-valve", "klack.hydraulics.relief_valve.ReliefValve"),
    ("accumulator", "klack.hydraulics.accumulator.Accumulator"),
    ("variable-orifice", "klack.hydraulics.variable_orifice.VariableOrifice"),
    ("pump", "klack.hydraulics.pump.Pump"),
    ("pulsating-flow", "klack.hydraulics.pulsating_flow.PulsatingFlow"),
    ("spool-edge", "klack.hydraulics.spool_edge.SpoolEdge"),
    ("pressure-loss", "klack.hydraulics.pressure_loss.PressureLoss"),
    ("pipe-friction", "klack.hydraulics.pipe_friction.PipeFriction"),
    # pneumatics
    ("gas-chamber", "klack.hydraulics.gas.gas_chamber.GasChamber"),
    ("gas-source", "klack.hydraulics.gas.gas_source.GasSource"),
    ("gas-orifice", "klack.hydraulics.gas.gas_orifice.GasOrifice"),
    ("gas-valve", "klack.hydraulics.gas.gas_valve.GasValve"),
    ("gas-gap", "klack.hydraulics.gas.gas_gap.GasGap"),
    ("gas-face", "klack.hydraulics.gas.gas_face.GasFace"),
    # magnetics and drivers
    ("solenoid", "klack.magnetics.solenoid.Solenoid"),
    ("magnetic-network", "klack.magnetics.magnetic_network.MagneticNetwork"),
    ("force-map-solenoid", "klack.magnetics.force_map_solenoid.ForceMapSolenoid"),
    ("voltage-step", "klack.magnetics.voltage_step.VoltageStep"),
    ("voltage-table", "klack.magnetics.voltage_table.VoltageTable"),
    ("drive-profile", "klack.magnetics.drive_profile.DriveProfile"),
    ("two-point", "klack.magnetics.two_point.TwoPoint"),
    ("peak-hold", "klack.magnetics.peak_hold.PeakHold"),
    ("boost-driver", "klack.magnetics.boost_driver.BoostDriver"),
    ("boost-capacitor", "klack.magnetics.boost_capacitor.BoostCapacitor"),
    ("pwm", "klack.magnetics.pwm.PulseWidth"),
    ("controlled-voltage", "klack.magnetics.controlled_voltage.ControlledVoltage"),
    # heat
    ("heat-capacity", "klack.thermal.heat_capacity.HeatCapacity"),
    ("thermal-conductance", "klack.thermal.conductance.Conductance"),
    ("convection", "klack.thermal.convection.Convection"),
    ("heat-radiation", "klack.thermal.radiation.Radiation"),
    ("fixed-temperature", "klack.thermal.fixed_temperature.FixedTemperature"),
    ("heat-source", "klack.thermal.heat_source.HeatSource"),
)
"""Type and dotted path of the class, for each component type."""

_FLUID = "klack.hydraulics.fluid_choice.FluidChoice"
_GAS = "klack.hydraulics.gas.gas_choice.GasChoice"


def type_words() -> tuple[str, ...]:
    """Values allowed after ``type:``."""
    return tuple(word for word, _ in COMPONENTS)


_NONE: Mapping[str, type[Component]] = MappingProxyType({})


def component_class(word: str, own: Mapping[str, type[Component]] = _NONE) -> type[Component]:
    """Class of a type; imports classes of klack only.

    ``own`` are the components of the user's own that may be used, by ``package.module:Class``.

    Raises
    ------
    CaseProblem
        For an unknown type, or a user class that was not allowed.
    """
    if word in own:
        return own[word]
    known = dict(COMPONENTS)
    if word in known:
        found: type[Component] = _registered(known[word])
        return found
    refuse_key_if(
        ":" in word,
        ("type",),
        got=f"'{word}', a class that is not part of klack",
        expected=f"one of: {one_of([*own, *known])}",
        hint=f"a case file runs no code; if you trust that class: --component {word}, "
        "or components=[...] where Python reads the case.",
    )
    raise CaseProblem(
        ("type",),
        got=f"'{word}'",
        expected=f"one of: {one_of([*own, *known])}",
        hint=nearest(word, known, "a class of your own is written package.module:Class."),
    )


def component_classes() -> Iterator[type[Component]]:
    """All registered classes; imports them."""
    return (component_class(word) for word in type_words())


def fluid_section() -> type[Section]:
    """Class of the section ``fluid``; imports it."""
    found: type[Section] = _registered(_FLUID)
    return found


def gas_section() -> type[Section]:
    """Class of the section ``gas``; imports it."""
    found: type[Section] = _registered(_GAS)
    return found


@cache
def _registered(path: str) -> Any:
    module, name = path.rsplit(".", 1)
    return getattr(import_module(module), name)


_OPTION = "--component"
_REGISTERED = frozenset(path for _, path in COMPONENTS)


def component_word(kind: type[Component]) -> str:
    """Type of a class in a case file, ``package.module:Class``."""
    return f"{kind.__module__}:{kind.__qualname__}"


def import_component(word: str) -> type[Component]:
    """Import the class ``package.module:Class``; **runs the code of its module**.

    So the word is the user's, never that of a file.

    Raises
    ------
    InputError
        For a word of another form, or a class that cannot be imported or is no component.
    """
    module, colon, name = word.partition(":")
    refuse_if(
        not (module and colon and name),
        _OPTION,
        got=f"'{word}'",
        expected="package.module:Class",
        hint="write e.g. --component eddy_brake:EddyBrake.",
    )
    try:
        found = getattr(import_module(module), name)
    except KlackError:
        raise
    except Exception as error:  # the user's module may fail in any way while it is imported
        raise InputError(
            f"{_OPTION} {word}",
            got=f"a class that cannot be imported ({error})",
            expected="a class of an installed module, or of one in a folder of PYTHONPATH",
            hint=f"try: python -P -c 'import {module}'.",
        ) from None
    if not (isinstance(found, type) and issubclass(found, Component)):
        raise InputError(
            f"{_OPTION} {word}",
            got="something that is not a component",
            expected="a class derived from klack.network.component.Component",
            hint="see docs/how-to/add-a-component.md.",
        )
    return found


def source_digests(components: Iterable[Component]) -> Mapping[str, str]:
    """User components among these, by word, with the digest of their code.

    That is the first 12 digits of the SHA-256 of the file of the class, or ``"no file"`` for a
    class that was typed in.
    """
    kinds = dict.fromkeys(type(component) for component in components)
    return {
        component_word(kind): _digest(kind)
        for kind in kinds
        if f"{kind.__module__}.{kind.__qualname__}" not in _REGISTERED
    }


def _digest(kind: type[Component]) -> str:
    file = getattr(sys.modules.get(kind.__module__), "__file__", None)
    try:
        return sha256(Path(file).read_bytes()).hexdigest()[:12] if file else "no file"
    except OSError:
        return "no file"
