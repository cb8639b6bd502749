"""What computes elastic bodies although their materials yield, said in one line."""

import warnings

from klack.case.bodies import CaseFile
from klack.errors import AccuracyWarning

__all__ = ["tell_elastic"]


def tell_elastic(case: CaseFile, what: str) -> None:
    """Warn that a computation leaves out the yield stress of the materials; silent without one.

    Parameters
    ----------
    case : CaseFile
        For the materials of its bodies.
    what : str
        That is computed, with its verb: ``the deck is of``.

    Warns
    -----
    AccuracyWarning
        Names the materials.
    """
    names = set()
    for body in case.bodies.values():
        if body.material is not None:
            chosen = body.material
            names |= {chosen} if isinstance(chosen, str) else set(chosen.values())
    soft = sorted(name for name in names if case.materials[name].named(name).hardening is not None)
    if not soft:
        return
    listed = " and ".join(f"'{name}'" for name in soft)
    warnings.warn(
        f"{what} elastic bodies: the yield stress of {listed} is left out. Try: klack impact "
        "--level reduced, which has it and says from which force on faces yield.",
        AccuracyWarning,
        stacklevel=3,
    )
