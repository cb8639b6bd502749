"""Boost capacitors that several drivers draw from: which coils have to be solved together."""

from dataclasses import dataclass, field

from klack.errors import refuse_if
from klack.magnetics.coupled_rows import PlacedMagnet, coupled_rows
from klack.magnetics.output_stage import Capacitor
from klack.network.rows import Rows
from klack.units import format_si

__all__ = ["SharedCapacitors", "shared_capacitors"]

_KEY = "boost capacitors"


@dataclass(eq=False)
class SharedCapacitors:
    """Capacitors, drivers and magnets of a network, collected until all have been named.

    Parameters
    ----------
    capacitors
        Component and numbers, by electric node.
    drawing
        Node of the capacitor that the driver of a coil draws from, by node of the coil.
    magnets
        With a coil behind such a driver.
    """

    capacitors: dict[int, tuple[str, Capacitor]] = field(default_factory=dict)
    drawing: dict[int, int] = field(default_factory=dict)
    magnets: list[PlacedMagnet] = field(default_factory=list)

    def __call__(self, rows: Rows) -> None:
        """Add the magnets at each capacitor as one row."""
        left = list(self.magnets)
        while left:
            together, nodes = [left.pop(0)], set[int]()
            grown = True
            while grown:
                nodes |= {self.drawing[n] for m in together for n in m.nodes if n in self.drawing}
                more = [m for m in left if nodes & {self.drawing.get(n, -1) for n in m.nodes}]
                left = [m for m in left if m not in more]
                together, grown = together + more, bool(more)
            self._check(together)
            rows.component = self.capacitors[min(nodes)][0]
            shared = {
                node: self.capacitors[self.drawing[node]]
                for magnet in together
                for node in magnet.nodes
                if node in self.drawing
            }
            coupled_rows(rows, together, shared)

    def _check(self, magnets: list[PlacedMagnet]) -> None:
        """Reject a capacitor that is no boost for one of its drivers."""
        for part in magnets:
            for node, winding in zip(part.nodes, part.magnet.windings, strict=True):
                if node not in self.drawing or winding.driver.stage is None:
                    continue
                name, capacitor = self.capacitors[self.drawing[node]]
                battery = max(path.battery for path in winding.driver.stage.paths.values())
                refuse_if(
                    not battery < capacitor.nominal,
                    f"components.{name}.voltage",
                    got=format_si(capacitor.nominal, "V"),
                    expected=f"more than the battery of the driver of '{part.component}', "
                    f"{format_si(battery, 'V')}",
                    hint="for a driver without boost use type 'two-point'.",
                )


def shared_capacitors(rows: Rows) -> SharedCapacitors:
    """Shared capacitors of a network."""
    found = rows.closing.setdefault(_KEY, SharedCapacitors())
    assert isinstance(found, SharedCapacitors)
    return found
