"""One test for many draws: as many truths, one thing to collect."""

import inspect
import runpy
from collections.abc import Callable, Iterable
from functools import wraps
from pathlib import Path
from typing import Any

import pytest

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"

Test = Callable[..., None]


def each(names: str | tuple[str, ...], values: Iterable[Any]) -> Callable[[Test], Test]:
    """Repeat a test for all values of an argument, or of several; a failure names the values.

    For calculations of milliseconds, where ``pytest.mark.parametrize`` costs as much as the test;
    all values share the fixtures of the one test.
    """
    keys = (names,) if isinstance(names, str) else names
    draws = [dict(zip(keys, (x,) if isinstance(names, str) else x, strict=True)) for x in values]

    def of(test: Test) -> Test:
        @wraps(test)
        def for_each(**given: Any) -> None:
            for draw in draws:
                try:
                    test(**given, **draw)
                except BaseException as error:
                    error.add_note(f"with {draw}")
                    raise

        own = inspect.signature(test)
        left = [given for name, given in own.parameters.items() if name not in keys]
        for_each.__signature__ = own.replace(parameters=left)  # type: ignore[attr-defined]
        return for_each

    return of


def program(name: str) -> dict[str, Any]:
    """Names of a program that draws at random as often as wanted; it is in ``benchmarks``."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(BENCHMARKS)
        return runpy.run_path(str(BENCHMARKS / f"{name}.py"))
