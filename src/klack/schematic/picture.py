"""The schematic of a network as a picture for a file or a report."""

from klack.network.network import Network
from klack.schematic.legend import with_legend
from klack.schematic.schematic import schematic_of
from klack.schematic.svg import svg_of

__all__ = ["schematic_svg"]


def schematic_svg(network: Network, title: str = "") -> str:
    """Draw a network with its legend, and a title if there is one; the same text every time.

    >>> from klack.mechanics.rigid_mass import RigidMass
    >>> from klack.mechanics.spring import Spring
    >>> parts = {"mass": RigidMass(mass=1.0), "spring": Spring(stiffness=1e3, preload=0.0)}
    >>> picture = schematic_svg(Network(parts, [["mass.body", "spring.end"]]))
    >>> picture.startswith("<svg"), "stiffness 1 N/mm" in picture
    (True, True)
    """
    return svg_of(
        with_legend(schematic_of(network), network, title), title or "Schematic of the network"
    )
