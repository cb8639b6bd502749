"""Linear models of gas: inputs of sources and chambers against closed forms and small changes."""

from collections.abc import Iterator, Mapping
from math import pi
from typing import Any

import numpy as np
from scipy.linalg import expm

from klack.analyses.linearisation.loops import gas_drives
from klack.hydraulics.gas.gas_library import library_gas
from klack.hydraulics.gas.gas_source import GasSource
from klack.hydraulics.pressure_history import PressureStep
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.linear_network import linear_network
from klack.simulation.linear_system import LinearSystem, transfer
from klack.simulation.network_run import simulate_network
from klack.simulation.operating_point import compiled_at, operating_point
from klack.verification.benches import AMBIENT, component
from klack.verification.check import Check, ComparedCurve, check

__all__ = ["gain", "gas_linearisation", "place"]


AIR = library_gas("air")
VOLUME, AREA, MASS, RATE, DAMPING = 2e-6, 1e-4, 20e-3, 2e4, 2.0
SUPPLY, INJECTED = 6e5, 1e-9  # [Pa], [m^3/(s Pa)]
SMALL = 1e-4  # change of a pressure or a flow in a run
STEP, DURATION, RECORD = 0.2e-6, 4e-3, 20e-6


def gas_linearisation() -> list[Check]:
    """A chamber alone, and with a piston, about steady flow."""
    return [*_chamber(), *_piston()]


def _network(supply: GasSource | None = None, injected: float = INJECTED) -> Network:
    """A chamber with a piston on a spring, between a supply and the surroundings.

    A choked orifice from a tank adds a constant mass flow.
    """
    parts: dict[str, Component] = {
        "piston": component("rigid-mass", mass=MASS),
        "spring": component("spring", stiffness=RATE, preload=15.0, damping=DAMPING),
        "face": component("gas-face", direction="opening", area=AREA),
        "supply": supply or GasSource(pressure=SUPPLY),
        "tank": GasSource(pressure=30e5),
        "room": component("gas-chamber", volume=VOLUME),
        "feed": component("gas-orifice", conductance=4e-9, critical_ratio=0.4),
        "injector": component("gas-orifice", conductance=injected, critical_ratio=0.5),
        "outlet": component("gas-orifice", conductance=6e-9, critical_ratio=0.3),
    }
    return Network(
        parts,
        [
            ["piston.body", "spring.end", "face.body"],
            ["room.gas", "face.gas", "outlet.a", "feed.b", "injector.b"],
            ["supply.gas", "feed.a"],
            ["tank.gas", "injector.a"],
            ["outlet.b", "ambient"],
        ],
        AMBIENT,
        gas=AIR,
    )


def _linear(network: Network, held: tuple[str, ...] = ()) -> LinearSystem:
    rows = network.at_start().rows()
    compiled, _ = compiled_at(rows, operating_point(rows))
    drives = {
        key: (unit, part.at_start().rows()) for key, (unit, part) in gas_drives(network).items()
    }
    return linear_network(compiled, 20e-9, held=held, drives=drives).system


def place(signals: tuple[Any, ...], name: str) -> int:
    """Number of an input or output."""
    return [signal.name for signal in signals].index(name)


def _step(system: LinearSystem, source: str, target: str, time: np.ndarray) -> np.ndarray:
    """Response of an output to a unit step."""
    n, u = len(system.A), place(system.inputs, source)
    y = place(system.outputs, target)
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = system.A, system.B[:, u]
    one = expm(whole * float(time[1] - time[0]))
    state, found = np.append(np.zeros(n), 1.0), []
    for _ in time:
        found.append(float(system.C[y] @ state[:n] + system.D[y, u]))
        state = one @ state
    return np.array(found)


def gain(system: LinearSystem, source: str, target: str, frequency: float) -> complex:
    """Answer of an output to an input at a frequency [Hz]."""
    G = next(transfer(system, np.array([frequency])))
    return complex(G[place(system.outputs, target), place(system.inputs, source)])


def _chamber() -> Iterator[Check]:
    """Closed chambers: what flows in stays there."""
    f = 200.0
    for name, kappa, isothermal in (
        ("adiabatic", AIR.kappa, False),
        ("isothermal", 1.0, True),
    ):
        network = Network(
            {
                "piston": component("rigid-mass", mass=MASS),
                "spring": component("spring", stiffness=RATE, preload=15.0, damping=DAMPING),
                "face": component("gas-face", direction="opening", area=AREA),
                "room": component(
                    "gas-chamber", volume=VOLUME, pressure=3e5, isothermal=isothermal
                ),
            },
            [["piston.body", "spring.end", "face.body"], ["room.gas", "face.gas"]],
            AMBIENT,
            gas=AIR,
        )
        lift = operating_point(network.at_start().rows()).value("piston.body displacement")
        volume = VOLUME + AREA * lift  # as warm as the surroundings at rest
        found = gain(_linear(network, held=("piston",)), "room.mass_flow", "room.pressure", f)
        yield check(
            f"closed {name} chamber, pressure per mass flow at 200 Hz [Pa s/kg]",
            abs(kappa * AIR.gas_constant * AMBIENT.temperature / volume / (2j * pi * f)),
            abs(found),
            5e-14,
            "i omega V p = kappa R T mdot" if not isothermal else "i omega V p = R T mdot",
        )


def _piston() -> Iterator[Check]:
    """Small steps of a source and of a mass flow, in runs to both sides."""
    system = _linear(_network())
    time = np.arange(0.0, DURATION + 0.5 * RECORD, RECORD)
    step = SMALL * SUPPLY

    def source(way: float) -> np.ndarray:
        network = _network(
            GasSource(
                pressure=SUPPLY, step=PressureStep(to=SUPPLY + way * step, at=0.0, rise=1e-12)
            )
        )
        return _run(network.rows(), ("piston.body displacement", "room pressure"))

    early = simulate_network(_network().rows(), duration=RECORD, step=STEP, coarse=1, record=RECORD)
    flow = float(early.channels["injector mass flow"].values[-1])

    def injection(way: float) -> np.ndarray:
        network = _network(injected=INJECTED * (1.0 + way * SMALL))
        return _run(
            network.rows(), ("piston.body displacement", "room pressure"), dict(early.state)
        )

    for name, unit, size, answer in (
        ("supply.pressure", "Pa", step, source),
        ("room.mass_flow", "kg/s", SMALL * flow, injection),
    ):
        found = (answer(1.0) - answer(-1.0)) / (2.0 * size)
        for k, target in enumerate(("piston.displacement", "room.pressure")):
            known = found[k]
            linear = _step(system, name, target, time)
            yield check(
                f"step of {name}, largest error of {target} over its largest answer [relative]",
                0.0,
                float(np.abs(linear - known).max() / np.abs(known).max()),
                2e-5,
                f"runs with {100 * SMALL:g} % more and less",
                ComparedCurve(
                    x_label="time [ms]",
                    y_label=f"{target} per {unit} of {name}",
                    expected=(time * 1e3, known),
                    computed=(time * 1e3, linear),
                ),
            )


def _run(
    rows: Rows, channels: tuple[str, ...], state: Mapping[str, np.ndarray] | None = None
) -> np.ndarray:
    result = simulate_network(
        rows, duration=DURATION, step=STEP, coarse=1, record=RECORD, state=state
    )
    return np.array([result.channels[name].values for name in channels])
