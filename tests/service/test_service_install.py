"""`motorctl service install | remove` into a folder that will be a system."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typer
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from motorctl.cli import service
from motorctl.config import shipped_config
from motorctl.errors import MotorctlError
from motorctl.service import Request, install, remove

UNIT = "etc/systemd/system/motorctl@.service"
FOLDERS = ("etc/systemd/system", "etc/udev/rules.d", "etc/sysusers.d", "etc/motorctl", "opt")


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """Return the folder of a system that knows nothing of motorctl."""
    for name in FOLDERS:
        (tmp_path / "root" / name).mkdir(parents=True)
    (tmp_path / "root/etc/motorctl/left.yaml").write_text(shipped_config("small_stage").read_text())
    (tmp_path / "root/etc/udev/rules.d/99-other.rules").write_text("# of somebody else\n")
    return tmp_path / "root"


def tree(root: Path) -> dict[str, str]:
    return {
        str(path.relative_to(root)): path.read_text() if path.is_file() else ""
        for path in sorted(root.rglob("*"))
    }


def run(*arguments: object) -> str:
    app = typer.Typer()
    service.register(app)
    app.command("other")(lambda: None)  # so that `service` stays a word of the command line
    result = CliRunner().invoke(app, ["service", *map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.output


def refused(*arguments: object) -> str:
    """Return the one message of a refusal, which has exit status 2."""
    with pytest.raises(MotorctlError) as caught:
        run(*arguments)
    assert caught.value.exit_status == 2
    return str(caught.value)


def did(output: str) -> dict[str, str]:
    return {one["target"]: one["what"] for one in json.loads(output)["done"]}


def test_everything_of_a_gantry_is_written_and_told(root: Path) -> None:
    before = set(tree(root))
    done = did(run("install", "left", "--root", root, "--json"))
    new = {f"/{name}" for name in set(tree(root)) - before}
    assert {path for path, what in done.items() if what == "written"} == new
    assert new == {
        f"/{UNIT}",
        "/etc/sysusers.d/motorctl.conf",
        "/etc/udev/rules.d/60-motorctl.rules",
        "/etc/udev/rules.d/61-motorctl-left.rules",
    }
    said = run("install", "left", "--root", root)
    for path in new:
        assert re.search(rf"^unchanged +{re.escape(path)}$", said, re.MULTILINE)
    assert "motorctl@left.service" in said.partition("next:")[2]


def test_user_and_group_are_those_that_were_asked_for_in_every_file(root: Path) -> None:
    run("install", "left", "--root", root, "--user", "axes", "--group", "operators")
    unit = (root / UNIT).read_text()
    assert re.findall(r"^(?:User|Group)=.*$", unit, re.MULTILINE) == [
        "User=axes",
        "Group=operators",
    ]
    users = (root / "etc/sysusers.d/motorctl.conf").read_text()
    assert re.search("^u axes ", users, re.MULTILINE)
    assert re.search("^g operators ", users, re.MULTILINE)
    rules = (root / "etc/udev/rules.d/60-motorctl.rules").read_text()
    assert 'KERNEL=="cpu_dma_latency", GROUP="operators"' in rules
    # another gantry, and an update, keep them
    run("install", "left", "--root", root)
    assert (root / UNIT).read_text() == unit


def exec_start(root: Path) -> list[str]:
    """Return the words of the one command that the installed unit starts."""
    (line,) = re.findall(r"^ExecStart=(.*)$", (root / UNIT).read_text(), re.MULTILINE)
    return line.split()


def test_operators_stand_in_the_unit_and_are_made_and_kept(root: Path) -> None:
    run("install", "left", "--root", root)
    plain = exec_start(root)
    assert "--operators" not in plain
    run("install", "left", "--root", root, "--operators", "gantry_operators")
    assert exec_start(root) == [*plain, "--operators", "gantry_operators"]
    users = (root / "etc/sysusers.d/motorctl.conf").read_text()
    assert re.findall("^g (.*) -$", users, re.MULTILINE) == [
        "motorctl",
        "dialout",
        "gantry_operators",
    ]
    # an update and another gantry keep them, and another group of the socket does, too
    (root / "etc/motorctl/right.yaml").write_text(shipped_config("small_stage").read_text())
    assert set(did(run("install", "left", "--root", root, "--json")).values()) == {"unchanged"}
    run("install", "right", "--root", root, "--group", "axes")
    assert exec_start(root)[-2:] == ["--operators", "gantry_operators"]
    assert re.search(
        "^g gantry_operators -$", (root / "etc/sysusers.d/motorctl.conf").read_text(), re.M
    )


def test_other_operators_take_the_place_of_those_before(root: Path) -> None:
    run("install", "left", "--root", root, "--operators", "day")
    run("install", "left", "--root", root, "--operators", "night")
    assert exec_start(root)[-2:] == ["--operators", "night"]
    assert "day" not in (root / "etc/sysusers.d/motorctl.conf").read_text()


def test_operators_that_are_the_sockets_own_group_are_all_its_members_again(root: Path) -> None:
    run("install", "left", "--root", root)
    before = tree(root)
    run("install", "left", "--root", root, "--operators", "gantry_operators")
    assert tree(root) != before
    run("install", "left", "--root", root, "--operators", "motorctl")
    assert tree(root) == before


def configuration_rule(root: Path, name: str) -> str:
    """Return the one line by which a gantry's configuration gets its group."""
    (line,) = re.findall(
        "^z .*$", (root / f"etc/tmpfiles.d/motorctl-{name}.conf").read_text(), re.MULTILINE
    )
    return str(line)


