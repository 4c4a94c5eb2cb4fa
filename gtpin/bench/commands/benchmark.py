"""``gtpin benchmark``: makes the public set of cases, and scores the answers of any solver."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gtpin.commands.terminal import AsJson, Command, Force, Output, tell, write_json
from gtpin.errors import GtpinError, warn
from gtpin.output.results import results_folder

Cases = Annotated[
    list[str] | None, typer.Option("--case", help="Only this case. Can be given several times.", show_default="all 100")
]
benchmark_app = typer.Typer(
    name="benchmark",
    help="Make the public set of cases, and score the answers of any solver.",
    no_args_is_help=True,
    add_completion=False,
    epilog="Example: gtpin lab benchmark make -o set",
)


@benchmark_app.command(cls=Command, epilog="Example: gtpin lab benchmark make -o set")
def make(output: Output, case: Cases = None, force: Force = False, as_json: AsJson = False) -> None:
    """Make the 100 cases of the public set: OUTPUT/cases for solvers, OUTPUT/truths for the scorer."""
    from gtpin.bench.benchmark.public_set import CASES, TRUTHS, PublicSet, changed
    from gtpin.bench.benchmark.public_set import make as make_case

    public = PublicSet.read()
    names, drafts = public.chosen(case), public.drafts()
    with results_folder(output, (CASES, TRUTHS), force=force) as folder:
        for name in names:
            make_case(drafts[name], folder)
        other = list(changed(public, folder, names))
    if other:
        warn(f"{len(other)} of {len(names)} cases are not those that were published: {', '.join(other[:5])}")
    told = {"cases": len(names), "changed": other}
    tell(told, f"{len(names)} cases, {len(other)} with other digests\nWritten: {output}", as_json)


@benchmark_app.command(cls=Command, epilog="Example: gtpin lab benchmark score set answers -o score")
def score(
    made: Annotated[Path, typer.Argument(help="Folder in which the set was made.")],
    answers: Annotated[Path, typer.Argument(help="Folder with NAME.json for each case.")],
    output: Output,
    case: Cases = None,
    force: Force = False,
    as_json: AsJson = False,
) -> None:
    """Compare a solver's answers with the truths."""
    from gtpin.bench.benchmark.answer import figures, score_answers, to_json
    from gtpin.bench.benchmark.public_set import PublicSet, changed

    if not answers.is_dir():
        raise GtpinError("there is no such folder", file=answers, hint="name the folder of the answers")
    public = PublicSet.read()
    names = public.chosen(case)
    found = score_answers(public, made, answers, names)
    if other := list(changed(public, made, names, truths_alone=True)):
        warn(f"{len(other)} of {len(names)} truths are not those that were published: {', '.join(other[:5])}")
    with results_folder(output, ("score.json",), force=force) as folder:
        write_json(folder / "score.json", to_json(found))
    lines = [f"{len(found)} cases", ""]
    for name, rate in figures(found.values()).items():
        if rate.value is not None:
            bounds = "" if rate.low is None else f"({rate.low:.3f} .. {rate.high:.3f})"
            lines.append(f"  {name:<52} {rate.value:7.3f} {bounds:<18} of {rate.of}")
    tell(to_json(found), "\n".join([*lines, f"Written: {output / 'score.json'}"]), as_json)
