"""The conformance suite itself: a good driver passes it, a broken one fails where it is broken."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from broken_drivers import BROKEN, rig_class
from tiers import few_of
from wire_driver import WireDriver, WireRig

from motorctl.hal.conformance import DriverConformance

HERE = Path(__file__).parent


def run_pytest(*arguments, folder=HERE):
    """Run pytest apart and give its result."""
    return subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *map(str, arguments)],
        cwd=folder, capture_output=True, text=True, timeout=250, check=False,
    )  # fmt: skip


class TestAGoodDriver(DriverConformance):
    @pytest.fixture
    def rig(self):
        with WireRig() as rig:
            yield rig


CHECKS = [name for name in dir(DriverConformance) if name.startswith("test_")]


def outcome(cls, check):
    """Run one check on a driver: whether it passed; a check that skips passes."""
    with rig_class(cls)() as rig:
        try:
            getattr(DriverConformance(), check)(rig)
        except pytest.skip.Exception:
            return True
        except (Exception, pytest.fail.Exception):
            return False
        return True


def test_a_good_driver_passes_where_broken_ones_fail():
    assert all(outcome(WireDriver, check) for check in CHECKS)


@pytest.mark.slow
@pytest.mark.parametrize("cls", few_of(BROKEN, 6), ids=lambda cls: cls.__name__)
def test_a_broken_driver_fails_exactly_where_it_is_broken(cls):
    failed = {check for check in CHECKS if not outcome(cls, check)}
    assert failed == BROKEN[cls]


def test_every_check_can_fail():
    assert set().union(*BROKEN.values()) == set(CHECKS)


@pytest.mark.slow
def test_a_check_whose_hook_is_missing_is_skipped_and_says_so(tmp_path):
    (tmp_path / "test_bare.py").write_text(
        "import pytest\n"
        "from wire_driver import WireRig\n"
        "from motorctl.hal.conformance import DriverConformance, Rig\n"
        "class Bare(WireRig):\n"
        "    restart = Rig.restart\n"
        "    move_to = Rig.move_to\n"
        "class TestBare(DriverConformance):\n"
        "    @pytest.fixture\n"
        "    def rig(self):\n"
        "        with Bare() as rig:\n"
        "            yield rig\n"
    )
    run = run_pytest(tmp_path, "-q", "-rs", f"--rootdir={tmp_path}", "-o", f"pythonpath={HERE}")
    assert run.returncode == 0, run.stdout
    assert "Bare offers no move_to, restart" in run.stdout
    assert "Bare offers no move_to" in run.stdout
    assert "passed" in run.stdout


@pytest.mark.slow
def test_a_suite_without_a_rig_fails_and_says_what_is_missing(tmp_path):
    (tmp_path / "test_none.py").write_text(
        "from motorctl.hal.conformance import DriverConformance\n"
        "class TestNone(DriverConformance):\n"
        "    pass\n"
    )
    run = run_pytest(tmp_path, "-q", f"--rootdir={tmp_path}")
    assert run.returncode == 1
    assert "TestNone needs a fixture `rig`" in run.stdout
    assert "passed" not in run.stdout


SUITE = ("-p", "motorctl.hal.conformance", "--pyargs", "motorctl.hal.conformance")


@pytest.mark.slow
def test_a_rig_named_on_the_command_line_is_checked(tmp_path):
    arguments = (*SUITE, "--driver-rig", "wire_driver:WireRig", "--driver-exchanges", "500", "-s")
    run = run_pytest(*arguments, "-o", f"pythonpath={HERE}", folder=tmp_path)
    assert run.returncode == 0, run.stdout
    assert "500 exchanges made memory grow" in run.stdout
    assert "failed" not in run.stdout


@pytest.mark.slow
def test_a_driver_named_on_the_command_line_is_checked_without_being_opened(tmp_path):
    target = ("--driver", "wire_driver:WireDriver", "-o", f"pythonpath={HERE}", "-rs")
    run = run_pytest(*SUITE, *target, "--driver-options", '{"port": "w"}', folder=tmp_path)
    assert run.returncode == 0, run.stdout
    assert "NamedRig offers no start" in run.stdout


@pytest.mark.slow
def test_a_driver_that_is_there_is_opened_but_never_sent_a_voltage(tmp_path):
    (tmp_path / "frightened.py").write_text(
        "from wire_driver import WIRES, Device, WireDriver\n"
        "WIRES['w'] = Device([32, 32])\n"
        "class Frightened(WireDriver):\n"
        "    def write(self, outputs):\n"
        "        assert not outputs.volts.any() and not outputs.enable.any()\n"
        "        super().write(outputs)\n"
    )
    target = ("--driver", "frightened:Frightened", "--driver-opens", "--driver-exchanges", "50")
    where = ("-o", f"pythonpath={HERE} {tmp_path}", "--driver-options", '{"port": "w"}')
    run = run_pytest(*SUITE, *target, *where, "-rs", folder=tmp_path)
    assert run.returncode == 0, run.stdout
    assert "OpenedRig offers no received" in run.stdout
    assert "OpenedRig offers no start" not in run.stdout


WIRE = ("--driver", "wire_driver:WireDriver")


MISTAKES = [
    ((), "either --driver-rig or --driver"),
    ((*WIRE, "--driver-rig", "wire_driver:WireRig"), "either --driver-rig or --driver"),
    (("--driver", "cna"), "--driver: unknown driver 'cna'; installed: "),
    (("--driver", "nowhere:Driver"), "module 'nowhere' is missing"),
    ((*WIRE, "--driver-options", '{"port": '), '--driver-options: found {"port": , no JSON'),
    ((*WIRE, "--driver-options", "[1]"), "--driver-options: found [1], should be an object"),
    (
        (*WIRE, "--driver-options", '{"prot": "w"}'),
        "--driver-options: port: Field required; prot: ",
    ),
    ((*WIRE, "--driver-rate-hz", "0"), "--driver-rate-hz should be greater than 0"),
    (("--driver-rig", "wire_driver:NoRig"), "--driver-rig wire_driver:NoRig: AttributeError"),
    (("--driver-rig", "wire_driver:WireDriver"), "is not a subclass of Rig"),
]
EACH = """
import contextlib, io, json, sys
import pytest
outcomes = []
for arguments in json.load(sys.stdin):
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = pytest.main(["-p", "no:cacheprovider", *arguments])
    outcomes.append((int(status), out.getvalue(), err.getvalue()))
