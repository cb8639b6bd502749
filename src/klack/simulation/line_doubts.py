"""What a finished run says of its lines: laminar friction beyond its range, steep fronts."""

from collections.abc import Iterator

from klack.hydraulics.pipe_friction import LAMINAR, laminar_doubts
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.wave_rows import wave_store

__all__ = ["line_doubts"]


def line_doubts(network: CompiledNetwork, begin: float) -> Iterator[str]:
    """Sentences on all lines of a run that began at this time [s]."""
    rows, lines, state = network.rows, network.lines, network.line_state
    for k, row in enumerate(rows.lines):
        reynolds = LAMINAR * float(state.fastest[k]) / row.laminar_flow
        time = begin + lines.step * float(state.moment[k, 0])
        drop = row.resistance * float(state.fastest[k])
        yield from laminar_doubts(row.component, reynolds, time, drop)
    for k, wave in enumerate(rows.waves):
        _, _, reynolds, time = wave_store(network.waves, rows.waves, k)
        yield from wave.doubts(network.accounts.waves[k], float(reynolds), float(time))
