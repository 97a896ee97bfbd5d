"""A day in the life of the service, step by step; each step says what it does and what it saw."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
from pathlib import Path

from rig import BUSES, DRIVES, MOTORCTL, Service, shell, wait_for, watched, write_files
from transcript import RESULT, STEPS, Step, run_all

LEFT, RIGHT = Service("left"), Service("right")
WORST_SECURITY = 3.0
STARVED_S = 8.0
MOVED = ("running", "idle")
"""Under way, or held at its end."""
STRANGER = "203.0.113.7"
"""A host of no private network; the machine itself, to whom it is given."""
HARMLESS = ("no isolated CPU",)
"""What a machine of two processors cannot have of real time."""
RECORDED: list[tuple[str, float]] = []
"""The log of each run that was struck, and the loop's time at the blow [s]."""


def kernel() -> str:
    """Debian boots with systemd on a PREEMPT_RT kernel."""
    assert Path("/sys/kernel/realtime").read_text().strip() == "1"
    state = shell(
        "systemctl is-system-running --wait; systemctl --failed --plain --no-legend || true"
    )
    version = shell("systemctl --version").split()[1]
    clock = Path("/sys/devices/system/clocksource/clocksource0/current_clocksource").read_text()
    return f"{os.uname().release}, clock {clock.strip()}, systemd {version}, {state}"


def wheel() -> str:
    """The wheels are installed, without a network, beside the libraries that they need."""
    shell("/opt/motorctl/bin/pip install --no-index --no-deps /job/wheels/*.whl")
    write_files()
    return f"motorctl {shell(f'{MOTORCTL} --version')} in /opt/motorctl"


def bad_configuration() -> str:
    """A configuration that is not valid is refused, and nothing is written."""
    Path("/job/bad.yaml").write_text(Path("/job/left.yaml").read_text().replace("C2", "C7"))
    said = shell(f"{MOTORCTL} service install left --config /job/bad.yaml", status=2)
    assert "controller" in said, said
    assert not Path("/etc/systemd/system/motorctl@.service").exists()
    return next(line for line in said.splitlines() if "controller" in line)


def installed() -> str:
    """`motorctl service install` sets up unit, user, group and device rules, and only once."""
    command = f"{MOTORCTL} service install left --config /job/left.yaml --json"
    first = json.loads(shell(command))
    assert {one["what"] for one in first["done"]} == {"written", "run"}, first
    second = json.loads(shell(command))
    assert {one["what"] for one in second["done"]} == {"unchanged", "run"}, second
    shell("id motorctl")
    wait_for("the rule", lambda: "root:motorctl 660" in _owner("/dev/cpu_dma_latency"), 20)
    files = [one["target"] for one in first["done"] if one["what"] == "written"]
    return f"{len(files)} files, user and group, {_owner('/dev/cpu_dma_latency')}"


def _owner(path: str) -> str:
    return shell(f"stat -c '%n %U:%G %a' {path}")


def bus() -> str:
    """A CAN interface that appears is set up by the device rules; the gantry is switched on."""
    shell("systemctl start device@vcan0")
    wait_for("the device", lambda: "ready:" in shell("journalctl -b -u device@vcan0 -o cat"))
    return shell("ip -o -br link show vcan0")


def hardened() -> str:
    """`systemd-analyze security` judges the unit as it is loaded."""
    said = shell("systemd-analyze security --no-pager motorctl@left.service")
    (RESULT / "security.txt").write_text(said)
    found = re.search(r"exposure level for \S+: ([\d.]+)", said)
    assert found, said
    assert float(found[1]) < WORST_SECURITY, said
    return f"exposure {found[1]}, limit {WORST_SECURITY:g}"


def started() -> str:
    """The service is ready when its loop ticks, with all of real time that there is."""
    shell("systemctl start motorctl@left")
    assert LEFT.ready()
    status = LEFT.ask("status")
    missing = [text for text in status["loop"]["degraded"] if not text.startswith(HARMLESS)]
    assert not missing, missing
    pid = status["loop"]["pid"]
    owner = shell(f"ps -o user=,cls=,rtprio= -p {pid}").split()
    assert owner[:2] == ["motorctl", "FF"], owner
    LEFT.insist_on_off()
    return f"loop: user {owner[0]}, SCHED_FIFO {owner[2]}; {LEFT.show('StatusText')}"


