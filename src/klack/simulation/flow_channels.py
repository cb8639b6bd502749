"""Names of the mass flows of restrictions among the channels, also those of earlier versions."""

from collections.abc import Collection, Mapping

from klack.network.rows import BranchRow
from klack.simulation.network_result import ChannelData

__all__ = ["flow_label", "present_name", "with_present_names"]

_MASS_FLOW, _MEAN, _FORMER = "mass flow", "mean mass flow", "flow"


def flow_label(row: BranchRow) -> str:
    """Label of the mean flow over a step; a column of fluid has also a state with its flow."""
    own = any(channel.label == _MASS_FLOW for channel in row.channels)
    return _MEAN if own else _MASS_FLOW


def present_name(name: str, known: Collection[str]) -> str:
    """Name of a channel today: mass flows were once called flows.

    >>> present_name("nozzle flow", ["nozzle mass flow", "nozzle area"])
    'nozzle mass flow'
    """
    owner = name.removesuffix(f" {_FORMER}")
    if name in known or owner == name:
        return name
    return next((new for end in (_MEAN, _MASS_FLOW) if (new := f"{owner} {end}") in known), name)


def with_present_names(channels: Mapping[str, ChannelData]) -> dict[str, ChannelData]:
    """Channels of a result of an earlier version under the names of today."""
    return {_renamed(name, data.unit, channels): data for name, data in channels.items()}


def _renamed(name: str, unit: str, channels: Mapping[str, ChannelData]) -> str:
    owner = name.removesuffix(f" {_FORMER}")
    if unit != "kg/s" or owner == name or owner.endswith((" mass", " mean mass")):
        return name
    return f"{owner} {_MEAN if f'{owner} {_MASS_FLOW}' in channels else _MASS_FLOW}"
