"""Errors of third-party libraries on damaged files, raised as errors of klack."""

import logging
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from klack.errors import InputError, KlackError

__all__ = ["foreign_reading", "heard", "keep_quiet"]

_LONGEST = 80


@contextmanager
def foreign_reading(where: str, what: str, hint: str) -> Iterator[None]:
    """Turn any error of a foreign reader into :class:`InputError`.

    Parameters
    ----------
    where : str
        File, and channel if there is one.
    what : str
        What was read, "an MDF file".
    hint : str
    """
    try:
        yield
    except KlackError:
        raise
    except Exception as error:  # readers meet damage with any kind of error, bare ones as well
        said = " ".join(str(error).split())[:_LONGEST] or type(error).__name__
        raise InputError(
            where, got=f"{what} that cannot be read ({said})", expected="a whole file", hint=hint
        ) from error


@contextmanager
def heard(loggers: Iterable[logging.Logger]) -> Iterator[list[str]]:
    """Collect what a foreign reader logs of a file instead of writing it to the terminal."""
    said: list[str] = []
    kept = [(logger, list(logger.handlers), logger.propagate) for logger in loggers]
    handler = logging.Handler()
    handler.emit = lambda record: said.append(record.getMessage())  # type: ignore[method-assign]
    for logger, _, _ in kept:
        logger.handlers, logger.propagate = [handler], False
    try:
        yield said
    finally:
        for logger, handlers, propagate in kept:
            logger.handlers, logger.propagate = handlers, propagate


def keep_quiet(package: str) -> None:
    """Stop a foreign reader from writing parts of damaged files to the terminal."""
    logging.getLogger(package).setLevel(logging.CRITICAL)
