"""``klack reduce``: both bodies reduced at their contact, and how far up they can be trusted."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np

from klack.analyses.impact.transfer import TRANSFER_MODES, compare_transfer
from klack.analyses.json_results import ReducedBodyJson, ReductionJson
from klack.assembling.given_pair import build_given_pair
from klack.assembling.modes import elastic_count, mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, own_pair
from klack.case.schema import Case
from klack.progress import Progress, silent
from klack.reduction.reduced_body import ReducedBody
from klack.reduction.transfer import TransferComparison

__all__ = ["ReductionStudy", "run_reduce"]


@dataclass(frozen=True, kw_only=True, eq=False)
class ReductionStudy:
    """Two reduced bodies with a port at their contact, and their transfer functions.

    Parameters
    ----------
    case : str
    bodies : tuple of ReducedBody
    transfer : tuple of TransferComparison
        Of each body: full order first, then 20 and 50 modes with and without correction.
    """

    case: str
    bodies: tuple[ReducedBody, ...]
    transfer: tuple[TransferComparison, ...]

    columns: ClassVar[tuple[str, ...]] = (
        "body",
        "degrees of freedom",
        "modes",
        "up to [kHz]",
        "static compliance [m/N]",
        "share of the modes [%]",
    )

    def rows(self) -> tuple[tuple[str, ...], ...]:
        """Rows of :attr:`columns`, one per body, as text."""
        return tuple(
            (
                body.name,
                str(body.dof_count),
                str(elastic_count(body)),
                f"{_highest(body) / 1e3:.4g}",
                f"{body.static_compliance[0, 0]:.4g}",
                f"{100 * body.compliance_share[0]:.3g}" if body.static_compliance[0, 0] else "-",
            )
            for body in self.bodies
        )

    def to_json(self) -> ReductionJson:
        """Plain numbers in SI, the unit in the key."""
        return {
            "schema": "klack-reduce/1",
            "case": self.case,
            "bodies": {body.name: _body_json(body) for body in self.bodies},
            "transfer": {
                item.body: {
                    "valid_up_to_Hz": {
                        label: float(limit)
                        for label, limit in zip(item.labels, item.valid_up_to, strict=True)
                    },
                    "tolerance_dB": item.tolerance,
                    "loss_factor": item.loss_factor,
                }
                for item in self.transfer
            },
        }

    def save(self, folder: Path) -> None:
        """Write ``NAME.reduced.npz`` and ``NAME.transfer.csv`` of each body into a folder."""
        for body in self.bodies:
            body.save(folder / f"{body.name}.reduced.npz")
        for item in self.transfer:
            with (folder / f"{item.body}.transfer.csv").open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(
                    ["frequency [Hz]"]
                    + [f"|{label}| [m/N]" for label in item.labels]
                    + [f"deviation of {label} [dB]" for label in item.labels[1:]]
                )
                table = np.vstack(
                    [item.frequencies, np.abs(item.curves), item.level_deviations[1:]]
                ).T
                writer.writerows([f"{value:.9g}" for value in row] for row in table)


def _highest(body: ReducedBody) -> float:
    """Highest frequency of a mode that is no attachment mode [Hz]."""
    kept = body.frequencies[: body.rigid_count + elastic_count(body)]
    return float(kept[-1]) if len(kept) else 0.0


def _body_json(body: ReducedBody) -> ReducedBodyJson:
    elastic = slice(body.rigid_count, None)
    return {
        "mass_kg": body.mass if np.isfinite(body.mass) else None,
        "degrees_of_freedom": body.dof_count,
        "rigid_modes": body.rigid_count,
        "frequencies_Hz": [float(f) for f in body.frequencies[elastic]],
        "static_compliance_m_per_N": float(body.static_compliance[0, 0]),
        "modal_compliance_m_per_N": float(body.modal_compliance[0, 0]),
        "correction": body.correction,
    }


def run_reduce(
    case: Case, *, progress: Progress = silent, threads: int | None = None
) -> ReductionStudy:
    """Reduce both bodies of a case at their contact and compare transfer functions.

    The reduced bodies keep the displacement of all named surfaces (recovery), for pictures.  Where
    a body has no surfaces, both are reduced at their ports, without transfer functions: the full
    order of a reduced model is not known.
    """
    if not case.has_surfaces:
        given = build_given_pair(case, progress, threads=threads)
        return ReductionStudy(case=case.name, bodies=(given.upper, given.lower), transfer=())
    problem = build_problem(case, progress, threads=threads)
    pools = mode_pools(problem, at_least=TRANSFER_MODES, progress=progress)
    progress("reduced", 0.0)
    pair = own_pair(problem, pools, stiffness=first_stiffness(problem), recovery=True)
    progress("reduced", 1.0)
    transfer = compare_transfer(problem, pools, pair.ports, progress=progress)
    problem.close()
    return ReductionStudy(case=case.name, bodies=(pair.upper, pair.lower), transfer=transfer)
