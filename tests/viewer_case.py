"""A brick with one named face, two modes and three instants, for tests of the viewer."""

from dataclasses import replace

import numpy as np

from klack.mesh.mesh import ElementBlock, Mesh, Surface, outer_surface
from klack.mesh.skin import skin_of_mesh
from klack.viewer.view import BodyView, ContactView, Curve, MotionView, View

__all__ = ["brick_view"]

FULL = 32767


def brick_view(face: str = "top") -> View:
    """A brick of 2 x 3 x 5 mm with its top named ``face``, and a block under it."""
    upper = _body("brick", np.zeros(3), face)
    lower = replace(_body("block", np.array([0.0, 0.0, -5e-3]), "bottom"), motion=None)
    time = np.array([0.0, 1e-6, 2e-6])
    angle = np.linspace(0.0, 2.0 * np.pi, 48, endpoint=False)
    ring = np.column_stack(
        [1e-3 + 0.5e-3 * np.cos(angle), 1.5e-3 + 0.5e-3 * np.sin(angle), 0 * angle]
    )
    return View(
        name="brick",
        title="A brick",
        source="case brick",
        description="",
        version="1.2.3",
        bodies=(upper, lower),
        contacts=(
            ContactView(
                name="contact",
                upper=f"brick.{face}",
                lower="block.bottom",
                ring=ring,
                closed=True,
                gap=2e-6,
            ),
        ),
        facts=(("end stops", (("end-stop", "seat", f"block.bottom on brick.{face}: gap 2 um"),)),),
        time=time,
        transfer=(
            Curve(
                name="full",
                x=np.geomspace(0.1, 10.0, 50),
                y=np.geomspace(1e-6, 1e-9, 50),
                x_unit="kHz",
                y_unit="m/N",
                body="brick",
            ),
        ),
        histories=(
            Curve(
                name="contact force",
                x=time * 1e6,
                y=np.array([0.0, 9.0, 1.0]),
                x_unit="µs",
                y_unit="N",
            ),
        ),
    )


def _body(name: str, place: np.ndarray, face: str) -> BodyView:
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    mesh = Mesh(
        points=corners * [2e-3, 3e-3, 5e-3] + place,
        blocks=(ElementBlock("hex8", np.array([[0, 1, 3, 2, 4, 5, 7, 6]]), name),),
    )
    height = mesh.points[:, 2].max()
    blocks = tuple(
        replace(
            b, connectivity=b.connectivity[(mesh.points[b.connectivity][..., 2] == height).all(1)]
        )
        for b in outer_surface(mesh).blocks
    )
    skin = skin_of_mesh(replace(mesh, surfaces={face: Surface(face, blocks)}))
    shapes = np.zeros((3, 8, 3), dtype=np.int16)
    shapes[0, :, 2] = FULL  # down as a whole
    shapes[1, 4:, 0] = FULL  # the upper end to the side
    shapes[2, 4:, 1] = FULL
    return BodyView(
        name=name,
        about="one element",
        rows=(
            ("mass", "", "0.2 g of steel"),
            ("surface", face, "30 mm^2, z 5 mm"),
            ("edges", "", "2 um"),
        ),
        centre=mesh.points.mean(axis=0),
        skin=skin,
        held=np.zeros(len(skin.points), dtype=bool),
        section=np.empty((0, 2, 3)),
        finest=2e-3,
        motion=MotionView(
            shapes=shapes,
            scale=np.ones(3),
            frequency=np.array([0.0, 1000.0, 2500.0]),
            amplitude=np.array([[0.0, 0.0, 0.0], [-1e-6, 5e-7, 0.0], [1e-6, 0.0, 0.0]]),
            stress=np.linspace(0.0, 1e8, 8),
            node=np.arange(8),
        ),
    )
