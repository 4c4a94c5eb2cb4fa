"""Tables of corrections as files: CSV, and LinuxCNC's joint compensation files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from gtpin.compensation.corrections import Correction
from gtpin.errors import warn

if TYPE_CHECKING:
    import pandas as pd

TRIPLETS = 256
"""Largest number of lines (triplets) in LinuxCNC's compensation file of a joint."""
COARSE = 1e-6
"""Interpolation error of a table, m or rad, above which a warning is given."""


def correction_table(tables: Sequence[Correction]) -> pd.DataFrame:
    """Columns ``actuator nominal forward reverse``: commands that bring the actuator to ``nominal``, m or rad."""
    import pandas as pd

    rows = [
        pd.DataFrame({"actuator": t.site, "nominal": t.nominal, "forward": t.forward, "reverse": t.reverse})
        for t in tables
    ]
    return pd.concat(rows, ignore_index=True)


def linuxcnc_file(table: Correction) -> str:
    """A joint's compensation file for LinuxCNC, ``COMP_FILE_TYPE = 1``: nominal, forward trim, reverse trim.

    In mm, or degrees for a revolute joint. LinuxCNC adds the trim, interpolated, to the position that it sends to the motor
    (``usrmotLoadComp`` in its ``usrmotintf.cc``). It reads at most 256 lines, with ascending nominals and without comments.
    """
    if table.off > COARSE:
        warn(f"{TRIPLETS} lines can't follow {table.site}: they are off by up to {table.off * 1e6:.1f} um (or urad)")
    unit = 180.0 / np.pi if table.revolute else 1e3
    trims = (table.nominal, table.forward - table.nominal, table.reverse - table.nominal)
    return "".join(f"{n:.7f} {f:.7f} {r:.7f}\n" for n, f, r in zip(*(unit * column for column in trims), strict=True))
