#!/usr/bin/env bash
# mosqito 1.2.1: loudness over time is above zero in silence before a sound that lasts to the end.
#
# Guess: loudness_zwtv is causal: before a tone begins there are 0 sone, as in silence alone.
# Reality, 2026-11-29: with a tone from 0.4 s to the end at 0.5 s, 0.09 sone stand at 4 ms.  With the
# same tone and half a second of silence after it there are none: the decay of hearing wraps round.
# Why it matters here: recordings of clicks are cut close, and the drone of a pump lasts to the end;
# quiet clicks near the beginning get loudness that is not theirs.  klack has a decay of its own.
set -euo pipefail
place=$(mktemp -d)
trap 'rm -rf "$place"' EXIT
python3 -m venv "$place/env"
"$place/env/bin/pip" install --quiet --disable-pip-version-check mosqito==1.2.1 numpy==2.2.6 scipy==1.15.3 matplotlib==3.10.3
"$place/env/bin/python" -W ignore - <<'PYTHON'
import numpy as np
from mosqito.sq_metrics import loudness_zwtv

RATE = 48_000
time = np.arange(RATE // 2) / RATE
tone = np.where(time >= 0.4, 0.2 * np.sin(2 * np.pi * 1000 * time), 0.0)


def before(pressure):
    """Largest loudness [sone] in the first 0.35 s, which are silent."""
    loudness, _, _, when = loudness_zwtv(pressure, RATE, "free")
    return float(loudness[when < 0.35].max())


to_the_end, ended = before(tone), before(np.concatenate([tone, np.zeros(RATE // 2)]))
print(f"before the tone: {to_the_end:.3f} sone; if silence follows it: {ended:.3f} sone")
assert to_the_end > 0.05 and ended < 1e-6, (to_the_end, ended)
PYTHON
echo "as found: 0.09 sone in silence"
