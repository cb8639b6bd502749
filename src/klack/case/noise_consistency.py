"""Checks of the section ``noise`` against the bodies and materials of its case."""

from typing import TYPE_CHECKING

from klack.case.consistency import check_surface, require_known
from klack.input.problem import CaseProblem, Key, one_of

if TYPE_CHECKING:
    from klack.case.schema import Case
    from klack.case.valve import ValveCase

__all__ = ["check_noise"]


def check_noise(case: "Case | ValveCase") -> None:
    """Raise :class:`CaseProblem` if the noise section names what the case does not have."""
    noise = case.noise
    if noise is None:
        return
    held = [name for name, body in case.bodies.items() if body.fixed]
    for i, surface in enumerate(noise.surfaces or ()):
        key: Key = ("noise", "surfaces", i)
        check_surface(case, key, surface)
        if surface.body not in held:
            raise CaseProblem(
                key,
                got=f"'{surface}', but nothing holds '{surface.body}'",
                expected=f"surfaces of held bodies ({one_of(held) or 'the case has none'})",
                hint="a body that moves freely, such as a needle, radiates into the fluid.",
            )
    if noise.plate is not None:
        key = ("noise", "plate", "material")
        require_known(key, noise.plate.material, case.materials, "material")
