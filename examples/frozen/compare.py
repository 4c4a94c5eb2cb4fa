"""What a change of the code changes in the answers: datasets of blind checks with their answers, frozen, and compared later.

    python examples/frozen/compare.py freeze DIR... -o FROZEN
    python examples/frozen/compare.py compare FROZEN [--every K] [--jobs N]

README.md beside it says what is frozen and what counts as a difference.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from differences import Json, differences, fitted, told
from joblib import Parallel, delayed

import gtpin
from gtpin.bench.blind.truth import digest_of_files

ANSWERS = "answers.jsonl"
NOT_DATA = (".gtpin.json", "truth.sha256")
"""Files of a case's folder that are no part of its dataset."""


def asked(question: Callable[[], Json]) -> Json:
    """An answer, or the message with which it was refused."""
    try:
        return question()
    except Exception as error:  # one that is no GtpinError is a difference too, and must not end the others
        kind = "" if isinstance(error, gtpin.GtpinError) else f"{type(error).__name__}: "
        return {"refused": without_folder(f"{kind}{error}")}


def without_folder(message: str) -> str:
    """A message without the temporary folder in which a dataset was."""
    return re.sub(r"\S*[/\\]dataset\b[/\\]?", "", message)


def answered(files: Mapping[str, bytes], diagnosing: bool) -> tuple[Json, float, float]:
    """Calibrate and diagnose a dataset; gives the answer, and the time of the diagnosis in s, of CPU and by the clock."""
    with tempfile.TemporaryDirectory(prefix="gtpin-") as place, warnings.catch_warnings():
        warnings.simplefilter("ignore", gtpin.GtpinWarning)
        folder = Path(place) / "dataset"
        folder.mkdir()
        for name, content in files.items():
            (folder / name).write_bytes(content)
        answer = {"calibration": asked(lambda: fitted(gtpin.calibrate(gtpin.Dataset.read(folder)).to_json()))}
        cpu, clock = time.process_time(), time.perf_counter()
        if diagnosing:
            answer["diagnosis"] = asked(lambda: told(gtpin.diagnose(gtpin.Dataset.read(folder)).to_json()))
        return answer, time.process_time() - cpu, time.perf_counter() - clock


def made_by(run: str, check: Json) -> str:
    """The command that makes the datasets of a blind check."""
    if check["seed"] is None:
        return f"gtpin blind -o {run} --from CASES"
    kinds = "".join(f" --instrument {kind}" for kind in (check["instruments"] or "").split(",") if kind)
    return f"gtpin blind -o {run} --cases {check['cases']} --seed {check['seed']} --robot {check['robot']}{kinds}"


def read_run(root: Path) -> Iterator[tuple[Json, dict[str, bytes]]]:
    """The frozen line of each case of a blind check, without the calibration, and the files of its dataset."""
    if not (root / "score.json").is_file():
        raise gtpin.GtpinError("no finished blind check", file=root, hint="gtpin blind -o makes one")
    check = json.loads((root / "check.json").read_text(encoding="utf-8"))
    seconds = dict(line.split() for line in (root / "seconds.txt").read_text(encoding="utf-8").splitlines())
    run = root.resolve().name
    for case, sha256 in sorted(check["digests"]["dataset"].items()):
        folder = root / "cases" / case
        files = {f.name: f.read_bytes() for f in sorted(folder.iterdir()) if f.is_file() and f.name not in NOT_DATA}
        if digest_of_files(files) != sha256:
            raise gtpin.GtpinError("the dataset was changed since it was diagnosed", file=folder)
        outcome = json.loads((root / "diagnoses" / f"{case}.json").read_text(encoding="utf-8"))
        line = {
            "run": run,
            "case": case,
            "made": made_by(run, check),
            "sha256": sha256,
            "seconds": float(seconds[case]),
        }
        refused = {"refused": without_folder(outcome["error"] or "")}
        yield line | {"diagnosis": told(outcome["diagnosis"]) if outcome["diagnosis"] else refused}, files


