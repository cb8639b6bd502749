"""Pressure and temperature of gas sources as inputs of a linear model."""

from klack.network.network import Network
from klack.pneumatics.gas_source import GasSource

__all__ = ["gas_drives"]


def gas_drives(network: Network) -> dict[str, tuple[str, Network]]:
    """By the name of an input: its unit, and the network with one such unit more of it."""
    found = {}
    for name, part in network.components.items():
        if not isinstance(part, GasSource):
            continue
        source = part.at_start()
        assert isinstance(source, GasSource)
        warm = source.temperature or network.ambient.temperature
        changes: tuple[tuple[str, str, float], ...] = (
            ("pressure", "Pa", (source.pressure or 0.0) + 1.0),
            ("temperature", "K", warm + 1.0),
        )
        for key, unit, value in changes:
            changed = source.model_copy(update={key: value})
            found[f"{name}.{key}"] = (unit, network.with_components({name: changed}))
    return found