def fenced_in() -> str:
    """The daemon sees no home, writes nothing but its own, opens no disk, speaks to no stranger."""
    pid = LEFT.loop
    facts = Path(f"/proc/{pid}/status").read_text()
    for fact in (r"NoNewPrivs:\s1", r"Seccomp:\s2", r"CapBnd:\s0+\n"):
        assert re.search(fact, facts), facts
    # somebody at its place, with its files
    inside = f"nsenter -t {pid} -m"
    said = shell(f"{inside} setpriv --reuid=motorctl --regid=motorctl --init-groups ls /home", 2)
    assert "denied" in said, said
    said = shell(f"{inside} touch /etc/motorctl/x", status=1)
    assert "Read-only" in said, said
    # root itself among its processes: what the unit refuses to all of them
    group = shell(f"cut -d: -f3 /proc/{pid}/cgroup")
    join = f"echo $$ > /sys/fs/cgroup{group}/cgroup.procs"
    send = "echo x > /dev/udp/{}/4711"
    shell(f"ip address add {STRANGER} dev lo; {join}; {send.format('127.0.0.1')}")
    refused = ["head -c 1 /dev/vda", send.format(STRANGER)]
    ports = "TCP ports are not (this systemd has no BPF_FRAMEWORK)"
    if "+BPF_FRAMEWORK" in shell("systemctl --version"):
        refused.append("busybox nc -l -p 4711")
        ports = "TCP ports are"
    for doing in refused:
        said = shell(f"{join}; {doing}", status=1, timeout_s=60)
        assert "not permitted" in said, said
    listening = shell("ss --no-header --listening --tcp --numeric")
    assert not listening, listening
    return (
        "no capability, no new privileges, seccomp; /home, /etc, disks and public hosts are "
        f"closed, {ports}; nothing listens on TCP"
    )


