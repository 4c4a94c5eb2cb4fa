"""Diagnose what a calibrated geometry does not explain: one cause, several at once, or a cause that is in no catalogue."""

import numpy as np

import gtpin
from gtpin.bench.simulator import make_case  # virtual machines with hidden effects: stand in for your measurements

MACHINES = {
    "a machine with play in drive 1, and noise": make_case(
        3, effects=[("backlash", "cart1")], noncentrality=1500.0, poses=100
    ),
    "a machine with nothing but noise": make_case(4, effects=[], poses=100),
}
for name, case in MACHINES.items():
    diagnosis = gtpin.diagnose(case.dataset)
    print(f"{name}: {diagnosis.verdict}")
    for cause in diagnosis.causes:
        print(f"  {cause.effect} at {cause.site}, probability {cause.probability:.2f}")
        for parameter, found in cause.parameters.items():
            print(f"    {parameter} {found.value:.2e} +- {found.sigma:.0e} {found.unit}")
        print("    could be: ", ", ".join(f"{m.effect} at {m.site} ({m.probability:.2f})" for m in cause.members))

    gap = diagnosis.gap  # on poses that were left out of the fit, m
    print(f"  error {gap.before * 1e6:.1f} -> {gap.after * 1e6:.1f} um, noise alone {gap.floor * 1e6:.1f} um")
    if diagnosis.verdict != "none":
        largest = max(diagnosis.where.site, key=diagnosis.where.site.get)
        print(f"  the site whose motion explains most: {largest} ({diagnosis.where.site[largest]:.0%})")

    untestable = [c for c in diagnosis.candidates if not c.testable]
    print(
        f"  {len(untestable)} candidates can't be tested, such as {untestable[0].effect}: {untestable[0].reason.kind}"
    )
    for experiment in diagnosis.next_experiment[:1]:
        print("  next:", experiment.measure)

    for told, model in (("geometry alone", diagnosis.baseline.model), ("with causes", diagnosis.model)):
        off = model.predict(case.commands.q, case.commands.covariates).T - case.truth.T
        print(f"  true error on new poses, {told}: {np.sqrt((off**2).sum(axis=1).mean()) * 1e6:.1f} um")
