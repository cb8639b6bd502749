"""Marks of the tests of the C core, and the line that says when it was not tested.

The core of an FMU is tested with whatever compiler klack would take for this platform.  Where there
is none its tests are skipped, and the end of the run says so in a section of its own.
"""

import shutil

import pytest

from klack.errors import InputError
from klack.exchange.fmu.compiler import require_compilers

__all__ = ["needs_compiler", "needs_gcc", "untested"]


def _missing() -> str:
    """Why the C core cannot be compiled here; empty where it can."""
    try:
        require_compilers(None)
    except InputError:
        return "C core not tested: no C compiler (gcc, cc, clang or the package ziglang)"
    return ""


def untested() -> list[str]:
    """Say what these tests leave out on this machine, a line each."""
    lines = [_missing()]
    if shutil.which("gcc") is None:
        lines.append("C core not tested for warnings and exported names: gcc is not installed")
    return [line for line in lines if line]


needs_compiler = pytest.mark.skipif(bool(_missing()), reason=_missing() or "never")
"""For tests that build an FMU for this platform."""

needs_gcc = pytest.mark.skipif(
    shutil.which("gcc") is None, reason="C core not tested with gcc: it is not installed"
)
"""For tests that call gcc by its name."""
