"""Soft magnetic materials by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

from klack.magnetics.iron import IronCurve, rational_curve
from klack.materials.sourced import require_entry

__all__ = ["IRON_LIBRARY", "IronEntry", "iron_curve"]

_SOURCE = (
    "Modelica Standard Library (BSD-3), Magnetic.FluxTubes.Material.SoftMagnetic, "
    "commit b756f9d, function mu_rApprox"
)


@dataclass(frozen=True, slots=True)
class IronEntry:
    """One material of the library.

    Parameters
    ----------
    initial, peak_density, rise, width, exponent
        Of :func:`klack.magnetics.iron.rational_curve`.
    verified
        The numbers were read in the named source.
    """

    description: str
    initial: float
    peak_density: float
    rise: float
    width: float
    exponent: float
    source: str = _SOURCE
    verified: bool = True


IRON_LIBRARY: Mapping[str, IronEntry] = MappingProxyType(
    {
        "VACOFLUX 50": IronEntry("50 % cobalt iron", 3850, 1.75, 11790, 2.63, 15.02),
        "M330-50A": IronEntry("sheet 1.0809, complete core, 50 Hz", 500, 0.7, 24000, 9.38, 9.6),
        "M350-50A": IronEntry("sheet 1.0810, 50 Hz", 1210, 1.16, 24630, 2.44, 14),
        "M530-50A": IronEntry("sheet 1.0813, 50 Hz", 2120, 1.25, 12400, 1.6, 13.5),
        "M700-100A": IronEntry("sheet 1.0826, 50 Hz", 1120, 1.2, 20750, 3.55, 13.15),
        "M940-100A": IronEntry("sheet, 50 Hz", 680, 1.26, 17760, 3.13, 13.9),
        "Mu-metal": IronEntry("77 % nickel iron", 27300, 0.46, 1.0375e6, 3.67, 10),
        "PERMENORM 3601 K3": IronEntry("36 % nickel iron", 3000, 0.67, 50000, 2.39, 9.3),
        "RFe80": IronEntry("pure iron, Hyperm 0", 123, 1.27, 44410, 6.4, 10),
        "VACOFER S2": IronEntry("99.95 % iron", 2666, 1.15, 187000, 4.24, 19),
        "AISI 1008": IronEntry("steel 1.0204", 200, 1.17, 8100, 2.59, 10),
        "AISI 12L14": IronEntry("free-cutting steel 1.0718", 10, 0.94, 5900, 4.19, 6.4),
        "DC01": IronEntry("steel 1.0330", 5, 1.1, 6450, 3.65, 7.7),
        "DC03": IronEntry("steel 1.0347", 0, 1.05, 27790, 16, 10.4),
        "9SMn28K": IronEntry("free-cutting steel 1.0715", 500, 1.036, 43414, 35.8, 14),
        "9SMnPb28": IronEntry("free-cutting steel 1.0718", 400, 1.488, 1200, 3, 12.5),
        "X6Cr17": IronEntry("ferritic stainless steel 1.4016", 274, 1.1, 970, 1.2, 8.3),
    }
)
"""Materials by name."""


@cache
def iron_curve(name: str) -> IronCurve:
    """Magnetisation curve of a material of the library.

    Examples
    --------
    >>> round(float(iron_curve("9SMnPb28").field(1.4)), 1)
    3118.6
    """
    own = "give your own curve as a formula or a table."
    entry = require_entry("iron_curve: name", name, IRON_LIBRARY, own)
    return rational_curve(
        initial=entry.initial,
        peak_density=entry.peak_density,
        rise=entry.rise,
        width=entry.width,
        exponent=entry.exponent,
    )
