"""Many poses: memory in proportion to them, said beforehand, and the same result whatever is worked on together."""

import resource
import subprocess
import sys
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import gtpin
from gtpin import memory
from gtpin.bench.simulator.case import make_case
from gtpin.bench.simulator.simulate import simulate
from gtpin.calibration import robust_fit
from gtpin.calibration.calibrate import FIXED, PER_POSE
from gtpin.effects.active import with_effects
from gtpin.errors import GtpinError
from gtpin.kinematics import poses
from gtpin.noise.estimate import contrasts

linux = pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="limits of addresses are Linux's")


@pytest.fixture(scope="module")
def robot():
    return gtpin.load_robot("gantry_tau")


def peak(dataset):
    """Bytes that a calibration takes at its peak, besides the dataset."""
    tracemalloc.start()
    gtpin.calibrate(dataset)
    found = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found


@pytest.mark.slow
@pytest.mark.study
def test_memory_grows_by_no_more_than_what_is_said_for_each_pose(robot):
    many = simulate(robot, "gantry_tau", poses=40_000, seed=1).dataset
    few = many.take(np.arange(len(many) // 2))
    small, large = peak(few), peak(many)
    assert large - small <= PER_POSE * (len(many) - len(few))
    assert large <= FIXED + PER_POSE * len(many) <= 4.0 * large


@pytest.mark.slow
@linux
@pytest.mark.study
def test_what_is_said_beforehand_is_what_a_process_takes(robot, tmp_path):
    simulate(robot, "gantry_tau", poses=60_000, seed=2).dataset.write(tmp_path / "data")
    program = (
        "import resource, sys, gtpin, gtpin.calibration.calibrate\n"
        "data = gtpin.Dataset.read(sys.argv[1])\n"
        "before = int(open('/proc/self/statm').read().split()[1]) * resource.getpagesize()\n"
        "gtpin.calibrate(data)\n"
        # Not ru_maxrss, which a process inherits from the one that started it.
        "peak = 1024 * int(open('/proc/self/status').read().split('VmHWM:')[1].split()[0])\n"
        "print(peak - before, len(data))\n"
    )
    run = subprocess.run([sys.executable, "-c", program, tmp_path / "data"], capture_output=True, text=True, check=True)
    taken, rows = (int(word) for word in run.stdout.split())
    assert 0.5 <= (FIXED + PER_POSE * rows) / taken <= 2.0


@pytest.mark.slow
def test_a_fit_that_starts_from_a_part_ends_where_the_fit_of_all_ends(robot, monkeypatch):
    dataset = simulate(robot, "gantry_tau", poses=600, seed=3).dataset
    whole = gtpin.calibrate(dataset)
    monkeypatch.setattr(robust_fit, "PART", 250)
    found = gtpin.calibrate(dataset)
    assert found.iterations > whole.iterations  # those of the part are counted too
    # Both end where a step promises less than 1e-10 of the cost, which is half of some 3600 squares: 6e-4 of a sigma.
    assert np.abs((found.values - whole.values) / whole.sigma).max() < 1e-3
    np.testing.assert_allclose(found.sigma, whole.sigma, rtol=1e-4)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::gtpin.errors.GtpinWarning")
def test_nothing_depends_on_how_many_poses_are_worked_on_together(monkeypatch):
    dataset = make_case(4, effects=[("thermal_links", "arm")], noncentrality=800.0, poses=150).dataset
    whole = gtpin.diagnose(dataset)
    monkeypatch.setattr(poses, "CHUNK", 37)
    found = gtpin.diagnose(dataset)
    assert found.verdict == whole.verdict
    for one, two in ((found.baseline.model, whole.baseline.model), (found.model, whole.model)):
        np.testing.assert_allclose(one.geometry.values, two.geometry.values, atol=1e-11)
        a, b = (m.predict(dataset.q, dataset.covariates) for m in (one, two))
        np.testing.assert_allclose(a.minus(b), 0.0, atol=1e-11)


def test_effects_of_no_poses_are_no_poses(robot):
    kinematics = gtpin.Model(gtpin.Geometry.nominal(robot)).kinematics
    assert len(with_effects(kinematics, np.zeros((0, 3)), {}, ())) == 0


@pytest.mark.parametrize("most", [1, 2, 7])
def test_contrasts_are_each_visit_against_the_mean_of_those_before(most):
    rng = np.random.default_rng(most)
    visits = rng.permutation(np.repeat(np.arange(30), rng.integers(1, most + 1, 30)))
    values = rng.standard_normal((len(visits), 6))
    expected = []
    for pose in range(30):
        group = values[visits == pose]
        expected += [(group[:j].mean(axis=0) - group[j]) * np.sqrt(j / (j + 1.0)) for j in range(1, len(group))]
    found, rows = contrasts(visits, values)
    expected = np.array(expected).reshape(-1, 6)
    assert len(rows) == len(found)
    by_pose = np.argsort(visits[rows], kind="stable")
    np.testing.assert_allclose(found[by_pose], expected, atol=1e-12)


def of_system(tmp_path, monkeypatch, limit=None, free=None, most=None):
    """A system that says these things, and nothing else."""
    monkeypatch.setattr(memory, "PROC", tmp_path / "proc")
    monkeypatch.setattr(memory, "GROUPS", tmp_path / "group")
    (tmp_path / "proc" / "self").mkdir(parents=True)
    (tmp_path / "group").mkdir()
    if free is not None:
        (tmp_path / "proc" / "meminfo").write_text(f"MemTotal: 9 kB\nMemAvailable: {free // 1024} kB\nSwapFree: 0 kB\n")
    if most is not None:
        (tmp_path / "group" / "memory.max").write_text(most)
        (tmp_path / "group" / "memory.current").write_text("700000000")
        (tmp_path / "group" / "memory.stat").write_text("anon 5\ninactive_file 200000000\n")
    if limit is not None:
        (tmp_path / "proc" / "self" / "statm").write_text("1000 1 1 1 0 1 0")
        monkeypatch.setattr(resource, "getrlimit", lambda what: (limit, limit))


def test_the_least_of_all_limits_holds(tmp_path, monkeypatch):
    page = resource.getpagesize()
    of_system(tmp_path, monkeypatch, limit=2_000_000_000, free=1_500_000_000, most="1000000000")
    assert memory.available() == 1_000_000_000 - 700_000_000 + 200_000_000
    (tmp_path / "group" / "memory.max").write_text("max")
    assert memory.available() == pytest.approx(1_500_000_000, abs=1024)
    (tmp_path / "proc" / "meminfo").unlink()
    assert memory.available() == 2_000_000_000 - 1000 * page
    (tmp_path / "proc" / "self" / "statm").unlink()
    assert memory.available() == np.inf  # what says nothing limits nothing


def test_too_little_is_refused_with_what_is_needed_and_what_is_free(tmp_path, monkeypatch):
    of_system(tmp_path, monkeypatch, free=1_024_000_000)
    memory.require("this", 1.0e9)
    with pytest.raises(GtpinError, match=r"this needs about 1\.9 GB of memory, and 1\.0 GB is free; take fewer rows"):
        memory.require("this", 1.9e9)


@pytest.fixture(scope="module")
def data(robot, tmp_path_factory):
    folder = tmp_path_factory.mktemp("memory") / "data"
    simulate(robot, "gantry_tau", poses=300, seed=5).dataset.write(folder)
    return folder


@pytest.mark.slow
@linux
@pytest.mark.parametrize("command", ["calibrate", "diagnose"])
@pytest.mark.parametrize("room", [20, 60, 150, 300])
def test_a_limit_of_memory_ends_in_one_line_or_not_at_all(data, tmp_path, command, room):
    program = (
        "import resource, sys, gtpin.cli; gtpin.cli.app\n"
        "import gtpin.diagnosis.diagnose, gtpin.report.diagnosis\n"
        "taken = int(open('/proc/self/statm').read().split()[0]) * resource.getpagesize()\n"
        "limit = taken + int(sys.argv.pop(1)) * 1_000_000\n"
        "resource.setrlimit(resource.RLIMIT_AS, (limit, limit))\n"
        "gtpin.cli.main()\n"
    )
    arguments = [str(room), command, str(data), "-o", str(tmp_path / "out")]
    run = subprocess.run([sys.executable, "-c", program, *arguments], capture_output=True, text=True, check=False)
    assert run.returncode in ((2,) if room < 60 else (0, 2)), run.stderr
    if run.returncode == 2:
        assert run.stderr.count("\n") == 1
        assert "memory" in run.stderr
        assert not (tmp_path / "out").exists()
