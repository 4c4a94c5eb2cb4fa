"""The paper's models 1 to 5 side by side on held-out poses, on a virtual twin of the paper's machine."""

import sys
from pathlib import Path

from gtpin.comparison.compare import compare

sys.path.insert(0, str(Path(__file__).parent / "dressler2010"))
from measure import measure

dataset, _ = measure(2010)  # 176 poses, and 28 measured places along each guideway
print(f"{len(dataset)} poses, {len(dataset.carts.q)} cart poses")

comparison = compare(dataset)  # each model fitted to one half of the poses predicts the other
print(comparison.table().round(1).to_string(index=False))

about = {1: "reduced arm, straight tracks", 2: "reduced arm, measured tracks", 3: "full arm, straight tracks"}
about |= {4: "full arm, measured tracks", 5: "full arm, some tracks measured"}
for model, interval in zip(comparison.table()["model"], comparison.intervals(), strict=True):
    low, high = interval["mean_um"]
    print(f"model {model} ({about[model]}): mean error {low:.0f} to {high:.0f} um (95 %)")
