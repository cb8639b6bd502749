"""Results as MDF 4, so that measurement tools open a computed stroke like a measured one.

One channel group per run and axis of time. No curves over frequency: a master of MDF is a time, an
angle, a distance or an index.
"""

from datetime import UTC, datetime
from pathlib import Path

from klack.errors import optional_package
from klack.exchange.results.table import ResultRun, ResultTable
from klack.files.whole import whole_file

__all__ = ["write_mdf"]


def write_mdf(table: ResultTable, path: Path) -> Path:
    """Write an MDF 4.10 file; channels are called ``wet/needle.tip displacement``.

    Few tools look for another suffix than ``.mf4``.

    Raises
    ------
    MissingExtraError
        Without the package asammdf.
    """
    asammdf = optional_package("asammdf", "writing MDF", "exchange")
    with asammdf.MDF(version="4.10") as file:
        file.header.start_time = _start(table.about.get("created", ""))
        file.header.comment = _lines({"kind": table.kind, **table.about})
        for run in table.runs:
            for axis, channels in run.along():
                if axis.quantity != "time" or not channels or axis.values.size == 0:
                    continue
                signals = [
                    asammdf.Signal(
                        samples=channel.values,
                        timestamps=axis.values,
                        unit=channel.unit,
                        name=f"{run.name}/{channel.name}",
                        comment=channel.meaning,
                    )
                    for channel in channels
                ]
                group = run.name if axis is run.axes[0] else f"{run.name}/{axis.name}"
                file.append(signals, acq_name=group, comment=_group_comment(run, axis.meaning))
        with whole_file(path) as new:
            plain = new.with_name(f"{new.name}.mf4")  # asammdf writes no other suffix
            try:
                file.save(plain, overwrite=True, compression=1)
                plain.replace(new)
            finally:
                plain.unlink(missing_ok=True)
    return path


def _start(created: str) -> datetime:
    """Date of the study, or the epoch."""
    try:
        date = datetime.fromisoformat(created)
    except ValueError:
        return datetime.fromtimestamp(0, UTC)
    return date if date.tzinfo else date.replace(tzinfo=UTC)


def _group_comment(run: ResultRun, time: str) -> str:
    lines = {"run": run.label, "solver": run.solver, "time": time}
    lines |= {item.name: f"{item.value!r} {item.unit}" for item in run.scalars}
    return _lines(lines)


def _lines(about: dict[str, str]) -> str:
    return "\n".join(f"{name}: {text}" for name, text in about.items() if text)