def driven() -> str:
    """A member of the group starts, moves and stops an axis; a stranger is refused."""
    shell("useradd -m anna && usermod -aG motorctl anna")
    anna = "setpriv --reuid=anna --regid=anna --init-groups"
    wait_for("the device", LEFT.start)
    LEFT.ask("stop", axis="x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    shell(f"{anna} {MOTORCTL} start x --hold")
    shell(f"{anna} {MOTORCTL} move x 0.1 --velocity 0.05")
    wait_for("0.1 m", lambda: abs(LEFT.axis()["position_m"] - 0.1) < 1e-3, 60)
    at = LEFT.axis()["position_m"]
    shell(f"{anna} {MOTORCTL} stop x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    stranger = "setpriv --reuid=nobody --regid=nogroup --clear-groups"
    refused = shell(f"{stranger} {MOTORCTL} status || true")
    assert "ermission" in refused, refused
    return f"x at {1e3 * at:.3f} mm; nobody: {refused.splitlines()[-1]}"


def roles() -> str:
    """An observer looks and stops at once, an operator commands, a configurator writes the YAML."""
    install = f"{MOTORCTL} service install left --json"
    done = _done(f"{install} --operators gantry_operators")
    assert done["/etc/systemd/system/motorctl@.service"] == "updated", done
    _done(f"{install} --configurators gantry_configurators")
    assert set(_done(install).values()) == {"unchanged", "run"}  # and keeps them
    shell("useradd -m bert && usermod -aG motorctl bert")
    shell("useradd -m carl && usermod -aG motorctl,gantry_operators carl")
    shell("useradd -m dora && usermod -aG motorctl,gantry_configurators dora")
    bert, carl = (f"{_as(who)} {MOTORCTL}" for who in ("bert", "carl"))
    file = "/etc/motorctl/left.yaml"
    for who, may in (("bert", False), ("carl", False), ("dora", True)):
        assert _succeeds(f"{_as(who)} sh -c 'echo \"# by {who}\" >>{file}'") is may, who
        assert not _succeeds(f"{_as(who)} sh -c 'echo x >>/etc/motorctl/allowed_code'"), who
        assert not _succeeds(f"{_as(who)} rm -f {file}"), who
    assert Path(file).read_text().endswith("# by dora\n")
    assert "by bert" not in Path(file).read_text()
    shell("systemctl restart motorctl@left")
    assert LEFT.ready()
    shell(f"{bert} status")
    refused = shell(f"{bert} start x --hold", status=2)
    assert "only members of the group 'gantry_operators' may command" in refused, refused
    wait_for("the device", LEFT.start)
    LEFT.ask("stop", axis="x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    shell(f"{carl} start x --hold")
    stopped = shell(f"{bert} estop")
    wait_for("the emergency stop", lambda: LEFT.axis()["state"] == "fault", 60)
    shell(f"{bert} reset x", status=2)
    for axis in ("x", "y"):
        wait_for("standing still", lambda axis=axis: _succeeds(f"{carl} reset {axis}"), 60)
    shell(f"{install} --operators motorctl; systemctl restart motorctl@left")
    assert LEFT.ready()
    assert LEFT.ask("status")["axes"]["x"]["state"] == "off"
    return f"bert: {stopped}; {refused.splitlines()[-1]}"


def _as(who: str) -> str:
    """Return what runs a command with the rights of a user."""
    return f"setpriv --reuid={who} --regid={who} --init-groups"


def _done(command: str) -> dict[str, str]:
    """Run an installation and return what it did to each file."""
    return {one["target"]: one["what"] for one in json.loads(shell(command))["done"]}


def _succeeds(command: str) -> bool:
    try:
        shell(command)
    except RuntimeError:
        return False
    return True


def beside() -> str:
    """A second gantry lives beside the first, with its own socket, logs, state and CPU."""
    shell(f"{MOTORCTL} service install right --config /job/right.yaml")
    shell("systemctl start device@vcan1 motorctl@right")
    assert RIGHT.ready()
    assert LEFT.ready()
    cpus = [os.sched_getaffinity(service.loop) for service in (LEFT, RIGHT)]
    assert not cpus[0] & cpus[1], cpus
    for folder in ("/run", "/var/lib", "/var/log"):
        for name in BUSES:
            assert Path(f"{folder}/motorctl/{name}").is_dir(), (folder, name)
    said = shell(f"{MOTORCTL} status", status=2)
    for name in BUSES:
        assert f"{name}/motorctl.sock" in said, said
    RIGHT.begin_to_move()
    LEFT.begin_to_move()
    shell("systemctl stop motorctl@right")
    assert RIGHT.show("Result") == "success"
    assert LEFT.axis()["state"] in MOVED
    LEFT.ask("stop", axis="x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    shell("systemctl stop device@vcan1")
    return f"left on CPU {cpus[0]}, right on CPU {cpus[1]}; left moved on as right was stopped"


def removed() -> str:
    """`motorctl service remove` takes away the second gantry alone."""
    said = json.loads(shell(f"{MOTORCTL} service remove right --json"))
    kept = [one["target"] for one in said["done"] if one["what"] == "kept"]
    assert Path("/etc/motorctl/right.yaml").exists()
    assert LEFT.ready()
    assert list(Path("/var/log/motorctl/right").glob("*.parquet"))
    return f"kept: {', '.join(kept)}"


def canopen() -> str:
    """A third gantry is two drives on CANopen: its loop is killed, and their Fault reset."""
    drives = Service(DRIVES)
    shell(f"{MOTORCTL} service install {DRIVES} --config /job/{DRIVES}.yaml")
    shell(f"systemctl start device@{drives.bus} {drives.unit}")
    try:
        wait_for("the service", drives.ready)
        drives.begin_to_move()
        state, before = drives.axis()["drive_state"], drives.restarts
        assert state == "operation_enabled", state
        os.kill(drives.loop, signal.SIGKILL)
        took = drives.wait_until_anew(before)
        drives.insist_on_off()
        said = shell(f"journalctl -b -u {drives.unit} -o cat")
        told = [line for line in said.splitlines() if "(axis x) was in Fault and was reset" in line]
        assert len(told) == 1, said
        drives.begin_to_move()
        shell(f"systemctl stop {drives.unit}")
        assert drives.show("Result") == "success"
    finally:  # what it left would slow down all that comes after, and be found at the end
        shell(f"systemctl stop {drives.unit} device@{drives.bus}")
        shell(f"{MOTORCTL} service remove {DRIVES}")
    assert LEFT.ready()
    return f"{state}; anew in {took:.1f} s: {told[0]}"


def loop_killed() -> str:
    """The loop is killed in motion: the supervisor makes the outputs safe, systemd starts anew."""
    return _struck(LEFT.loop, signal.SIGKILL, within_s=2.0)


def supervisor_killed() -> str:
    """The supervisor is killed in motion: the loop ramps down by itself, systemd starts anew."""
    return _struck(LEFT.supervisor, signal.SIGKILL, within_s=5.0)


def loop_frozen() -> str:
    """The loop is frozen in motion: no tick is seen, so it is ended and started anew."""
    return _struck(LEFT.loop, signal.SIGSTOP, within_s=4.0)


def supervisor_frozen() -> str:
    """The supervisor is frozen: the loop ramps down, systemd's watchdog ends the service."""
    saw = _struck(LEFT.supervisor, signal.SIGSTOP, within_s=5.0)
    said = shell("journalctl -b -u motorctl@left -o cat | grep -i 'watchdog timeout'")
    return f"{saw}; {said.splitlines()[-1]}"


def _struck(pid: int, number: int, within_s: float) -> str:
    wait_for("the service", LEFT.ready)
    before = LEFT.restarts
    with watched(LEFT.bus) as seen:
        LEFT.begin_to_move()
        status, asked = LEFT.ask("status"), time.time()
        at = status["axes"]["x"]["position_m"]
        struck = time.time()
        os.kill(pid, number)
        loop_s = status["loop"]["time_s"] + struck - asked
        RECORDED.append((status["recording"]["file"], loop_s))
        took = LEFT.wait_until_anew(before)
    safe_s = seen.safe_after(struck)
    assert safe_s < within_s, f"safe after {safe_s:.2f} s, limit {within_s:g} s"
    LEFT.insist_on_off()
    travel = abs(LEFT.axis()["position_m"] - at)
    return (
        f"disabled after {safe_s:.2f} s, {1e3 * travel:.1f} mm on, ticks again after {took:.0f} s"
    )


def busy() -> str:
    """Eight busy programs beside it: the axis goes on, and nothing is started anew."""
    before = LEFT.restarts
    for k in range(8):
        shell(f"systemd-run --unit=busy{k} sh -c 'while :; do :; done'")
    LEFT.begin_to_move()
    skipped = LEFT.ask("status")["loop"]["skipped_periods"]
    time.sleep(STARVED_S)
    status = LEFT.ask("status")
    shell("systemctl stop 'busy*'")
    assert status["axes"]["x"]["state"] in MOVED, status["axes"]["x"]
    assert LEFT.restarts == before
    LEFT.ask("stop", axis="x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    late = status["loop"]["skipped_periods"] - skipped
    ticks = round(status["loop"]["rate_hz"] * STARVED_S)
    return f"{late} of about {ticks} periods skipped, no fault, no restart"


def starved() -> str:
    """A program of the highest priority takes the loop's CPU: safe, ended, started anew."""
    wait_for("the service", LEFT.ready)
    before = LEFT.restarts
    (cpu,) = os.sched_getaffinity(LEFT.loop)
    with watched(LEFT.bus) as seen:
        LEFT.begin_to_move()
        # It ends by itself: where the disk's interrupts belong to this CPU, nobody else can end it.
        endless = f"ulimit -t {2 * STARVED_S:.0f}; while :; do :; done"
        hog = f"taskset -c {cpu} chrt -f 99 sh -c '{endless}'"
        struck = time.time()
        shell(f"systemd-run --unit=hog {hog}")
        wait_for("the end of the loop", lambda: LEFT.show("ActiveState") != "active", 60)
        gone_s = time.time() - struck
        shell("systemctl stop hog || true")
        took = LEFT.wait_until_anew(before)
    safe_s = seen.safe_after(struck)
    assert safe_s < 5.0, f"safe after {safe_s:.2f} s"
    LEFT.insist_on_off()
    return (
        f"disabled after {safe_s:.2f} s, ended after {gone_s:.1f} s, ticks again after {took:.0f} s"
    )


def reloaded() -> str:
    """systemd reads its units anew while an axis moves: nobody notices."""
    pid = LEFT.supervisor
    LEFT.begin_to_move()
    shell("systemctl daemon-reload")
    time.sleep(6.0)  # more than the watchdog's time
    assert LEFT.supervisor == pid
    assert LEFT.axis()["state"] in MOVED
    LEFT.ask("stop", axis="x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    return "same processes, x still moves"


def restarted() -> str:
    """A restart in motion ramps down, closes the log, and takes the configuration as it is now."""
    path = Path("/etc/motorctl/left.yaml")
    path.write_text(path.read_text().replace('"max_velocity_m_s": 1.0', '"max_velocity_m_s": 0.9'))
    partial = Path(LEFT.ask("status")["recording"]["file"])
    shell("systemctl restart motorctl@left")
    assert LEFT.ready()
    LEFT.insist_on_off()
    assert partial.exists()
    assert not partial.with_name(f"{partial.name}.partial").exists()
    wait_for("the device", LEFT.start)
    try:
        LEFT.ask("move", axis="x", position_m=0.2, velocity_m_s=0.95)
    except RuntimeError as refused:
        said = str(refused)
    LEFT.ask("stop", axis="x")
    assert "0.9" in said, said
    return f"{partial.name} closed; {said}"


def misconfigured() -> str:
    """A configuration that was spoilt ends the service with one message, and it is not retried."""
    path = Path("/etc/motorctl/left.yaml")
    good = path.read_text()
    path.write_text(good.replace("C2", "C7"))
    shell("systemctl restart motorctl@left", status=1)
    time.sleep(5.0)
    facts = (LEFT.show("ActiveState"), LEFT.show("ExecMainStatus"), LEFT.restarts)
    assert facts == ("failed", "2", 0), facts
    told = shell("journalctl -b -u motorctl@left -o cat | grep controller | tail -n 1")
    path.write_text(good)
    shell("systemctl start motorctl@left")
    assert LEFT.ready()
    return told


def logs() -> str:
    """Logs of the runs that were struck are whole to within a second of the blow."""
    folder, open_now = Path("/var/log/motorctl/left"), LEFT.ask("status")["recording"]["file"]
    left_over = {f"{path}.partial" for path, _ in RECORDED}
    wait_for("the logs", lambda: not left_over & {str(path) for path in folder.iterdir()})
    missing_s, recovered = [], 0
    for path, until_s in RECORDED:
        assert path != open_now
        info = json.loads(shell(f"{MOTORCTL} log info {path} --json"))
        assert info["finished"], path
        recovered += bool(info["metadata"].get("recovered"))
        missing_s.append(until_s - info["end_s"])
    assert recovered, RECORDED
    assert max(missing_s) < 1.0, missing_s
    most = max(0.0, *missing_s)
    return f"{len(RECORDED)} runs, {recovered} recovered; at most {most:.2f} s before it are lost"


def rebooting() -> str:
    """Service and device are enabled, and the machine is started anew while an axis moves."""
    shell("systemctl enable motorctl@left device@vcan0")
    LEFT.begin_to_move()
    return f"boot {Path('/proc/sys/kernel/random/boot_id').read_text().strip()}"


def rebooted() -> str:
    """After the start the service is there by itself, off, and can be driven."""
    before = json.loads(STEPS.read_text().splitlines()[-1])["saw"]
    assert Path("/proc/sys/kernel/random/boot_id").read_text().strip() not in before
    wait_for("the service", LEFT.ready)
    up_s = float(Path("/proc/uptime").read_text().split()[0])
    LEFT.insist_on_off()
    LEFT.begin_to_move()
    LEFT.ask("stop", axis="x")
    wait_for("off", lambda: LEFT.axis()["state"] == "off", 60)
    last = shell("journalctl -b -1 -u motorctl@left -o cat | grep ' ticks, ' | tail -n 1")
    return f"ticks {up_s:.0f} s after power-on; of the run before: {last}"


def gone() -> str:
    """The last gantry is removed, and all that was installed with it; logs stay."""
    said = json.loads(shell(f"{MOTORCTL} service remove left --json"))
    found = shell("ls /etc/systemd/system /etc/udev/rules.d /etc/sysusers.d")
    assert not re.search(r"motorctl\S*\.(conf|rules)|motorctl@\.service$", found, re.M), found
    assert "inactive" in shell("systemctl is-active motorctl@left || true")
    assert Path("/etc/motorctl/left.yaml").exists()
    return f"removed {sum(one['what'] == 'removed' for one in said['done'])} files"


THE_STEPS: list[Step] = [
    *(kernel, wheel, bad_configuration, installed, bus, hardened, started, fenced_in, driven),
    *(roles, beside, removed, canopen, loop_killed, supervisor_killed, loop_frozen),
    *(supervisor_frozen, busy, starved, reloaded, restarted, misconfigured, logs),
    *(rebooting, rebooted, gone),
]
ALWAYS = {wheel, installed, bus, started}
"""Without them there is no service to try."""
BEFORE = {removed: beside, logs: supervisor_killed, rebooted: rebooting}
"""What a step finds left by another."""


def chosen() -> list[Step]:
    """Return the steps that were asked for, and those that they need; all of them by default."""
    asked = Path("/job/only")
    if not asked.exists():
        return THE_STEPS
    names = asked.read_text().split()
    wanted = {step for step in THE_STEPS if step.__name__ in names}
    wanted |= ALWAYS | {BEFORE[step] for step in wanted if step in BEFORE}
    return [step for step in THE_STEPS if step in wanted]


def main() -> int:
    """Run what is left; start the machine anew where a step asks for it."""
    reboot, steps = Path("/job/reboot"), chosen()
    second = reboot.exists()
    until = len(steps) if second or rebooting not in steps else steps.index(rebooting) + 1
    right = run_all(steps[:until])
    boot = 2 if second else 1
    units = "-u 'motorctl@*' -u 'device@*' -u systemd-udevd"
    shell(f"journalctl -b --no-pager {units} > {RESULT}/journal-{boot}.txt")
    if until < len(steps):
        reboot.touch()
        shell("sync; systemctl reboot")
        time.sleep(600)
    return 0 if right else 1


if __name__ == "__main__":
    sys.exit(main())
