"""Layers of the bodies of a case: what their modes have of them, and what is doubtful about it."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.layer import Layer, LayerStiffness
from klack.case.bodies import CaseFile
from klack.errors import AccuracyWarning
from klack.units import format_si

__all__ = ["LayerState", "layer_states", "layers_of", "tell_layers"]

_SHIFTED = 0.01  # of a frequency
_LOSSY = 0.3  # loss factor of a mode, from which its damping of first order is a guess
_STRAINED = 0.01  # share of strain energy from which a mode counts as one of the layer


def layers_of(case: CaseFile, body: str) -> tuple[Layer, ...]:
    """Layers of a body."""
    return tuple(given.named(name) for name, given in (case.bodies[body].layers or {}).items())


@dataclass(frozen=True, kw_only=True, eq=False)
class LayerState:
    """A layer, and the share that elastic modes of its body have in it.

    Parameters
    ----------
    first, second
        Names of the parts.
    area [m^2]
    normal, tangential [N/m]
        Stiffness of the whole area.
    taken [Hz]
        Frequency of that stiffness; None for one that does not depend on it.
    covered (m,)
        Modes within the frequencies of the table.
    frequency, share, loss, shift (m,) [Hz, -, -, -]
        Of the modes: share of the strain energy, loss factor by the layer, relative shift of the
        frequency by the stiffness there, which the body leaves out.
    """

    body: str
    name: str
    first: str
    second: str
    area: float
    normal: float
    tangential: float
    taken: float | None
    covered: NDArray[np.bool_]
    frequency: NDArray[np.float64]
    share: NDArray[np.float64]
    loss: NDArray[np.float64]
    shift: NDArray[np.float64]

    @classmethod
    def of(cls, body: ElasticBody, layer: LayerStiffness, modes: Modes) -> "LayerState":
        """State of one layer with these elastic modes."""
        given = layer.layer
        normal, across, _ = (float(x) for x in given.at(given.frequency))
        return cls(
            body=body.name,
            name=given.name,
            first=layer.solids[0],
            second=layer.solids[1],
            area=layer.area,
            normal=normal * layer.area,
            tangential=across * layer.area,
            taken=given.frequency if len(given.table) > 1 else None,
            covered=given.covers(modes.frequency),
            frequency=modes.frequency,
            share=np.asarray(sum(layer.shares(modes.omega, modes.shapes))),
            loss=layer.loss(modes.omega, modes.shapes),
            shift=layer.shift(modes.omega, modes.shapes),
        )

    @property
    def strained(self) -> int | None:
        """Mode with the largest share of strain energy in the layer; None without modes."""
        return int(np.argmax(self.share)) if len(self.share) else None

    @property
    def largest_shift(self) -> float:
        """Of a frequency, by size."""
        return float(np.abs(self.shift).max(initial=0.0))

    @property
    def largest_loss(self) -> float:
        """Loss factor of a mode."""
        return float(self.loss.max(initial=0.0))

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the body may be other than computed."""
        where = f"layer {self.body}.{self.name}"
        found = []
        if self.taken is not None and self.largest_shift > _SHIFTED:
            worst = int(np.argmax(np.abs(self.shift)))
            at = format_si(float(self.frequency[worst]), "Hz", 3)
            found.append(
                f"{where}: its stiffness was taken at {format_si(self.taken, 'Hz', 3)}; the "
                f"stiffness at {at} would shift the mode there by about "
                f"{100 * self.shift[worst]:+.2g} %. Try: frequency: {at}, and compare the "
                "results."
            )
        outside = ~self.covered & (self.share > _STRAINED)
        if outside.any():
            worst = int(np.argmax(np.where(outside, self.share, 0.0)))
            found.append(
                f"{where}: {np.sum(outside)} modes that strain it are beyond its table, such as "
                f"the mode at {format_si(float(self.frequency[worst]), 'Hz', 3)} with "
                f"{100 * self.share[worst]:.2g} % of its energy there; the stiffness and loss "
                "factor of the nearest row were used. Try: rows at these frequencies."
            )
        if self.largest_loss > _LOSSY:
            found.append(
                f"{where}: it gives a mode a loss factor of {self.largest_loss:.2g}; modal "
                f"damping is of first order, accurate to a few per cent up to {_LOSSY:g}."
            )
        return tuple(found)

    def rows(
        self, told: Callable[[float, str, int], str] = format_si
    ) -> tuple[tuple[str, str], ...]:
        """A row for each quantity; ``told`` writes value, unit and digits."""
        at = "" if self.taken is None else f" at {told(self.taken, 'Hz', 3)}"
        rows = [
            ("between", f"{self.first} and {self.second}, {1e6 * self.area:.4g} mm^2"),
            (
                f"stiffness{at}, normal, tangential",
                f"{told(self.normal, 'N/m', 3)}, {told(self.tangential, 'N/m', 3)}",
            ),
        ]
        if (most := self.strained) is not None:
            rows.append(
                (
                    "mode that strains it most",
                    f"{told(float(self.frequency[most]), 'Hz', 4)}, {100 * self.share[most]:.3g} % "
                    f"of its energy, loss factor {self.loss[most]:.3g} by it",
                )
            )
            rows.append(("largest loss factor of a mode by it", f"{self.largest_loss:.3g}"))
        if self.taken is not None:
            rows.append(
                (
                    "its stiffness at other frequencies shifts modes by up to",
                    f"{100 * self.largest_shift:.2g} %",
                )
            )
        return tuple(rows)


def layer_states(body: ElasticBody, modes: Modes) -> tuple[LayerState, ...]:
    """State of every layer of a body."""
    return tuple(LayerState.of(body, layer, modes) for layer in body.layers)


def tell_layers(bodies: Iterable[ElasticBody], modes: Mapping[str, Modes]) -> None:
    """Warn of the doubts of all layers; modes by the name of the body."""
    for body in bodies:
        for state in layer_states(body, modes[body.name]):
            for doubt in state.doubts:
                warnings.warn(doubt, AccuracyWarning, stacklevel=2)
