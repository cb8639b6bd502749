"""Phases of a step for elements: all that pushes ports without a pressure or a gap between."""

from typing import Any

from klack.network.step_function import shift
from klack.simulation.network_arrays import ANSWER, SEEN, STORE, Y1, Step
from klack.simulation.phase import phase
from klack.simulation.row_calls import ask_element, failed_at, push_ports, take_states
from klack.simulation.step_status import STATUS_DONE, STATUS_ELEMENT

__all__ = ["end_elements", "push_by_elements"]


@phase
def push_by_elements(elements: Any, S: Any, step: Step, report: Any) -> int:
    """Forces of all elements for the displacements of this step."""
    seen, end, force = shift(S, SEEN), shift(S, Y1), shift(S, ANSWER)
    for k in range(elements.rows):
        status = ask_element(elements, k, step.t, step.H, seen, end)
        if status != 0:
            report[0], report[1], report[2] = k, status, step.t
            return failed_at(step.level, status, STATUS_ELEMENT)
        push_ports(elements, k, force)
    return STATUS_DONE


@phase
def end_elements(elements: Any, H: float, accounts: Any, kind: Any, sums: Any) -> None:
    """Take over states and accounts of all elements."""
    for k in range(elements.rows):
        o0, q0 = elements.output0[k], elements.port0[k]
        for j in range(q0, elements.port0[k + 1]):
            sums[j] += H * elements.outputs[o0 + j - q0]
        o0 = take_states(elements, k)
        for j in range(elements.accounts[k]):
            account = elements.account0[k] + j
            if kind[account] == STORE:
                accounts.rows[account] = elements.outputs[o0 + j]
            else:
                accounts.rows[account] += elements.outputs[o0 + j]
