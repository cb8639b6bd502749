"""Maps of a magnet from files: each layout gives the same table, each fault one clear error."""

import numpy as np
import pytest
from doubts import doubts

from klack.errors import AccuracyWarning, InputError
from klack.magnetics.flux_map import FluxMap
from klack.magnetics.force_map_solenoid import ForceMapSolenoid
from klack.magnetics.map_choice import MapFile
from klack.magnetics.map_text import LARGEST
from klack.verification.magnetic_networks import force_of, linkage_of, written

CURRENT, GAP = np.array([0.0, 1.0, 2.5, 4.0]), np.array([20e-6, 60e-6, 100e-6, 160e-6])
HEAD = "Current [A],gap [mm],FluxLinkage(Coil) [mWb],Force1.Force_z [newton]"


def lines(head=HEAD, scale=1.0):
    rows = [head]
    rows += [
        f"{i:.9g},{1e3 * x:.9g},{1e3 * scale * linkage_of(i, x):.9g},{force_of(i, x):.9g}"
        for i in CURRENT
        for x in GAP
    ]
    return rows


def choice(folder, rows, **keys):
    (folder / "map.csv").write_bytes(
        rows if isinstance(rows, bytes) else "\n".join(rows).encode("utf-8")
    )
    return MapFile.model_validate({"file": "map.csv", **keys}, context={"folder": folder})


def coil(folder, rows, **keys):
    (folder / "map.csv").write_text("\n".join(rows))
    given = {"resistance": "1 ohm", "gap": "100 um", "map": {"file": "map.csv", **keys}}
    return ForceMapSolenoid.model_validate(given, context={"folder": folder})


def test_all_layouts_are_one_table(tmp_path):
    tables = [made.table() for made in written(tmp_path).values()]

    assert len(tables) == 5
    for table in tables:
        i, x = table.current[:, None], table.gap[None, :]
        np.testing.assert_allclose(table.linkage, linkage_of(i, x), rtol=1e-12)
        np.testing.assert_allclose(table.force, force_of(i, x), rtol=1e-12, atol=1e-15)


def test_a_position_that_grows_while_the_gap_closes(tmp_path):
    rows = [HEAD]
    rows += [
        f"{i},{0.2 - 1e3 * x:.9g},{1e3 * linkage_of(i, x):.12g},{force_of(i, x):.12g}"
        for i in CURRENT
        for x in GAP
    ]

    table = choice(tmp_path, rows, closed_at="0.2 mm").table()

    np.testing.assert_allclose(table.gap, GAP, rtol=1e-9)
    np.testing.assert_allclose(table.linkage, linkage_of(CURRENT[:, None], GAP), rtol=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda r: [*r[:6], *r[7:]], "no point at 1 A and a gap of 60 um"),
        (lambda r: [*r, r[6]], "more than one point at 1 A and a gap of 60 um"),
        (lambda r: [*r[:6], "1,0.06,,-1", *r[7:]], r"line 7, column 'FluxLinkage\(Coil\) \[mWb\]'"),
        (lambda r: [*r[:6], "1,0.06,nan,-1", *r[7:]], "'nan', expected a number"),
        (lambda r: [*r[:6], "1,0.06,0.3", *r[7:]], "line 7: 3 cells, expected 4"),
        (lambda r: [*r[:6], "1,0.06,1e999,-1", *r[7:]], "line 7"),
        (lambda r: [r[0].replace("[mm]", ""), *r[1:]], "unit of the gap: none"),
        (lambda r: [r[0].replace("[mm]", "[N]"), *r[1:]], "unit of the gap: 'N'"),
        (lambda r: [r[0].replace("FluxLinkage(Coil)", "B"), *r[1:]], "a force alone does not"),
        (lambda r: [f"{line},{line.split(',')[-1]}" for line in r], "2 columns that may be the"),
        (lambda r: r[:1], "no row of numbers"),
        (lambda r: r[:1] + [x for x in r if ",0.02," in x or ",0.06," in x], "and 2 gaps"),
        (lambda r: [r[0], *("-" + line for line in r[1:])], "currents from 0|more than one point"),
        (
            lambda r: [r[0], *(r[1:5][::-1]), *r[5:-1], "4,0.16,0.001,-1"],
            "increases with the current",
        ),
    ],
)
def test_faults_are_named(tmp_path, change, words):
    with pytest.raises((InputError, ValueError), match=words):
        coil(tmp_path, change(lines()))


def test_a_coil_that_counts_the_other_way(tmp_path):
    with pytest.raises(ValueError, match="linkage_factor: -1"):
        choice(tmp_path, lines(scale=-1.0))

    assert choice(tmp_path, lines(scale=-1.0), linkage_factor=-1).table().linkage[-1, 0] > 0.0


def test_a_gap_that_is_a_position_is_refused(tmp_path):
    rows = [
        HEAD,
        *(f"{i},{0.2 - 1e3 * x},{1e3 * linkage_of(i, x)},0" for i in CURRENT for x in GAP),
    ]

    with pytest.raises(ValueError, match="give closed_at"):
        choice(tmp_path, rows)


def test_a_magnet_in_the_map_is_refused(tmp_path):
    rows = [HEAD, *(f"{i},{1e3 * x},{1e3 * linkage_of(i + 1, x)},0" for i in CURRENT for x in GAP)]

    with pytest.raises(ValueError, match="neither magnets nor remanence"):
        choice(tmp_path, rows)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"PK\3\4\0\0\0\0 workbook", "not text"),
        (b"1,2\n" * (LARGEST // 4 + 1), "at most 4 MB"),
        (b"", "no row of numbers"),
        (b"0,1,2\n1,2,3\n", "no names of columns"),
    ],
)
def test_files_that_are_no_tables(tmp_path, data, words):
    with pytest.raises(ValueError, match=words):
        choice(tmp_path, data)