def test_configurators_get_one_gantrys_configuration_and_keep_it(root: Path) -> None:
    (root / "etc/motorctl/right.yaml").write_text(shipped_config("small_stage").read_text())
    run("install", "right", "--root", root)
    before = set(tree(root))
    run("install", "left", "--root", root, "--configurators", "tuners")
    assert configuration_rule(root, "left") == "z /etc/motorctl/left.yaml 0664 root tuners"
    users = (root / "etc/sysusers.d/motorctl-left.conf").read_text()
    assert re.findall("^g .*$", users, re.MULTILINE) == ["g tuners -"]
    assert {name for name in set(tree(root)) - before if "right" in name} == set()
    run("install", "right", "--root", root)
    assert set(did(run("install", "left", "--root", root, "--json")).values()) == {"unchanged"}
    # and root takes it back, for good
    run("install", "left", "--root", root, "--configurators", "root")
    assert configuration_rule(root, "left") == "z /etc/motorctl/left.yaml 0644 root root"
    assert set(did(run("install", "left", "--root", root, "--json")).values()) == {"unchanged"}
    assert "tuners" not in (root / "etc/sysusers.d/motorctl-left.conf").read_text()


def test_a_gantry_that_is_removed_leaves_no_rule_of_its_configuration(root: Path) -> None:
    run("install", "left", "--root", root)
    run("remove", "left", "--root", root)
    before = {name for name in tree(root) if "left" in name}
    run("install", "left", "--root", root, "--configurators", "tuners")
    config = root / "etc/motorctl/left.yaml"
    config.chmod(0o664)  # as the rule makes it
    told = run("remove", "left", "--root", root)
    assert {name for name in tree(root) if "left" in name} == before
    assert config.stat().st_mode & 0o777 == 0o644
    assert re.search(r"updated +/etc/motorctl/left.yaml +\(nobody but root may change it\)", told)
    assert re.search(r"kept +group tuners", told)


