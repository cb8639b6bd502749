"""Stand-in for a compiled function until slow numba is needed."""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from typing import Any

__all__ = ["Marked"]


class Marked:
    """A function; ``make`` gives what numba calls, or compiles calls of."""

    def __init__(self, function: Callable[..., Any], make: Callable[..., Any]) -> None:
        update_wrapper(self, function)
        self._function, self._make = function, make

    @cached_property
    def made(self) -> Any:
        """What numba knows: a dispatcher, or an intrinsic."""
        return self._make(self._function)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        """Call what it stands for."""
        return self.made(*arguments, **named)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # of Python, which asks everything for them
            raise AttributeError(name)
        return getattr(self.made, name)

    def __reduce__(self) -> Any:
        return self.made.__reduce__()

    @cached_property
    def _numba_type_(self) -> Any:
        """Type behind it, where a compiled function names it."""
        from numba.core.registry import cpu_target

        cpu_target.typing_context.refresh()  # an intrinsic is registered as it is made
        return cpu_target.typing_context.resolve_value_type(self.made)
