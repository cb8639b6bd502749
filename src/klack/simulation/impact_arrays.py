"""What the time loops of impacts work on: named groups of flat arrays."""

from typing import NamedTuple, Self

import numpy as np

from klack.arrays import Index, Matrix, Vector

__all__ = ["Contacts", "Losses", "Record", "StepMatrices", "Watched"]


class StepMatrices(NamedTuple):
    """Exact step of ``m`` modes, and of constant forces on ``p`` rigid ones.

    Within a record the motion under constant forces runs beside that of all modes (superposition),
    because single numbers written into the state stall the vector loads; at its end it is added.
    """

    A: Matrix  # (4, m) A11, A12, A21, A22
    B: Matrix  # (2, m) B1, B2
    P: Matrix  # (2, m) A B
    push_index: Index  # (p,) rigid modes with a constant force
    push: Matrix  # (2, p) what it adds to their q, v in a step


class Contacts(NamedTuple):
    """Gaps, ``gap + rows q``, and one law per contact as flat numbers."""

    rows: Matrix  # (c, m) the modal force of contact c is ``rows[c] F[c]``
    gap: Vector  # (c,) [m]
    G: Matrix  # (c, c) rows B1 rows^T: gap at the end of a step from unit forces during it [m/N]
    law_kind: Index  # (c,)
    law_data: Vector  # with the places of sliders, which a step changes
    law_start: Index  # (c,) into ``law_data``
    alpha: Vector  # (c,) dissipation factor
    series: Vector  # (c,) compliance in series [m/N]


class Losses(NamedTuple):
    """Modal damping: energy weights of the damped modes and their loss forms."""

    damped: bool
    weight: Matrix  # (2, m) zero for undamped modes
    forms: Matrix  # (6, m)


class Watched(NamedTuple):
    """What is recorded at the ends of records, and what unit forces of the last step add."""

    q: Matrix  # (k, m)
    q_force: Matrix  # (k, c)
    v: Matrix  # (l, m)
    v_force: Matrix  # (l, c)


class Record(NamedTuple):
    """Out: ``n`` records; row 0 of ``q`` and ``v`` is filled in by the caller."""

    force: Matrix  # (n, c) [N] mean
    peak: Matrix  # (n, c) [N] largest of a step
    gap: Matrix  # (n, c) [m] mean
    q: Matrix  # (n + 1, k)
    v: Matrix  # (n + 1, l)

    @classmethod
    def empty(cls, records: int, contacts: int, watched: Watched) -> Self:
        """Return room for so many records."""
        force, peak, gap = (np.zeros((records, contacts)) for _ in range(3))
        q, v = (np.zeros((records + 1, len(rows))) for rows in (watched.q, watched.v))
        return cls(force, peak, gap, q, v)
