"""A magnet with its windings and their drivers as a row of a network."""

from collections.abc import Mapping
from typing import Protocol

from pydantic import Field

from klack.input.section import Section
from klack.magnetics.circuit import MagneticCircuit
from klack.magnetics.coupled_rows import PlacedMagnet, coupled_rows
from klack.magnetics.coupled_table import CoupledMagnet, Winding
from klack.magnetics.driver import driver_of
from klack.magnetics.flux_step import FLUXES, flux_rows, gap_limit
from klack.magnetics.gap_range import GapRange
from klack.magnetics.insulation import InsulationClass
from klack.magnetics.network_loops import loop_names
from klack.magnetics.shared_capacitors import shared_capacitors
from klack.magnetics.winding import REFERENCE_TEMPERATURE, WindingTemperature, warm_resistance
from klack.network.rows import Channel, Rows
from klack.units import Current, Resistance

__all__ = ["CoilCircuit", "magnet_rows", "main_circuit"]


class Wound(Protocol):
    """What a magnet says of the circuit at its terminals."""

    @property
    def resistance(self) -> float:
        """At 20 degC [ohm]."""

    @property
    def winding_temperature(self) -> float:
        """Of the copper [K]."""

    @property
    def start_current(self) -> float:
        """Steady current before the start [A]."""


class CoilCircuit(Section):
    """Electric circuit of one or more coils of a magnet, with a driver of its own."""

    resistance: Resistance = Field(gt=0, description="Of its coils and harness, at 20 degC.")
    winding_temperature: WindingTemperature = Field(
        default=REFERENCE_TEMPERATURE, description="Of the copper, -200 to 1085 degC."
    )
    insulation_class: InsulationClass = None
    start_current: Current = Field(
        default=0.0, ge=0, description="Steady (holding) current before the start."
    )


def magnet_rows(
    rows: Rows,
    circuit: MagneticCircuit,
    windings: Mapping[str, CoilCircuit],
    *,
    gap: float,
    closing: bool,
    gap_range: GapRange,
    remanent: bool,
    names_loops: bool = False,
) -> bool:
    """Add a magnet to a network; whether by itself, with one coil, or solved with others.

    Parameters
    ----------
    windings
        By port, first that of the main circuit, ``terminals``.
    gap [m]
        Working gap while both ports are at rest.
    closing
        Whether it closes as the armature moves along +z.
    remanent, names_loops
        As of :class:`klack.magnetics.coupled_rows.PlacedMagnet`.
    """
    made = {
        port: Winding(
            name="" if port == "terminals" else port,
            owner=rows.component,
            circuit="" if port == "terminals" else port,
            resistance=warm_resistance(part.resistance, part.winding_temperature),
            driver=driver_of(rows, port),
            current=part.start_current,
        )
        for port, part in windings.items()
    }
    armature, base = rows.port("armature"), rows.port("base")
    main = made["terminals"]
    shares = any(
        winding.driver.stage is not None and winding.driver.stage.capacitor is None
        for winding in made.values()
    )
    if len(made) == 1 and not shares:
        named = enumerate(loop_names(circuit)) if names_loops else ()
        flux_rows(
            rows,
            circuit,
            resistance=main.resistance,
            driver=main.driver,
            gap=gap,
            closing=closing,
            armature=armature,
            base=base,
            current=main.current,
            gap_range=gap_range,
            remanent=remanent,
            channels=tuple(Channel(f"flux of {name}", "Wb", FLUXES + k) for k, name in named),
        )
        return True
    magnet = CoupledMagnet(circuit=circuit, gap=gap, closing=closing, windings=tuple(made.values()))
    placed = PlacedMagnet(
        component=rows.component,
        magnet=magnet,
        armature=armature,
        base=base,
        nodes=tuple(rows.port(port) for port in made),
        remanent=remanent,
        names_loops=names_loops,
    )
    if shares:
        shared_capacitors(rows).magnets.append(placed)
    else:
        coupled_rows(rows, [placed])
    gap_limit(rows, gap_range, gap=gap, closing=closing, armature=armature, base=base)
    return False


def main_circuit(part: Wound) -> CoilCircuit:
    """Circuit at the terminals of a magnet."""
    return CoilCircuit(
        resistance=part.resistance,
        winding_temperature=part.winding_temperature,
        start_current=part.start_current,
    )
