"""Check of the energy balance of a finished run."""

import warnings
from math import isfinite

from klack.errors import AccuracyWarning, ConvergenceError

__all__ = ["check_energy_balance"]


def check_energy_balance(
    run: str,
    residual: float,
    least_loss: float,
    *,
    limit: float,
    advice: str,
    loss_limit: float | None = None,
) -> None:
    """Warn when the energy balance does not close, or a loss is negative.

    Parameters
    ----------
    run
        What was run, start of the text.
    residual, least_loss [-]
        Residual and smallest loss over the energy throughput.
    limit [-]
        What the solver promises.
    advice
        What to try, a clause without full stop.
    loss_limit [-]
        What it promises of losses; ``limit`` by default.

    Raises
    ------
    ConvergenceError
        When one of them is not finite: then nothing in the run can be trusted.

    Examples
    --------
    >>> check_energy_balance("simulate", 3e-14, 0.0, limit=1e-9, advice="a shorter step")
    """
    if not (isfinite(residual) and isfinite(least_loss)):
        raise ConvergenceError(
            f"{run}: the energy of this run is not a finite number.\nTry: check the parameters of "
            f"all parts for nan and inf; {advice}."
        )
    faults = []
    if abs(residual) > limit:
        faults.append(f"does not close by {abs(residual):.1e} of the energy throughput")
    kept = limit
    if least_loss < -(limit if loss_limit is None else loss_limit):
        kept = limit if faults or loss_limit is None else loss_limit
        faults.append(f"has a loss that returned {abs(least_loss):.1e} of it")
    if faults:
        warnings.warn(
            f"{run}: the energy balance {' and '.join(faults)}, more than the {kept:.0e} that "
            f"this solver normally achieves. Try: {advice}.",
            AccuracyWarning,
            stacklevel=3,
        )
