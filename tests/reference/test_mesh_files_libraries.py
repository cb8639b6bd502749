"""ANSYS archives that ANSYS wrote, against mapdl-archive and VTK.

Truth: reference.  The examples of mapdl-archive (SOLID185, 186, 187, wedges, MESH200), read by that
library into a VTK grid: same nodes, same number of elements, same volume.
"""

from pathlib import Path

import numpy as np
import pytest

from klack.mesh.files.ansys.reader import read_ansys_archive
from klack.mesh.quality import corner_volume

mapdl_archive = pytest.importorskip("mapdl_archive")
EXAMPLES = Path(mapdl_archive.__file__).parent / "examples"

# Faces of hexahedra that are not plane are split in another way by VTK.
FILES = {
    "HexBeam.cdb": 1e-12,
    "TetBeam.cdb": 1e-12,
    "academic_rotor.cdb": 1e-9,
    "sector.cdb": 2e-3,
}


@pytest.mark.parametrize("name", FILES)
def test_same_mesh_as_the_library(name: str) -> None:
    archive = mapdl_archive.Archive(EXAMPLES / name)
    solid = np.flatnonzero(np.isin(archive.etype, (185, 186, 187)))
    grid = archive.grid.extract_cells(
        np.isin(
            archive.grid.cell_data["ansys_etype"],
            archive.ekey[np.isin(archive.ekey[:, 1], (185, 186, 187)), 0],
        )
    )
    model = read_ansys_archive(EXAMPLES / name, 1.0)
    mesh = model.mesh
    assert mesh.element_count == len(solid)
    np.testing.assert_array_equal(
        np.sort(np.concatenate(model.element_numbers)), np.sort(archive.enum[solid])
    )
    order = np.argsort(archive.nnum)
    place = np.searchsorted(archive.nnum[order], model.node_numbers)
    # that library is off by the last digit in some decimals
    np.testing.assert_allclose(mesh.points, archive.nodes[order][place, :3], rtol=1e-15)
    assert corner_volume(mesh) == pytest.approx(float(grid.volume), rel=FILES[name])
    for label, members in archive.node_components.items():
        own = model.node_numbers[mesh.node_sets[label.strip()]]
        np.testing.assert_array_equal(own, np.intersect1d(members, model.node_numbers))
