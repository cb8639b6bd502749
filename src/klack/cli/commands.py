"""All commands and their parser.

Nothing heavy is imported here or at the top of the command modules, so that ``--help`` is
quick.
"""

import os
import sys
from collections.abc import Callable, Iterable, Mapping
from inspect import getdoc
from pathlib import Path
from pkgutil import resolve_name
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

from klack import __version__
from klack.analyses.catalogue import analysis_in, commands
from klack.analyses.ending import REPORTS, beside_result, write_reports
from klack.analyses.impact.command import run_case
from klack.cli.about import about
from klack.cli.compare import compare
from klack.cli.export import export
from klack.cli.show import show
from klack.cli.verify import verify
from klack.errors import InputError, MissingExtraError, refuse_if
from klack.terminal.options import (
    SHOWN,
    WANTED,
    Components,
    Json,
    Out,
    Shown,
    Wanted,
    WantedResult,
    imported,
)
from klack.terminal.output import require_folder, require_json_target, staged_folder, write_json
from klack.terminal.progress import show_progress
from klack.terminal.tables import TextTable

if TYPE_CHECKING:
    from klack.analyses.inspection import Row
    from klack.app.guard import Access
    from klack.warming.run import Warmed

__all__ = ["COMMANDS", "parser"]


def app(
    folder: Annotated[
        Path, Parameter(name="FOLDER", help="Folder with cases and results, or an empty one.")
    ] = Path(),
    /,
    *,
    port: Annotated[int, Parameter(help="Port to listen on; 0 for a free one.")] = 0,
    host: Annotated[
        str,
        Parameter(
            help="Address to listen on. With the default only this machine can connect; any "
            "other address requires a password, and the traffic is not encrypted."
        ),
    ] = "127.0.0.1",
    password_file: Annotated[
        Path | None,
        Parameter(help="File whose first line is the password; required with another --host."),
    ] = None,
    browser: Annotated[
        bool, Parameter(name="--open", help="Open the address in the browser.")
    ] = True,
) -> int:
    """Show cases, runs and results of a folder in the browser, with live sliders.

    Serves only this machine, at an address with a random token. Runs continue when it stops.
    """
    refuse_if(
        not 0 <= port <= 65535,
        f"--port {port}",
        got=str(port),
        expected="0 to 65535",
        hint="leave it out.",
    )
    try:
        from klack.app.server import serve
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("nicegui", "fastapi", "uvicorn"):
            raise
        raise MissingExtraError("nicegui", "klack app", "app") from None

    def ready(access: "Access") -> None:
        print(
            f"klack app shows {folder.resolve()} at\n  {access.url}\nCtrl-C stops it.", flush=True
        )
        if browser and access.gate is None and sys.stdout.isatty():
            _open(access.url)

    serve(folder, host=host, port=port, password=_password(password_file), ready=ready)
    return 0


def _password(file: Path | None) -> str | None:
    if file is None:
        return None
    try:
        return file.read_text("utf-8").partition("\n")[0].strip()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            f"--password-file {file}",
            got=f"an error: {error}",
            expected="a text file that can be read",
            hint="write the password into its first line.",
        ) from None


def _open(address: str) -> None:
    """Open a browser by a file of the user's own: everybody can read command lines."""
    import tempfile
    import webbrowser

    with tempfile.NamedTemporaryFile(
        "w", suffix=".html", prefix="klack-", delete=False, encoding="utf-8"
    ) as file:
        file.write(f'<!doctype html><meta http-equiv="refresh" content="0;url={address}">')
    webbrowser.open(Path(file.name).as_uri())


def cache(
    *,
    clear: Annotated[bool, Parameter(negative="", help="Delete everything in it.")] = False,
    json: Json = None,
) -> int:
    """Show the folder and size of the cache of results; KLACK_CACHE=off turns the cache off.

    KLACK_CACHE names another folder.
    Above KLACK_CACHE_SIZE (5 GB) the oldest results are deleted.
    Meshes, modes and static solutions are kept, under a hash of everything they depend on.
    Deleting them costs nothing but time.
    """
    from klack.analyses.json_results import command_json
    from klack.machine.cache.result_cache import result_cache
    from klack.machine.memory import in_words

    wanted = Shown(json=json)
    results = result_cache()
    if results is None:
        wanted.say("The cache is off (KLACK_CACHE, or a user without a home directory).")
        off = dict.fromkeys(("count", "size_B", "limit_B"), 0)
        wanted.write(lambda: command_json("cache", folder=None, **off))
        return 0
    if clear:
        try:
            gone = results.clear()
        except OSError as error:
            raise InputError(
                f"klack cache {results.folder}",
                got=f"an error: {error.strerror or error}",
                expected="files that may be deleted",
                hint="check who owns the folder, or set KLACK_CACHE to another one.",
            ) from error
        wanted.say(f"Deleted {gone.count} results, {in_words(gone.size)}.")
    there = results.content()
    wanted.say(
        f"Folder: {results.folder}\n"
        f"Results: {there.count}, {in_words(there.size)} of at most {in_words(results.limit)}"
    )
    numbers = {"count": there.count, "size_B": there.size, "limit_B": results.limit}
    wanted.write(lambda: command_json("cache", folder=str(results.folder), **numbers))
    return 0


