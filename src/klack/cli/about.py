"""``klack about``: what is installed."""

import subprocess
from importlib.metadata import PackageNotFoundError, version
from os.path import expanduser
from pathlib import Path

from klack.terminal.options import SHOWN, Shown
from klack.terminal.tables import TextTable

__all__ = ["about"]

_PACKAGES = (
    "llvmlite", "netgen-mesher", "ngsolve", "pypardiso", "mkl", "pydantic", "zarr", "cyclopts",
    "matplotlib", "plotly", "typst", "mosqito", "xarray", "pandas", "fmpy", "nicegui",
)  # fmt: skip


def about(*, wanted: Shown = SHOWN) -> int:
    """Show versions of klack and its libraries, processor, solvers and folders.

    In a bug report, include the whole output.
    """
    from klack.analyses.json_results import command_json
    from klack.machine.cache.result_cache import result_cache
    from klack.machine.compiling.compiled_folder import compiled_folder
    from klack.verification.run_conditions import run_conditions

    results, compiled = result_cache(), compiled_folder()
    found: dict[str, str] = {
        **run_conditions(),
        "commit": _commit() or "-",
        "packages": ", ".join(filter(None, map(_with_version, _PACKAGES))),
        "installed in": _place(Path(__file__).parents[1]),
        "results kept in": _place(None if results is None else results.folder),
        "compiled code in": _place(compiled),
    }
    wanted.show(
        [TextTable(title="klack", columns=("what", "is"), rows=tuple(found.items()), left=2)]
    )
    written = {key.replace(" ", "_"): text for key, text in found.items()}
    wanted.write(lambda: command_json("about", about=written))
    return 0


def _with_version(package: str) -> str:
    try:
        return f"{package} {version(package)}"
    except PackageNotFoundError:
        return ""


def _place(folder: Path | None) -> str:
    """A folder without the name of the user: ``~`` for the home directory."""
    if folder is None:
        return "nowhere"
    home = Path(expanduser("~"))
    # of a service the home is "/", of which all folders are below
    below = home != Path(home.anchor) and folder.is_relative_to(home)
    return str(Path("~") / folder.relative_to(home)) if below else str(folder)


def _commit() -> str:
    """Commit of a checkout, with a mark where files differ from it; empty for an installed one."""
    root = Path(__file__).parents[3]
    if not (root / ".git").exists():
        return ""
    command = ["git", "-C", str(root), "describe", "--always", "--dirty", "--abbrev=12"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=10)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return done.stdout.strip()