def test_what_is_next_tells_who_may_command(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = root / "etc/motorctl/left.yaml"
    there, exists = "/opt/motorctl", Path.exists
    monkeypatch.setattr(sys, "prefix", there)
    monkeypatch.setattr(Path, "exists", lambda path: str(path).startswith(there) or exists(path))
    groups = ("--operators", "ops", "--configurators", "tuners")
    said = run("install", "left", "--config", config, "--dry-run", *groups)
    assert re.search(r"usermod -aG tuners USER +configurators: may change /etc/motorctl/left", said)
    assert re.search(r"usermod -aG motorctl,ops USER +operators: may command", said)
    assert re.search(r"usermod -aG motorctl USER +observers: may look, and stop", said)


@pytest.mark.slow
def test_can_interfaces_come_up_with_the_bit_rates_of_the_configuration(root: Path) -> None:
    config = yaml.safe_load(shipped_config("can_gantry").read_text())
    bus = {"interface": "socketcan", "channel": "can3", "bitrate": 500000}
    config["drivers"]["gantry"] |= bus | {"fd": True, "data_bitrate": 2000000}
    (root / "etc/motorctl/left.yaml").write_text(yaml.safe_dump(config))
    run("install", "left", "--root", root)
    (rule,) = (root / "etc/udev/rules.d/61-motorctl-left.rules").read_text().splitlines()[1:]
    assert rule == (
        'ACTION=="add", SUBSYSTEM=="net", KERNEL=="can3", RUN+="/sbin/ip link set can3 up '
        'type can bitrate 500000 restart-ms 100 dbitrate 2000000 fd on"'
    )


def test_a_name_that_would_be_a_command_of_root_is_refused(root: Path) -> None:
    config = yaml.safe_load(shipped_config("can_gantry").read_text())
    config["drivers"]["gantry"] |= {"interface": "socketcan", "channel": 'can0", RUN+="/bin/sh'}
    (root / "etc/motorctl/left.yaml").write_text(yaml.safe_dump(config))
    before = tree(root)
    assert "network interface" in refused("install", "left", "--root", root)
    assert tree(root) == before


NAMES = st.lists(st.sampled_from(["left", "right", "a-b", "a.b"]), min_size=1, unique=True)


@pytest.mark.slow
@settings(max_examples=5)
@given(names=NAMES, again=st.integers(0, 3), removed=st.randoms(use_true_random=False))
def test_installing_twice_changes_nothing_and_removing_all_restores_the_tree(
    tmp_path_factory: pytest.TempPathFactory, names: list[str], again: int, removed: object
) -> None:
    root = tmp_path_factory.mktemp("root")
    for folder in FOLDERS:
        (root / folder).mkdir(parents=True)
    for name in names:
        text = shipped_config("small_stage").read_text()
        (root / f"etc/motorctl/{name}.yaml").write_text(text)
    before = tree(root)
    for name in names:
        install(Request(name, root=root))
    after = tree(root)
    outcome = install(Request(names[again % len(names)], root=root))
    assert {one.what for one in outcome.done} == {"unchanged"}
    assert tree(root) == after
    order = list(names)
    removed.shuffle(order)  # type: ignore[attr-defined]
    for number, name in enumerate(order, 1):
        remove(name, root)
        assert (root / UNIT).exists() is (number < len(order))
        assert {one.what for one in remove(name, root).done} == {"unchanged"}
    assert tree(root) == before


def test_a_configuration_that_is_named_is_copied_and_stays_when_all_is_removed(
    root: Path, tmp_path: Path
) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_text(shipped_config("published_gantry").read_text())
    run("install", "right", "--config", mine, "--root", root)
    there = root / "etc/motorctl/right.yaml"
    assert there.read_text() == mine.read_text()
    assert there.stat().st_mode & 0o777 == 0o644
    said = run("remove", "right", "--root", root)
    assert there.exists()
    assert re.search(r"^kept +/etc/motorctl  \(configurations\)$", said, re.MULTILINE)


def test_logs_and_what_was_learned_stay_and_are_told(root: Path) -> None:
    run("install", "left", "--root", root)
    for folder in ("log", "lib"):
        (root / f"var/{folder}/motorctl/left").mkdir(parents=True)
    done = did(run("remove", "left", "--root", root, "--json"))
    assert done["/var/log/motorctl"] == done["/var/lib/motorctl"] == "kept"
    assert (root / "var/log/motorctl/left").is_dir()


def test_a_dry_run_tells_all_of_it_and_changes_nothing(root: Path) -> None:
    before = tree(root)
    planned = did(run("install", "left", "--root", root, "--dry-run", "--json"))
    assert tree(root) == before
    assert did(run("install", "left", "--root", root, "--json")) == planned
    installed = tree(root)
    planned = did(run("remove", "left", "--root", root, "--dry-run", "--json"))
    assert tree(root) == installed
    assert did(run("remove", "left", "--root", root, "--json")) == planned


def test_an_older_file_of_ours_is_updated(root: Path) -> None:
    run("install", "left", "--root", root)
    unit = root / UNIT
    good = unit.read_text()
    unit.write_text(good.replace("WatchdogSec=5", "WatchdogSec=50"))
    assert did(run("install", "left", "--root", root, "--json"))[f"/{UNIT}"] == "updated"
    assert unit.read_text() == good


def test_a_file_of_others_is_in_the_way_and_is_left_alone(root: Path) -> None:
    (root / UNIT).write_text("[Service]\nExecStart=/bin/mine\n")
    before = tree(root)
    said = refused("install", "left", "--root", root)
    assert str(root / UNIT) in said
    assert "\n" not in said
    assert tree(root) == before


def test_another_configuration_in_the_way_is_left_alone(root: Path) -> None:
    config = shipped_config("published_gantry")
    said = refused("install", "left", "--config", config, "--root", root)
    assert "left.yaml is there and is not" in said


def test_a_bad_configuration_is_refused_with_all_its_problems(root: Path) -> None:
    path = root / "etc/motorctl/left.yaml"
    path.write_text(path.read_text().replace("rate_hz: 5000", "rate_hz: -1\nrat: 2"))
    before = tree(root)
    said = refused("install", "left", "--root", root)
    assert "rate_hz" in said
    assert "rat:" in said
    assert tree(root) == before


def test_code_that_a_configuration_names_needs_a_line_of_the_administrator(root: Path) -> None:
    path = root / "etc/motorctl/left.yaml"
    path.write_text(path.read_text().replace("type: sim", "type: 'config_bench:BenchDriver'"))
    before = tree(root)
    said = refused("install", "left", "--root", root)
    list_of_code = root / "etc/motorctl/allowed_code"
    assert f"adds a line 'config_bench' to {list_of_code}" in said
    assert tree(root) == before
    list_of_code.write_text("config_bench\n")
    # Now it is imported, and tells that it has no such options.
    assert "not allowed" not in refused("install", "left", "--root", root)


def test_files_that_a_configuration_names_have_to_lie_beside_its_new_place(
    root: Path, tmp_path: Path
) -> None:
    config = yaml.safe_load(shipped_config("small_stage").read_text())
    name, axis = "recorded", next(iter(config["axes"]))
    config["programs"][name] = {"kind": "points", "axes": [axis], "file": "points.csv"}
    mine = tmp_path / "mine.yaml"
    mine.write_text(yaml.safe_dump(config))
    times = np.linspace(0, 1, 101)
    lines = [f"{t},{0.01 * (1 - np.cos(2 * np.pi * t)):.9f}" for t in times]
    (tmp_path / "points.csv").write_text("\n".join([f"time_s,{axis}_m", *lines]))
    said = refused("install", "right", "--config", mine, "--root", root)
    assert "is valid where it is, but not in" in said
    assert str(root / "etc/motorctl/points.csv") in said
    assert not (root / "etc/motorctl/right.yaml").exists()
    shutil.copy(tmp_path / "points.csv", root / "etc/motorctl")
    run("install", "right", "--config", mine, "--root", root)


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (("install", "two words"), "name of a gantry 'two words'"),
        (("install", "../etc"), "name of a gantry"),
        (("install", "left", "--user", "root"), "needs no rights of root"),
        (("install", "left", "--group", "my group"), "--group 'my group'"),
        (("install", "left", "--operators", "a,b"), "--operators 'a,b'"),
        (("install", "left", "--operators", "root"), "root may command all the same"),
        (("install", "left", "--configurators", "a b"), "--configurators 'a b'"),
        (("install", "left", "--configurators", "motorctl"), "is the socket's group"),
        (("install", "right"), "right.yaml is not there: name the configuration with --config"),
        (("install", "right", "--config", "nowhere.yaml"), "nowhere.yaml: there is no such file"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    root: Path, arguments: tuple[str, ...], told: str
) -> None:
    before = tree(root)
    said = refused(*arguments, "--root", root)
    assert told in said
    assert "\n" not in said
    assert tree(root) == before


def test_without_root_the_running_system_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    assert "installing a service takes root" in refused("install", "left")
    assert "removing a service takes root" in refused("remove", "left")


def test_without_systemd_the_running_system_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    monkeypatch.setattr(Path, "is_dir", lambda path: str(path) != "/run/systemd/system")
    assert "systemd does not run this computer; --root" in refused("install", "left")


def test_a_motorctl_that_the_service_could_not_see_is_refused(
    root: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "prefix", "/home/me/.venv")
    monkeypatch.setattr(Path, "exists", lambda _: True)
    config = root / "etc/motorctl/left.yaml"
    said = refused("install", "left", "--config", config, "--dry-run")
    assert "/home/me/.venv/bin/motorctl: a service cannot use it" in said
    assert "/opt/motorctl" in said


def test_systemd_reads_what_was_installed(root: Path) -> None:
    if shutil.which("systemd-sysusers") is None:
        pytest.skip("systemd is not installed")
    run(
        *("install", "left", "--root", root, "--user", "axes"),
        *("--group", "operators", "--operators", "drivers", "--configurators", "tuners"),
    )
    done = subprocess.run(
        ["systemd-sysusers", f"--root={root}"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "axes:" in (root / "etc/passwd").read_text()
    groups = (root / "etc/group").read_text()
    assert "operators:" in groups
    assert "drivers:" in groups
    assert "dialout:" in groups
    assert "tuners:" in groups
    made = subprocess.run(
        ["systemd-tmpfiles", "--create", f"--root={root}"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert made.returncode == 0, made.stderr
    if os.geteuid() == 0:
        there = (root / "etc/motorctl/left.yaml").stat()
        assert there.st_mode & 0o777 == 0o664
        assert f"tuners:x:{there.st_gid}:" in groups
