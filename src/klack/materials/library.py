"""Materials by name: every number with its source, and whether that source was read.

No certificate: yield stress and hardness are those of one condition, and two bars of one grade
differ by more than the digits. Ceramics and glass have no yield stress: they crack. No entry
hardens: the slope between yield and tensile strength is not that of the first per cents of strain,
which matter in a contact.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

from klack.materials.hardening import Hardening, vickers_of_rockwell, yield_of_hardness
from klack.materials.material import Material
from klack.materials.sourced import Constant, entry_named, require_entry

__all__ = ["MATERIALS", "MaterialEntry", "find_material", "library_material"]

_GUIDE = "usual value of this class of materials, not traced to a measurement"
_AZOM = "AZoM, article 9135: 430F annealed"
_MAKEITFROM_440C = "MakeItFrom.com: annealed 440C stainless steel"
_ALUMINUM_ASSOCIATION = "Aluminum Association, typical values, as on data sheets of 6061-T6"
_KHARAZ = (
    "alumina of Kharaz, Gorham & Salman, Powder Technol. 120 (2001) 281, as digitised by others"
)
_GLASS = "Sci. Rep. 11 (2021), s41598-021-04045-6, table 1: soda-lime glass, speed of sound"
_BEARING = "data sheet of 52100 (Unified Metal): 62 HRC, 190 to 210 GPa, 0.27 to 0.30"
_KOOZ = "data sheet of 1.4034 (Kooz): 220 GPa, 7.73 g/cm^3, 55 HRC tempered at 200 degC"
_EN_10277 = "EN 10277:2018 for 16 to 40 mm, lower limit, as on the card of Lucefin Group"
_BRASS = "EN 12167:2011, lower end of 220 to 350 MPa, as on the data sheet of Durbin Metals"


@dataclass(frozen=True, slots=True, kw_only=True)
class MaterialEntry:
    """One material of the library, in one condition.

    Parameters
    ----------
    condition
        What it is, and its treatment.
    yield_stress
        None for a material that cracks.
    """

    name: str
    condition: str
    young: Constant
    poisson: Constant
    density: Constant
    yield_stress: Constant | None

    @property
    def constants(self) -> tuple[Constant, ...]:
        """All of them."""
        found = (self.young, self.poisson, self.density, self.yield_stress)
        return tuple(one for one in found if one is not None)

    @property
    def verified(self) -> bool:
        """Whether every source was read."""
        return all(one.verified for one in self.constants)

    @property
    def material(self) -> Material:
        """As the finite elements need it."""
        hardening = None
        if self.yield_stress is not None:
            hardening = Hardening(yield_stress=_number(self.yield_stress))
        return Material(
            name=self.name,
            young=_number(self.young),
            poisson=_number(self.poisson),
            density=_number(self.density),
            hardening=hardening,
        )


Source = tuple[float, str, bool]  # value, source, verified


def _entry(
    name: str,
    condition: str,
    young: Source,
    poisson: Source,
    density: Source,
    yields: Source | None,
) -> MaterialEntry:
    def constant(label: str, unit: str, given: Source) -> Constant:
        value, source, verified = given
        return Constant(label=label, value=value, unit=unit, source=source, verified=verified)

    return MaterialEntry(
        name=name,
        condition=condition,
        young=constant("Young's modulus", "Pa", young),
        poisson=constant("Poisson's ratio", "-", poisson),
        density=constant("density", "kg/m^3", density),
        yield_stress=None if yields is None else constant("yield stress", "Pa", yields),
    )


def _of_hardness(hrc: float, source: str) -> Source:
    stress = yield_of_hardness(vickers_of_rockwell(hrc))
    return stress, f"estimate, a third of the Vickers hardness of {hrc:g} HRC; {source}", False


def _number(constant: Constant) -> float:
    assert isinstance(constant.value, float)
    return constant.value


MATERIALS: Mapping[str, MaterialEntry] = MappingProxyType(
    {
        entry.name: entry
        for entry in (
            _entry(
                "430F",
                "soft magnetic ferritic stainless steel 1.4105, annealed bar",
                (200e9, _AZOM, True),
                (0.285, f"{_AZOM}, middle of 0.27 to 0.30", True),
                (7800.0, _AZOM, True),
                (379e6, "data sheet of 430F (GC General Trading): typical 0.2 % proof", True),
            ),
            _entry(
                "430F magnetic",
                "the same, annealed for its magnetic properties after machining",
                (200e9, _AZOM, True),
                (0.285, f"{_AZOM}, middle of 0.27 to 0.30", True),
                (7800.0, _AZOM, True),
                (280e6, f"estimate: {_GUIDE}", False),
            ),
            _entry(
                "X6Cr17",
                "ferritic stainless steel 1.4016 (AISI 430), annealed",
                (200e9, "data sheet of type 430 (Manufacturer.cc): 29e6 psi", True),
                (0.285, f"{_AZOM}, middle of 0.27 to 0.30", True),
                (7700.0, "data sheet of type 430 (Manufacturer.cc): 0.278 lb/in^3", True),
                (310e6, "data sheet of 430 (GC General Trading): typical 0.2 % proof", True),
            ),
            _entry(
                "X46Cr13 hardened",
                "martensitic stainless steel 1.4034 (AISI 420), hardened, tempered at 200 degC",
                (220e9, _KOOZ, True),
                (0.28, "MakeItFrom.com: hardened 420 stainless steel", True),
                (7730.0, _KOOZ, True),
                _of_hardness(55.0, _KOOZ),
            ),
            _entry(
                "440C hardened",
                "martensitic stainless steel 1.4125, hardened, tempered at 204 degC, 59 HRC",
                (200e9, _MAKEITFROM_440C, True),
                (0.28, _MAKEITFROM_440C, True),
                (7700.0, _MAKEITFROM_440C, True),
                (1900e6, "data sheet of 440C (nickelalloys.in): 0.2 % proof at 59 HRC", True),
            ),
            _entry(
                "100Cr6 hardened",
                "bearing steel 1.3505 (AISI 52100), hardened to 62 HRC: balls, rollers, pins",
                (206e9, f"{_GUIDE}; {_BEARING}", False),
                (0.285, f"{_BEARING}, middle", True),
                (7810.0, "data sheet of SAE 52100 (Dhanlaxmi Metals): 7.81 g/cm^3", True),
                _of_hardness(62.0, _BEARING),
            ),
            _entry(
                "11SMn30 cold drawn",
                "free-cutting steel 1.0715 (AISI 1214), drawn to 16 to 40 mm",
                (210e9, _GUIDE, False),
                (0.3, _GUIDE, False),
                (7850.0, _GUIDE, False),
                (375e6, _EN_10277, True),
            ),
            _entry(
                "X5CrNi18-10",
                "austenitic stainless steel 1.4301 (AISI 304), solution annealed bar of 16 mm "
                "and above",
                (200e9, _GUIDE, False),
                (0.29, _GUIDE, False),
                (7900.0, _GUIDE, False),
                (190e6, "EN 10088-3, lower limit, as on the data sheet of Wixsteel", True),
            ),
            _entry(
                "6061-T6",
                "aluminium alloy EN AW-6061 (AlMg1SiCu), aged",
                (68.9e9, _ALUMINUM_ASSOCIATION, True),
                (0.33, _ALUMINUM_ASSOCIATION, True),
                (2700.0, _ALUMINUM_ASSOCIATION, True),
                (276e6, _ALUMINUM_ASSOCIATION, True),
            ),
            _entry(
                "CuZn39Pb3",
                "free-cutting brass CW614N, bar",
                (97e9, "data sheet of CW614N (Durbin Metals)", True),
                (0.34, _GUIDE, False),
                (8470.0, "data sheet of CW614N (Durbin Metals)", True),
                (220e6, _BRASS, True),
            ),
            _entry(
                "alumina",
                "sintered aluminium oxide; cracks, does not yield",
                (380e9, _KHARAZ, False),
                (0.23, _KHARAZ, False),
                (4000.0, _KHARAZ, False),
                None,
            ),
            _entry(
                "soda-lime glass",
                "window glass; cracks, does not yield",
                (72.8e9, _GLASS, True),
                (0.222, _GLASS, True),
                (2563.0, _GLASS, True),
                None,
            ),
        )
    }
)
"""All library materials by name."""


def find_material(name: str) -> MaterialEntry | None:
    """Library material, or None; case, blanks and hyphens do not matter."""
    return entry_named(name, MATERIALS)


def library_material(name: str) -> MaterialEntry:
    """Library material of this name.

    Examples
    --------
    >>> ball = library_material("440c-hardened")
    >>> ball.material.hardening.yield_stress / 1e6, ball.verified
    (1900.0, True)
    """
    return require_entry(
        "library_material: name", name, MATERIALS, "give young, poisson, density, and yield."
    )
