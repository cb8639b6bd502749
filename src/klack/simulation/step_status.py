"""How a step of a network ended."""

__all__ = [
    "STATUS_BRANCH",
    "STATUS_DONE",
    "STATUS_ELEMENT",
    "STATUS_FORCES",
    "STATUS_MET",
    "STATUS_PRESSURES",
    "STATUS_REFUSED",
    "STATUS_REPEAT",
]

STATUS_DONE, STATUS_ELEMENT, STATUS_BRANCH, STATUS_PRESSURES, STATUS_FORCES = 0, 1, 2, 3, 4

STATUS_REFUSED = -1
"""Of a macro step: elements and fluid need fine steps."""

STATUS_MET = -2
"""Of a step that met a touch or a release: bodies need finer ones."""

STATUS_REPEAT = -3
"""Of a step whose guess of the forces of elements and fluid missed too much."""
