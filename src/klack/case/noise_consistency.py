"""Checks of the section ``noise`` against the bodies and materials of its case."""

from klack.case.consistency import check_surface, require_known
from klack.case.impact_sections import ImpactSections
from klack.case.valve_roles import find_roles
from klack.case.valve_sections import ValveSections
from klack.input.problem import CaseProblem, Key, one_of

__all__ = ["check_noise"]


def _moving(case: ImpactSections | ValveSections) -> str:
    """Body that makes sense without a support: the one that hits, or the needle."""
    if isinstance(case, ImpactSections):
        return case.contact.moving.body
    return str(getattr(case.network.components[find_roles(case).needle], "body", ""))


def check_noise(case: ImpactSections | ValveSections) -> None:
    """Raise :class:`CaseProblem` if the noise section names what the case does not have."""
    noise = case.noise
    if noise is None:
        return
    held = [name for name, body in case.bodies.items() if body.fixed]
    for i, surface in enumerate(noise.surfaces or ()):
        key: Key = ("noise", "surfaces", i)
        check_surface(case, key, surface)
        if surface.body in held:
            continue
        if surface.body == _moving(case):
            raise CaseProblem(
                key,
                got=f"'{surface}', but nothing holds '{surface.body}'",
                expected=f"surfaces of held bodies ({one_of(held)})",
                hint="a free body, such as a needle, radiates into the fluid.",
            )
        raise CaseProblem(
            ("bodies", surface.body),
            got=f"no key 'fixed', but '{surface}' shall radiate sound (noise.surfaces)",
            expected=f"fixed: the surfaces that hold '{surface.body}'",
            hint="add 'fixed: [{surface: NAME}]' to the body, or remove its surfaces from 'noise'.",
        )
    if noise.plate is not None:
        key = ("noise", "plate", "material")
        require_known(key, noise.plate.material, case.materials, "material")
