"""Accuracy of a stroke against speed, and the steps that it begins with."""

from typing import Literal

__all__ = ["ACCURACIES", "PROMISED", "Accuracy", "fine_step"]

Accuracy = Literal["normal", "fine"]

ACCURACIES: dict[Accuracy, tuple[float, float]] = {
    "normal": (20e-9, 1.28e-6),
    "fine": (5e-9, 0.32e-6),
}
"""Fine step and macro step in flight [s]."""

PROMISED: dict[Accuracy, tuple[float, float]] = {"normal": (5e-4, 5e-8), "fine": (1e-4, 1e-8)}
"""Of the first three impacts on each stop: error of the peak force [-], of the first touch [s]."""


def fine_step(accuracy: Accuracy, step: float | None = None) -> float:
    """Fine step [s]: stated, or that of the accuracy."""
    return ACCURACIES[accuracy][0] if step is None else step
