"""Command ``klack noise``."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.analyses.ending import Ending, is_result
from klack.terminal.options import WANTED_RESULT, Components, WantedResult, imported
from klack.terminal.progress import Progress, show_progress

if TYPE_CHECKING:
    from klack.analyses.noise.source import NoiseSource
    from klack.case.any_case import AnyCase, OwnComponents

__all__ = ["noise"]

_A = Annotated[
    Path,
    Parameter(
        name="A",
        help="Folder written by klack impact or stroke; or a case (file or shipped name), which "
        "is run first.",
    ),
]
_B = Annotated[
    Path | None, Parameter(name="B", help="A second design, of either kind, to compare with.")
]
_Names = Annotated[
    list[str] | None,
    Parameter(
        name=["--variant", "--level"],
        consume_multiple=True,
        negative="",
        help="Variants of a stroke or levels of an impact; several (wet,dry) are compared. "
        "[default: the first variant, the best level]",
    ),
]
_VirtualTest = Annotated[
    bool,
    Parameter(
        negative="",
        help="Find the blocked forces as a test on the machine of the case would (ISO 20270), with "
        "its indicators.",
    ),
]


def noise(
    a: _A,
    b: _B = None,
    /,
    *,
    variant: _Names = None,
    virtual_test: _VirtualTest = False,
    component: Components = None,
    wanted: WantedResult = WANTED_RESULT,
) -> int:
    """Estimate the sound: force spectra, vibration, radiated sound, loudness, WAV files."""
    names = tuple(name for item in variant or () for name in item.split(",") if name)
    paths = (a,) if b is None else (a, b)
    cases = _cases(paths, imported(component))
    ending = Ending.of(wanted, "-".join(["noise", *map(_short, paths)]))

    with show_progress(wanted.quiet):
        from klack.analyses.noise.analysis import NOISE
        from klack.analyses.noise.mount_source import write_sources
        from klack.analyses.noise.run import run_noise
        from klack.analyses.noise.sounds import write_sounds

    with show_progress(wanted.quiet) as progress:
        sources = [
            source
            for path, case in zip(paths, cases, strict=True)
            for source in _sources(path, case, names, progress, wanted.threads)
        ]
        study = run_noise(
            sources,
            names=_names(paths, sources),
            virtual_test=virtual_test,
            progress=progress,
        )
    return ending.end(
        NOISE,
        study,
        beside=lambda folder: (*write_sounds(study, folder), *write_sources(study, folder)),
    )


def _cases(paths: Sequence[Path], own: "OwnComponents") -> "list[AnyCase | None]":
    from klack.case.any_case import load_any_case

    return [None if is_result(path) else load_any_case(path, own) for path in paths]


def _short(path: Path) -> str:
    if path.name == "result.zarr" or path.name == "case.yaml":
        path = path.absolute().parent
    return path.absolute().stem if path.suffix in (".yaml", ".yml") else path.absolute().name


def _sources(
    path: Path,
    case: "AnyCase | None",
    names: Sequence[str],
    progress: Progress,
    threads: int | None,
) -> tuple["NoiseSource", ...]:
    from klack.analyses.noise.source import load_sources, run_sources

    if case is None:
        progress("result", 0.0)
        return load_sources(path, names)
    return run_sources(case, names, progress=progress, threads=threads)


def _names(paths: Sequence[Path], sources: Sequence["NoiseSource"]) -> tuple[str, ...]:
    per_path = len(sources) // len(paths)
    folders = [_short(paths[i // per_path]) for i in range(len(sources))]
    candidates = (
        [source.case for source in sources],
        [f"{source.case} {source.run}" for source in sources],
        folders,
        [f"{name} {source.run}" for name, source in zip(folders, sources, strict=True)],
    )
    for found in candidates:
        if len(set(found)) == len(found):
            return tuple(found)
    return tuple(f"{source.case} {source.run} {i + 1}" for i, source in enumerate(sources))
