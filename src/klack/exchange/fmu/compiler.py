"""C compilers for FMU binaries: of the system, or of the package ziglang."""

import importlib.util
import platform
import shutil
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from klack.errors import ConvergenceError, InputError, refuse_if
from klack.input.problem import one_of

__all__ = ["PLATFORMS", "Target", "compile_library", "require_compilers", "this_platform"]


@dataclass(frozen=True, slots=True)
class Target:
    """Platform for binaries.

    Parameters
    ----------
    folders
        In an FMU of version 2 and of version 3.
    suffix
        Of a shared library.
    triple
        Of zig.
    package
        Advice without compiler.
    cross
        Programs that compile for it on any machine.
    """

    folders: tuple[str, str]
    suffix: str
    triple: str
    package: str
    cross: tuple[str, ...] = ()

    def folder(self, fmi: int) -> str:
        """Folder under ``binaries``."""
        return self.folders[fmi - 2]


_XCODE = "the Xcode command line tools"
_LOCAL = ("gcc", "cc", "clang")  # for the machine that they run on

PLATFORMS = {
    "linux64": Target(("linux64", "x86_64-linux"), ".so", "x86_64-linux-gnu", "gcc"),
    "win64": Target(
        ("win64", "x86_64-windows"),
        ".dll",
        "x86_64-windows-gnu",
        "mingw-w64",
        cross=("x86_64-w64-mingw32-gcc",),
    ),
    "darwin64": Target(("darwin64", "x86_64-darwin"), ".dylib", "x86_64-macos", _XCODE),
    "aarch64-linux": Target(("aarch64-linux", "aarch64-linux"), ".so", "aarch64-linux-gnu", "gcc"),
    "aarch64-darwin": Target(
        ("aarch64-darwin", "aarch64-darwin"), ".dylib", "aarch64-macos", _XCODE
    ),
}
"""Platforms by their names in FMI 2.0, else 3.0."""

# no fused multiplications: every processor computes the same numbers
_OPTIONS = ("-std=c99", "-O3", "-ffp-contract=off", "-fvisibility=hidden", "-shared")
_LOG_HEAD = 2000


def this_platform() -> str:
    """Platform of this program."""
    arm = platform.machine().lower() in ("arm64", "aarch64")
    if sys.platform == "win32":
        return "win64"
    if sys.platform == "darwin":
        return "aarch64-darwin" if arm else "darwin64"
    return "aarch64-linux" if arm else "linux64"


def require_compilers(platforms: Sequence[str] | None) -> None:
    """Check the compilers of the platforms; None: this one."""
    for name in (this_platform(),) if platforms is None else platforms:
        _command(name)


def compile_library(
    sources: Sequence[Path], include: Sequence[Path], library: Path, *, platform: str
) -> None:
    """Compile C sources into a shared library that depends on the C library alone.

    Parameters
    ----------
    include
        Header folders.
    library
        In an existing folder.

    Raises
    ------
    ConvergenceError
        With the words of a failing compiler.
    """
    command = [*_command(platform), *_OPTIONS]
    if PLATFORMS[platform].suffix != ".dll":
        command += ["-fPIC"]
    elif "ziglang" not in command:  # which links no library of gcc
        command += ["-static-libgcc"]
    command += [f"-I{folder}" for folder in include] + [str(source) for source in sources]
    command += ["-o", str(library), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    if done.returncode != 0 or not library.is_file():
        raise ConvergenceError(
            f"compiling an FMU for {platform}: {command[0]} failed.\n"
            f"{done.stderr[:_LOG_HEAD]}\n"
            "Try: another compiler; the sources need only C99."
        )


def _command(name: str) -> list[str]:
    """Start of the compiler's command line."""
    refuse_if(
        name not in PLATFORMS,
        "platforms of an FMU",
        got=f"'{name}'",
        expected=f"one of: {one_of(list(PLATFORMS))}",
        hint="linux64 and win64 are usual.",
    )
    target = PLATFORMS[name]
    programs = target.cross + (_LOCAL if name == this_platform() else ())
    for program in programs:
        if found := shutil.which(program):
            return [found]
    if importlib.util.find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", target.triple]
    raise InputError(
        f"compiling an FMU for {name}",
        got="no C compiler for it",
        expected=f"one of: {one_of([*programs, 'the Python package ziglang'])}",
        hint=f"install {target.package}, or the extra 'exchange' of klack, which brings ziglang.",
    )
