"""Memory of a factorisation against what is there."""

from collections.abc import Callable
from dataclasses import dataclass

from klack.bodies.elasticity.factor_memory import require_factor_memory
from klack.machine.memory import available_memory, in_words

__all__ = ["WITHOUT", "Budget", "untold"]

_WORTH_TELLING = 1e9  # bytes


def untold(line: str) -> None:
    """Drop a line of a memory plan."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Budget:
    """What has to fit beside the factor of one matrix, and who is told the plan.

    Parameters
    ----------
    later [byte]
        Of the stages that follow while the factor is held.
    reason
        What takes it, such as ``50 modes``.
    tell
        Gets one line of text for a factor of 1 GB or more, before it is computed.
    """

    name: str = ""
    later: float = 0.0
    reason: str = ""
    tell: Callable[[str], None] = untold

    def require(
        self, backend: str, size: int, nonzeros: int, needed: float, precision: str = "double"
    ) -> None:
        """Reject a factor that does not fit together with what follows, and tell one that does.

        Parameters
        ----------
        size, nonzeros
            Rows and entries of the matrix.
        needed [byte]
            Of the factorisation.
        """
        beside = f"{in_words(self.later)} for {self.reason}" if self.later > 0.0 else ""
        require_factor_memory(
            backend, size, nonzeros, needed + self.later, beside=beside, precision=precision
        )
        if needed < _WORTH_TELLING:
            return
        there = available_memory()
        then = f", then {beside}" if beside else ""
        self.tell(
            f"memory of '{self.name}': {size} degrees of freedom, factor in {precision} precision "
            f"{in_words(needed)}{then}, of {in_words(there.size)} ({there.bound})"
        )


WITHOUT = Budget()
"""Nothing else to fit, no plan to show."""