def test_other_encodings_units_below_names_and_comments(tmp_path):
    rows = ["# exported", "# current;gap;psi;force", "# A;µm;mWb;mN"]
    rows += [
        f"{i:g};{1e6 * x:g};{1e3 * linkage_of(i, x):.9g};{1e3 * force_of(i, x):.9g}".replace(
            ".", ","
        )
        for i in CURRENT
        for x in GAP
    ]

    for encoding in ("utf-8-sig", "utf-16", "latin-1"):
        table = choice(tmp_path, "\r\n".join(rows).encode(encoding)).table()
        np.testing.assert_allclose(table.linkage, linkage_of(CURRENT[:, None], GAP), rtol=1e-8)
        np.testing.assert_allclose(table.force[1:], force_of(CURRENT[1:, None], GAP), rtol=1e-8)


def test_force_matrix_over_other_points(tmp_path):
    psi = [
        "gap [mm] / current [A] / linkage [mWb];0;1;2",
        "0,1;0;1;2",
        "0,2;0;0,9;1,8",
        "0,3;0;0,8;1,7",
    ]
    force = [
        "gap [mm] / current [A] / force [N];0;1;3",
        "0,1;0;-1;-2",
        "0,2;0;-1;-2",
        "0,3;0;-1;-2",
    ]
    (tmp_path / "force.csv").write_text("\n".join(force))

    with pytest.raises(ValueError, match="the 3 currents and 3 gaps of 'map"):
        choice(tmp_path, psi, layout="matrix", force_file="force.csv")


def test_matrix_names_its_empty_cell(tmp_path):
    psi = ["gap [mm] / current [A];0;1;2", "0,1;0;1;2", "0,2;0;;1,8", "0,3;0;0,8;1,7"]

    with pytest.raises(ValueError, match="line 3, column '1': an empty cell"):
        choice(tmp_path, psi, layout="matrix", units={"linkage": "mWb"})


def test_virtual_work_says_how_large_and_where(tmp_path):
    rows = lines()
    cells = rows[11].split(",")  # 2.5 A, 100 um
    rows[11] = ",".join([*cells[:3], str(1.9 * float(cells[3]))])

    with doubts() as texts:
        coil(tmp_path, rows)

    text = texts[0]
    assert "at 2.5 A and a gap of 100 um" in text
    assert "between 1 A and 2.5 A at 100 um" in text or "between 2.5 A and 4 A at 100 um" in text


def test_force_of_half_a_model_is_recognised(tmp_path):
    current, gap = np.linspace(0.0, 8.0, 17), np.linspace(20e-6, 160e-6, 29)
    psi = linkage_of(current[:, None], gap)
    force = force_of(current[:, None], gap)

    with pytest.warns(AccuracyWarning, match="force_factor: 2"):
        FluxMap.of(current=current, gap=gap, linkage=psi, force=0.5 * force)
    with pytest.warns(AccuracyWarning, match="force_closing: positive"):
        FluxMap.of(current=current, gap=gap, linkage=psi, force=-force)


def test_a_table_and_a_file_exclude_each_other(tmp_path):
    (tmp_path / "map.csv").write_text("\n".join(lines()))
    with pytest.raises(ValueError, match="current together with map"):
        ForceMapSolenoid.model_validate(
            {
                "resistance": "1 ohm",
                "gap": "1 mm",
                "map": {"file": "map.csv"},
                "current": ["0 A", "1 A"],
            },
            context={"folder": tmp_path},
        )
    with pytest.raises(ValueError, match="neither 'current' nor 'map'"):
        ForceMapSolenoid.model_validate({"resistance": "1 ohm", "gap": "1 mm"})


@pytest.mark.slow
def test_random_maps_are_read(tmp_path):
    """A hundred sensible maps: other units, orders, separators and decimal signs."""
    rng = np.random.default_rng(7)
    for _ in range(100):
        current = np.sort(rng.choice(np.arange(1, 60), rng.integers(2, 8), replace=False)) / 7.0
        gap = np.sort(rng.choice(np.arange(2, 80), rng.integers(3, 9), replace=False)) * 3e-6
        scale = {"m": 1.0, "mm": 1e3, "um": 1e6}
        unit, flux = rng.choice(list(scale)), rng.choice(["Wb", "mWb", "uWb"])
        big = {"Wb": 1.0, "mWb": 1e3, "uWb": 1e6}[flux]
        heads = ["I_coil current [A]", f"air gap ({unit})", f"Flux Linkage [{flux}]"]
        order = rng.permutation(3)
        separator, decimal = [(";", ","), (",", "."), ("\t", ","), (";", ".")][rng.integers(4)]
        rows = []
        for i in current:
            for x in gap:
                numbers = [i, scale[unit] * x, big * float(linkage_of(i, x))]
                cells = [
                    f"{numbers[k]:.{rng.integers(9, 16)}g}".replace(".", decimal) for k in order
                ]
                rows.append(separator.join(cells))
        rng.shuffle(rows)
        table = choice(tmp_path, [separator.join(heads[k] for k in order), *rows]).table()

        np.testing.assert_allclose(table.current, current, rtol=1e-7)
        np.testing.assert_allclose(table.gap, gap, rtol=1e-7)
        np.testing.assert_allclose(table.linkage, linkage_of(current[:, None], gap), rtol=1e-7)