_CASE = Path("demo-valve")


def demo(
    *,
    open: Annotated[bool, Parameter(help="Show the report in the browser.")] = True,
    out: Out = None,
    wanted: Wanted = WANTED,
) -> int:
    """Compute the shipped valve, reduced and in full, and show the report."""
    from klack.case import shipped_cases

    # by its full path: a file of the same name in the working folder is not the demo
    case = shipped_cases().get(_CASE.name, _CASE)
    levels = ["reduced", "full"]
    folder = run_case(case, levels, WantedResult(**vars(wanted), out=out))
    if open and _has_display():
        import webbrowser

        webbrowser.open((folder / "report.html").resolve().as_uri())
    return 0


def _has_display() -> bool:
    if not sys.stdout.isatty():
        return False
    if sys.platform in ("darwin", "win32"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


_COLUMNS = ("what", "name", "content")


def inspect(
    file: Annotated[
        Path,
        Parameter(
            name="FILE",
            help="STEP, mesh, matrix or FMU of another program; or a case: its parameters, parts "
            "and bodies.",
        ),
    ],
    /,
    *,
    unit: Annotated[
        str | None,
        Parameter(name="--unit", help='Unit of the coordinates, "mm", if the file names none.'),
    ] = None,
    matrix: Annotated[
        str | None,
        Parameter(name="--matrix", help="Name of one matrix in a file of several. [default: all]"),
    ] = None,
    component: Components = None,
    wanted: Shown = SHOWN,
) -> int:
    """Show surfaces and sets of CAD or a mesh, rows of a matrix, inputs and outputs of an FMU.

    For a case: its parameters and expressions in SI, the components of included parts, and the
    bodies, checked as in a run; for a valve also moving parts, contacts and a first speed.
    """
    from klack.analyses.inspection import inspect_case, inspect_file
    from klack.case.reader import shipped_cases
    from klack.mesh.files.catalogue import STEP_ENDINGS
    from klack.units import LENGTH, parse_quantity

    is_case = file.suffix.lower() in (".yaml", ".yml") or (file / "case.yaml").is_file()
    if is_case or (not file.exists() and str(file) in shipped_cases()):
        from klack.case.any_case import load_any_case

        parts = inspect_case(load_any_case(file, imported(component)))
        _show(str(file), parts, wanted)
        return 0
    length = None if unit is None else parse_quantity(f"1 {unit}", LENGTH, "--unit")
    refuse_if(
        unit is not None and file.is_file() and file.suffix.lower() in STEP_ENDINGS,
        "--unit",
        got=f"'{unit}' for a STEP file, which has its own unit",
        expected="no --unit",
        hint="leave it out; klack shows sizes in mm.",
    )
    _show(str(file), [(file.name, inspect_file(file, length, matrix))], wanted)
    return 0


def _show(file: str, parts: "Iterable[tuple[str, tuple[Row, ...]]]", wanted: Shown) -> None:
    """Print each part as soon as it is known, and write all of them as JSON."""
    from klack.analyses.json_results import command_json

    found: dict[str, tuple[Row, ...]] = {}
    for name, rows in parts:
        wanted.show([TextTable(title=name, columns=_COLUMNS, rows=rows, left=3)])
        found[name] = rows
    wanted.write(lambda: command_json("inspect", file=file, parts=found))


def report(
    result: Annotated[
        Path,
        Parameter(name="RESULT", help="Folder written by another command of klack."),
    ],
    /,
    *,
    out: Annotated[
        Path | None, Parameter(name="--out", help="Folder for the report. [default: RESULT]")
    ] = None,
    wanted: Shown = SHOWN,
) -> int:
    """Write report.html and report.pdf of a stored result."""
    from klack.analyses.incomplete import missing_in
    from klack.analyses.json_results import command_json

    folder = out if out is not None else result
    beside = beside_result(folder) if folder.absolute() == result.absolute() else {}
    analysis = analysis_in(result)
    record = analysis.load(result)
    require_folder(folder)
    with staged_folder(folder, beside) as stage:
        write_reports(analysis.content(record, result=str(result)), stage)
    wanted.warn(missing_in(record))
    wanted.say(f"Report in {folder}: {', '.join(REPORTS)}")
    places = {"result": str(result), "folder": str(folder)}
    wanted.write(lambda: command_json("report", case=record.case, **places, files=REPORTS))
    return 0


_CASES = {
    "impact": "case.schema:Case",
    "stroke": "case.valve:ValveCase",
    "magnet": "analyses.magnet.case:MagnetCase",
    "study": "case.study:StudyFile",
}


def schema(
    *,
    kind: Annotated[
        Literal["impact", "stroke", "magnet", "study", "result"],
        Parameter(
            name="--kind",
            help="impact: two bodies that hit each other (klack impact, klack reduce); stroke: a "
            "whole valve with all components of its network (klack stroke); magnet: the drawing of "
            "a magnet (klack magnet); study: a study in a file of its own; result: what every "
            "command writes with --json.",
        ),
    ] = "impact",
    json: Annotated[
        Path,
        Parameter(
            name="--json",
            allow_leading_hyphen=True,
            help="Write to this file; - for the terminal.",
        ),
    ] = Path("-"),
) -> int:
    """Print the JSON schema of case files, for editors that check as you type, or of results."""
    require_json_target(json)
    write_json(json, _schema_of(kind))
    return 0


def _schema_of(kind: str) -> dict[str, Any]:
    if kind == "result":
        from klack.analyses.json_results import result_schema

        return result_schema()
    from klack.case.reader import schema_of

    return schema_of(resolve_name(f"klack.{_CASES[kind]}"))


def warm(
    *,
    clear: Annotated[
        bool,
        Parameter(negative="", help="Delete the compiled functions first, and compile all again."),
    ] = False,
    wanted: Shown = SHOWN,
) -> int:
    """Compile in advance what strokes, impacts and derivatives need; once per processor.

    Without it the first command compiles, for half a minute to a minute.
    Functions that are compiled already are kept.
    NUMBA_CACHE_DIR names another folder for compiled functions.
    """
    from klack.analyses.json_results import command_json
    from klack.machine.compiling.compiled_folder import (
        FOLDER_VARIABLE,
        clear_folder,
        compiled_folder,
        is_usable,
        stored,
    )
    from klack.machine.memory import in_words
    from klack.warming.groups import GROUPS
    from klack.warming.run import warm as warm_groups

    folder = compiled_folder()
    if folder is None or not is_usable(folder):
        raise InputError(
            "folder of compiled functions",
            got=str(folder or "no home directory"),
            expected="a folder of your own that can be written to",
            hint=f"set {FOLDER_VARIABLE} to one.",
        )
    if clear:
        try:
            clear_folder(folder)
        except OSError as error:
            raise InputError(
                str(folder),
                got=f"an error: {error.strerror or error}",
                expected="files that may be deleted",
                hint=f"check who owns the folder, or set {FOLDER_VARIABLE} to another one.",
            ) from error
    done: list[Warmed] = []
    with show_progress(wanted.quiet) as progress:
        progress("compile", 0.0)
        for group in warm_groups(tuple(GROUPS)):
            done.append(group)
            progress("compile", len(done) / len(GROUPS))
    count, size = stored(folder)
    rows = [
        [
            GROUPS[group.name].words,
            str(group.functions) if group.functions else "-",
            f"{group.seconds:.1f} s" if group.functions else "was there",
        ]
        for group in done
    ]
    wanted.show(
        [
            TextTable(title="Compiled", columns=["group", "functions", "time"], rows=rows),
            f"Folder: {folder}",
            f"Functions: {count}, {in_words(size)}",
        ]
    )
    wanted.write(
        lambda: command_json("warm", folder=str(folder), count=count, size_B=size, groups=done)
    )
    return 0


def completion(
    shell: Annotated[Literal["bash", "zsh", "fish"], Parameter(name="SHELL")],
    /,
) -> int:
    """Print the script that completes commands and options in a shell.

    In bash, for good: klack completion bash > ~/.local/share/bash-completion/completions/klack
    In zsh: into a file _klack of a folder of fpath. In fish: into
    ~/.config/fish/completions/klack.fish.
    """
    print(parser.generate_completion(shell=shell))
    return 0


parser = App(
    name="klack",
    help="Predict how a valve needle hits its end stops.\n\n"
    "Exit codes: 0 done; 1 a check failed, or no convergence; 2 bad input;\n"
    "70 internal error; 130 Ctrl-C; 143 SIGTERM.",
    version=f"klack {__version__}",
    version_flags=["--version"],
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
COMMANDS: Mapping[Callable[..., int], str] = {
    demo: "klack demo",
    **commands(),
    inspect: "klack inspect needle.step",
    show: "klack show demo-stroke --out valve.svg",
    report: "klack report klack-results/demo-stroke --out report",
    export: "klack export demo-valve-axisymmetric --to mat --out models",
    compare: "klack compare klack-results/demo-stroke --measurement wet=strokes.csv",
    verify: "klack verify --group contact",
    schema: "klack schema --kind stroke --json valve.schema.json",
    cache: "klack cache --clear",
    warm: "klack warm",
    about: "klack about",
    completion: "klack completion bash",
    app: "klack app my-valves",
}

for _command, _example in COMMANDS.items():
    parser.command(_command, help=f"{getdoc(_command)}\n\nExample: {_example}")