def freeze(runs: Sequence[Path], frozen: Path, jobs: int) -> None:
    """Write the datasets of each run to a ZIP file, and what was answered to ``answers.jsonl``."""
    if (frozen / ANSWERS).exists():
        raise gtpin.GtpinError("answers are frozen here already", file=frozen, hint="choose another folder")
    if len({run.resolve().name for run in runs}) < len(runs):
        raise gtpin.GtpinError("two runs have the same name", hint="rename a folder")
    cases = {run: list(read_run(run)) for run in runs}
    frozen.mkdir(parents=True, exist_ok=True)
    lines = []
    for run, some in cases.items():
        with zipfile.ZipFile(frozen / f"{run.resolve().name}.zip", "w") as archive:
            for line, files in some:
                for name, content in files.items():  # with ZipInfo's own date: the same data give the same bytes
                    archive.writestr(zipfile.ZipInfo(f"{line['case']}/{name}"), content, zipfile.ZIP_LZMA)
        found = Parallel(n_jobs=jobs)(delayed(answered)(files, False) for _, files in some)
        lines += [json.dumps(line | answer) for (line, _), (answer, *_) in zip(some, found, strict=True)]
    (frozen / ANSWERS).write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"{len(lines)} cases frozen in {frozen}")


def unpacked(frozen: Path, line: Json) -> dict[str, bytes]:
    """The files of a frozen dataset."""
    file, start = frozen / f"{line['run']}.zip", f"{line['case']}/"
    if not file.is_file():
        hint = f"make them with `{line['made']}`, freeze them into another folder, and move {file.name} from there"
        raise gtpin.GtpinError("these datasets are not here", file=file, hint=hint)
    with zipfile.ZipFile(file) as archive:
        files = {n.removeprefix(start): archive.read(n) for n in archive.namelist() if n.startswith(start)}
    if digest_of_files(files) != line["sha256"]:
        raise gtpin.GtpinError(f"{line['case']} is not the dataset that was frozen", file=file)
    return files


def compare(frozen: Path, every: int, jobs: int) -> int:
    """Print what differs; gives the number of cases that do."""
    if not (frozen / ANSWERS).is_file():
        raise gtpin.GtpinError(f"no {ANSWERS}", file=frozen, hint="the command freeze makes it")
    lines = [json.loads(line) for line in (frozen / ANSWERS).read_text(encoding="utf-8").splitlines()][::every]
    count, cpu, clock = 0, 0.0, 0.0
    work = [delayed(answered)(unpacked(frozen, line), True) for line in lines]
    answers = Parallel(n_jobs=jobs, return_as="generator")(work)
    for line, (answer, *seconds) in zip(lines, answers, strict=True):
        found = list(differences(line, answer))
        count, cpu, clock = count + bool(found), cpu + seconds[0], clock + seconds[1]
        for text in found:
            print(f"{line['run']}/{line['case']}  {text}", flush=True)
    before = sum(line["seconds"] for line in lines)
    print(f"diagnosis: {cpu:.1f} s of CPU, {clock:.1f} s by the clock; when frozen {before:.1f} s by the clock")
    print(f"{count} of {len(lines)} cases differ")
    return count


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    one = commands.add_parser("freeze", help="collect datasets and answers from folders of gtpin blind")
    one.add_argument("runs", type=Path, nargs="+", metavar="DIR")
    one.add_argument("--output", "-o", type=Path, required=True, metavar="FROZEN")
    two = commands.add_parser("compare", help="answer again with the gtpin that is imported, and list what differs")
    two.add_argument("frozen", type=Path, metavar="FROZEN")
    two.add_argument("--every", type=int, default=1, metavar="K", help="take every K-th case")
    for command in (one, two):
        command.add_argument("--jobs", type=int, default=-1, metavar="N", help="number of processes; default: of cores")
    chosen = parser.parse_args()
    if getattr(chosen, "every", 1) < 1 or chosen.jobs == 0:
        parser.error("--every must be 1 or more, and --jobs not 0")
    try:
        if chosen.command == "compare":
            return int(compare(chosen.frozen, chosen.every, chosen.jobs) > 0)
        freeze(chosen.runs, chosen.output, chosen.jobs)
    except gtpin.GtpinError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
