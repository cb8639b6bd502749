"""A mistake in a case, with the key it belongs to."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import get_close_matches

from klack.errors import InputError

__all__ = ["CaseProblem", "Key", "nearest", "one_of", "problem_at", "refuse_key_if"]

Key = tuple[str | int, ...]


class CaseProblem(InputError):
    """Something in a case that cannot be used.

    Parameters
    ----------
    key
        Path of keys and numbers from the section that found the problem.
    on_key
        True if the key itself is wrong, False if its value is.
    """

    def __init__(
        self, key: Key, *, got: str, expected: str, hint: str, on_key: bool = False
    ) -> None:
        self.key, self.on_key = key, on_key
        super().__init__(key_text(key) or "case", got=got, expected=expected, hint=hint)


def refuse_key_if(
    wrong: object, key: Key, *, got: str, expected: str, hint: str, on_key: bool = False
) -> None:
    """Raise :class:`CaseProblem` where something in a case cannot be used."""
    if wrong:
        raise CaseProblem(key, got=got, expected=expected, hint=hint, on_key=on_key)


@contextmanager
def problem_at(*key: str | int) -> Iterator[None]:
    """Turn an error of what a key describes into a :class:`CaseProblem` at that key."""
    try:
        yield
    except InputError as error:
        raise CaseProblem(key, got=error.got, expected=error.expected, hint=error.hint) from None


def key_text(key: Key) -> str:
    """Write a key path as people do: ``("edges", 2, "arc")`` is ``edges[2].arc``."""
    text = ""
    for part in key:
        text += f"[{part}]" if isinstance(part, int) else f".{part}"
    return text.removeprefix(".")


def one_of(names: Iterable[str]) -> str:
    """List the names that can be used."""
    return ", ".join(names) or "none (there is none to choose from)"


def nearest(name: str, known: Iterable[str], otherwise: str) -> str:
    """Known name most similar to ``name``; else ``otherwise``."""
    lower = {candidate.lower(): candidate for candidate in known}
    close = get_close_matches(name.lower(), lower, n=1, cutoff=0.6)
    return f"did you mean '{lower[close[0]]}'?" if close else otherwise
