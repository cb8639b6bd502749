"""Errors and warnings for users, each with advice."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

__all__ = [
    "AccuracyWarning",
    "CacheWarning",
    "ConvergenceError",
    "InputError",
    "KlackError",
    "LeftAloneWarning",
    "MissingExtraError",
    "foreign_reading",
    "optional_package",
    "refuse_if",
    "require_nonnegative",
    "require_positive",
]


_LONGEST = 1200  # characters of each part; the names that a study may measure are a thousand
_LONGEST_FOREIGN = 80  # of what a foreign reader says


class KlackError(Exception):
    """Root of all errors that klack raises on purpose."""


class InputError(KlackError, ValueError):
    """A value from the user cannot be used.

    Parameters
    ----------
    where
        File, line, key or function and argument.
    got, expected
        With units.
    hint
        What to try, one sentence.
    """

    def __init__(self, where: str, *, got: str, expected: str, hint: str) -> None:
        where, got, expected, hint = map(_shortened, (where, got, expected, hint))
        self.where, self.got, self.expected, self.hint = where, got, expected, hint
        super().__init__(f"{where}: got {got}, expected {expected}.\nTry: {hint}")


def _shortened(text: str) -> str:
    """Text without its middle, if too long for a message."""
    if len(text) <= _LONGEST:
        return text
    head, tail = text[: _LONGEST - 200].rsplit(" ", 1)[0], text[-150:].split(" ", 1)[-1]
    return f"{head} ... {tail}"


class ConvergenceError(KlackError, RuntimeError):
    """An iteration did not converge; the text names it, its state and a remedy."""


class AccuracyWarning(UserWarning):
    """A result is less accurate than possible; the text gives the reason and what to refine."""


class CacheWarning(UserWarning):
    """Results are not kept for later runs, or not found again; numbers are not affected."""


class LeftAloneWarning(UserWarning):
    """Something looks like a file of klack and is not; it is neither read, moved nor removed."""


class MissingExtraError(KlackError, ImportError):
    """An optional package is needed for this and is not installed; ``extra`` may bring it."""

    def __init__(self, package: str, purpose: str, extra: str | None) -> None:
        way = f"pip install {package}"
        if extra is not None:
            way = f"uv sync --extra {extra} in a clone, or pip install 'FILE.whl[{extra}]'"
        super().__init__(
            f"{purpose} needs the package '{package}', which is not installed.\nTry: {way}."
        )


def refuse_if(wrong: object, where: str, *, got: str, expected: str, hint: str) -> None:
    """Raise :class:`InputError` where a value from the user cannot be used.

    The texts are made at every call: not for each key, port or step, nor with a search for names.
    """
    if wrong:
        raise InputError(where, got=got, expected=expected, hint=hint)


def optional_package(package: str, purpose: str, extra: str | None, *, module: str = "") -> Any:
    """Import a package that need not be installed; ``module`` where it is imported as another."""
    try:
        return import_module(module or package)
    except ImportError as error:
        raise MissingExtraError(package, purpose, extra) from error


@contextmanager
def foreign_reading(where: str, what: str, hint: str) -> Iterator[None]:
    """Turn any error of a foreign reader into :class:`InputError`; ``what`` is "an MDF file"."""
    try:
        yield
    except KlackError:
        raise
    except Exception as error:  # readers meet damage with any kind of error, bare ones as well
        said = " ".join(str(error).split())[:_LONGEST_FOREIGN] or type(error).__name__
        raise InputError(
            where, got=f"{what} that cannot be read ({said})", expected="a whole file", hint=hint
        ) from error


def require_positive(where: str, value: float, unit: str) -> None:
    """Raise :class:`InputError` unless ``value`` is above zero (also for nan)."""
    if not value > 0:
        raise InputError(
            where,
            got=f"{value:g} {unit}",
            expected=f"a value above 0 {unit}",
            hint="check the sign and the unit; inputs are SI (m, kg, s, N).",
        )


def require_nonnegative(where: str, value: float, unit: str) -> None:
    """Raise :class:`InputError` unless ``value`` is zero or more (also for nan)."""
    if not value >= 0:
        raise InputError(
            where,
            got=f"{value:g} {unit}",
            expected=f"0 {unit} or more",
            hint="check the sign and the unit; inputs are SI (m, kg, s, N).",
        )