json.dump(outcomes, sys.stdout)
"""


@pytest.fixture(scope="module")
def outcomes(tmp_path_factory):
    """Status, stdout and stderr for each of MISTAKES, in one interpreter: starting it is slow."""
    given = [[*SUITE, *arguments, "-o", f"pythonpath={HERE}"] for arguments, _ in MISTAKES]
    done = subprocess.run(
        [sys.executable, "-c", EACH], input=json.dumps(given), cwd=tmp_path_factory.mktemp("none"),
        capture_output=True, text=True, timeout=250, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)


@pytest.mark.parametrize("number", range(len(MISTAKES)), ids=lambda i: MISTAKES[i][1])
def test_a_mistake_on_the_command_line_is_one_usage_error(outcomes, number):
    status, said, errors = outcomes[number]
    assert status == pytest.ExitCode.USAGE_ERROR
    lines = [line for line in errors.splitlines() if line]
    assert len(lines) == 1
    assert MISTAKES[number][1] in lines[0]
    assert "Traceback" not in said


@pytest.mark.slow
def test_the_suite_without_its_plug_in_says_so_once(tmp_path):
    run = run_pytest(*SUITE[2:], folder=tmp_path)
    assert run.returncode == pytest.ExitCode.USAGE_ERROR
    assert run.stderr.count("give -p motorctl.hal.conformance") == 1
