"""Sound around closed surfaces: boundary elements, and what they make of the motion of a body."""
