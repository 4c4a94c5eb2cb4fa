"""A small valid dataset as text."""

TOML = """schema = "gtpin-dataset/1"
robot = "gantry_tau"

[instrument]
position_sigma = 1.5e-5
"""

HEADER = "pose,q1,q2,q3,x,y,z,qw,qx,qy,qz,time,session,payload,approach1"
LINES = (
    "a,0.1,0.2,0.3,1.5,-4.25,0.125,1,0,0,0,10,day1,0,1",
    "b,-0.1,0.25,0.5,1.25,-4.5,0.25,0.6,0.8,0,0,20,day1,10,-1",
    "c,0.4,-0.2,0.125,1.125,-4.75,0.5,0,0.6,0,0.8,30,day2,10,1",
    "a,0.1,0.2,0.3,1.5,-4.25,0.125,1,0,0,0,40,day2,0,-1",
)


def table(*lines: str) -> str:
    """A table of some rows."""
    return "\n".join((HEADER, *lines, ""))


def with_column(name: str, *cells: str) -> str:
    """The valid table with one more column, or with a column's cells replaced."""
    rows = [line.split(",") for line in (HEADER, *LINES)]
    if name not in rows[0]:
        for row in rows:
            row.append(name)
    at = rows[0].index(name)
    for row, cell in zip(rows[1:], cells, strict=True):
        row[at] = cell
    return "\n".join(",".join(row) for row in rows)


def without(*names: str) -> str:
    """The valid table without some of its columns."""
    rows = [line.split(",") for line in (HEADER, *LINES)]
    kept = [i for i, name in enumerate(rows[0]) if name not in names]
    return "\n".join(",".join(row[i] for i in kept) for row in rows)
