"""A case of a whole valve: elastic bodies, end stops, and the network around them."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Self

from pydantic import model_validator

from klack.case.consistency import check_noise
from klack.case.free_parameters import free_parameters
from klack.case.levels import VARIANTS, Variant
from klack.case.reader import Lines
from klack.case.spatial_consistency import require_bodies
from klack.case.valve_consistency import check_thermal, check_valve
from klack.case.valve_sections import ValveSections
from klack.errors import InputError, refuse_if
from klack.input.problem import nearest, one_of
from klack.network.catalogue import source_digests

__all__ = ["ValveCase", "require_valve"]


class ValveCase(ValveSections):
    """A valve as a system, from geometry to lift and impacts."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        check_valve(self)
        check_noise(self)
        check_thermal(self)
        free_parameters(self)
        return self

    @property
    def own_components(self) -> Mapping[str, str]:
        """Components not of klack, see :func:`klack.network.catalogue.source_digests`."""
        return source_digests(self.network.components.values())

    @property
    def component_files(self) -> Mapping[str, Path]:
        """Files of components with a model inside, such as FMUs."""
        files = {
            name: getattr(part, "file", None) for name, part in self.network.components.items()
        }
        return {name: file for name, file in files.items() if isinstance(file, Path)}

    @property
    def rubs(self) -> bool:
        """Whether faces of a stop rub in space, or may in a shot."""
        drawn = self.shots is not None and self.shots.contact_friction is not None
        return drawn or any(stop.friction > 0.0 for stop in self.stops.values())

    def without_friction(self) -> Self:
        """The same with smooth faces at all stops."""
        smooth = {
            name: stop.model_copy(update={"friction": 0.0}) for name, stop in self.stops.items()
        }
        return self.model_copy(update={"stops": smooth})

    def require_variants(self, variants: tuple[str, ...]) -> tuple[Variant, ...]:
        """Check that this case can run the variants; each once."""
        for variant in variants:
            if variant not in VARIANTS:
                raise InputError(
                    "variant",
                    got=f"'{variant}'",
                    expected=f"one of: {one_of(VARIANTS)}",
                    hint=nearest(variant, VARIANTS, "see klack stroke --help."),
                )
            refuse_if(
                variant.endswith("lumped") and self.lumped is None,
                f"{self.path or 'case'}: lumped",
                got="no section 'lumped'",
                expected=f"its stiffness, because the variant '{variant}' is requested",
                hint="add 'lumped: {stiffness: 1e9 N/m}'.",
            )
        require_bodies(self, variants, str(self.path or "case"))
        return tuple(v for v in VARIANTS if v in variants)

    def one_variant(self, name: str | None = None) -> Variant:
        """Checked variant; default: the first of the case."""
        return self.require_variants((name,) if name is not None else self.run.variants[:1])[0]


def require_valve(data: Any, path: Path, lines: Lines) -> None:
    """Reject the parsed case of an impact."""
    if "contact" in data and "network" not in data:
        raise InputError(
            f"{path}:{lines.find(('contact',), on_key=True)}: contact",
            got="a case of an impact",
            expected="a case of a whole valve, with a section 'network'",
            hint="run it with klack impact.",
        )
