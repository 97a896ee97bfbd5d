"""Tables of a checked machine, for people."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from motorctl.axis_units import units_of
from motorctl.cli.check_words import (
    Part,
    adaptation_words,
    dual_drive_words,
    effect_words,
    following_error_words,
    guard_words,
    homing_words,
    inverse,
    late_words,
    limit_words,
    number,
    quick_stop_words,
    recording_words,
    together_words,
    wiring_words,
)
from motorctl.cli.terminal import open_table
from motorctl.config.analysis import LoopMargins
from motorctl.config.filter_words import filter_words
from motorctl.config.loop_cases import MarginsAt
from motorctl.printable import one_line


def print_summary(console: Console, summary: Part) -> None:
    """Print all of what `motorctl.config.summarise` gives."""
    print_verdict(console, summary)
    console.print(_budgets(summary["drivers"]))
    for name, driver in summary["drivers"].items():
        console.print(f"  {escape(name)}: {escape(driver['arithmetic'])}", highlight=False)
    for name, axis in summary["axes"].items():
        console.print(_wiring(name, axis))
        console.print(_parameters(name, axis))
        console.print(_margins(name, axis))
        if axis["dual_drive"]:
            console.print(_skew_margins(name, axis["dual_drive"]))
        console.print(_conditions(name, axis))
    if summary["programs"]:
        for unit in dict.fromkeys(axis["position_unit"] for axis in summary["axes"].values()):
            console.print(_programs(summary["programs"], summary["axes"], unit))
    console.print(f"Logs: {escape(recording_words(summary['recording']))}", highlight=False)
    console.print(f"When an axis trips: {escape(together_words(summary['stop_together']))}")
    print_notes(console, summary)


def print_verdict(console: Console, summary: Part) -> None:
    """Print that a configuration is valid, and which machine it is."""
    period_us = summary["period_s"] * 1e6
    console.print(
        f"[bold green]valid[/bold green]: {escape(summary['name'])}, "
        f"{number(summary['rate_hz'])} Hz, Ts = {number(period_us)} us",
        highlight=False,
    )
    console.print(f"       {escape(summary['source'])}", style="dim", highlight=False)


def print_notes(console: Console, summary: Part) -> None:
    """Print foreign code, and what is worth a thought though it is valid."""
    if any(code["origin"] != "motorctl" for code in summary["code"]):
        print_code(console, summary)
    for note in summary["notes"]:
        line = Table.grid(padding=(0, 2, 0, 0))
        line.add_row("[yellow]note[/yellow]", escape(note))
        console.print(line)


def print_code(console: Console, told: Part) -> None:
    """Print which code a configuration would run, and what the service makes of it.

    The configuration may be a stranger's: its words may neither begin a line nor end one early.
    """
    lines = ["[bold]Code that this file runs[/bold]"]
    for code in told["code"]:
        package = f"{code['package']} {code['version']}" if code["package"] else "no package"
        allowed = "allowed" if code["allowed"] else "[yellow]not allowed[/yellow]"
        key, target = escape(one_line(code["key"])), escape(one_line(code["target"]))
        lines.append(f"  {key}: {target}, {allowed}")
        lines.append(f"    {escape(package)}: {escape(code['file'] or 'no such module')}")
    console.print("\n".join(lines), highlight=False, soft_wrap=True)
    file, trouble = told["allowed_code"]["file"], told["allowed_code"]["trouble"]
    if trouble:
        console.print(f"[yellow]note[/yellow]  {escape(trouble)}")
    if not all(code["allowed"] for code in told["code"]):
        said = f"what is not allowed has no line in {file}; the service refuses it, by hand it runs"
        console.print(f"[yellow]note[/yellow]  {escape(said)}", soft_wrap=True)


def _budgets(drivers: Part) -> Table:
    title = "Drivers and rate budgets"
    columns = ("driver", "type", "axes", "rate", "at most", "used", "delay", "no sample")
    table = open_table(title, columns)
    for name, driver in drivers.items():
        used = "?" if driver["used"] is None else f"{100 * driver['used']:.0f} %"
        most = driver["max_rate_hz"]
        table.add_row(
            name,
            driver["type"],
            ", ".join(driver["axes"]),
            f"{number(driver['rate_hz'])} Hz",
            "any" if most is None else f"{number(most)} Hz",
            used,
            f"{number(driver['delay_s'] * 1e3)} ms" if driver["delay_s"] else "none",
            late_words(driver["late"]),
        )
    return table


def _wiring(name: str, axis: Part) -> Table:
    limits, gains, encoder = axis["limits"], axis["gains"], axis["encoder"]
    error, homing = limits["following_error"], axis["homing"]
    dual = axis["dual_drive"]
    units = units_of(axis["kind"])
    rotary = "rotary, " if axis["kind"] == "rotary" else ""
    table = open_table(f"Axis {name}: {rotary}{wiring_words(axis)}", ("", ""))
    table.show_header = False
    for label, text in (
        (
            "encoder",
            f"{number(encoder['resolution_m'] * 1e6)} um a count, {encoder['counter_bits']} bits, "
            f"direction {encoder['direction']:+d}, offset {number(encoder['offset_m'])} m",
        ),
        ("limits", limit_words(limits)),
        ("following error", following_error_words(error)),
        (
            "stop",
            f"{number(limits['stop_acceleration_m_s2'])} m/s^2, "
            f"{number(limits['stop_jerk_m_s3'])} m/s^3",
        ),
        ("guards", guard_words(axis["guards"])),
        ("quick stop", quick_stop_words(axis["guards"])),
        (
            "gains",
            f"k1 {number(gains['k1_1_s'])} 1/s, ks {number(gains['ks_v_s_m'])} V*s/m, "
            f"gamma_d {number(gains['gamma_d'])} V/m, |d0| <= {number(gains['d_hat_max_v'])} V, "
            f"velocity {gains['velocity']}{_behind(gains['command_filter'])}",
        ),
        *((("dual drive", dual_drive_words(dual)),) if dual else ()),
        ("effects", effect_words(axis["effect_options"])),
        ("adaptation", adaptation_words(axis["adaptation"])),
        ("homing", homing_words(homing)),
        ("program", axis["program"] or "none: holds"),
    ):
        table.add_row(label, units.words(text) if label != "effects" else text)
    return table


def _behind(own: Part | None) -> str:
    return "" if own is None else f", behind a {filter_words(**own)}"


def _parameters(name: str, axis: Part) -> Table:
    columns = ("parameter", "symbol", "theta(0)", "lower", "upper", "unit", "Gamma(0)")
    table = open_table(f"Axis {name}: parameters", columns, numbers=True)
    for parameter, values in axis["parameters"].items():
        numbers = (number(values[key]) for key in ("initial", "lower", "upper"))
        covariance = number(values["covariance"])
        table.add_row(parameter, values["symbol"], *numbers, values["unit"], covariance)
    return table


def _skew_margins(name: str, dual: Part) -> Table:
    """Margins of the loop that holds the two ends together, without and with a sample more."""
    columns = ("delay ms", "crossover rad/s", "phase deg", "gain x", "gain /")
    table = open_table(f"Axis {name}: margins of the sampled skew loop", columns, numbers=True)
    for row in (LoopMargins(**row) for row in dual["skew_margins"]):
        shown = _shown(row) if row.stable else ("[red]unstable[/red]", "", "", "")
        table.add_row(number(row.delay_s * 1e3), *shown)
    return table


def _shown(row: LoopMargins) -> tuple[str, ...]:
    return (
        number(row.crossover_rad_s, 4),
        number(row.phase_margin_deg, 3),
        number(row.gain_margin, 3),
        number(inverse(row.gain_reduction), 3),
    )


def _margins(name: str, axis: Part) -> Table:
    title = f"Axis {name}: margins of the sampled loop, fast adaptation included"
    if lag_s := max(row["lag_s"] for row in axis["margins"]):
        title += f", behind a lag of {number(lag_s * 1e3)} ms"
    inertia = units_of(axis["kind"]).words("V*s^2/m")
    columns = ("inertia at", inertia, "delay ms", "crossover rad/s", "phase deg")
    table = open_table(title, (*columns, "gain x", "gain /"), numbers=True)
    for row in (MarginsAt(**row) for row in axis["margins"]):
        table.add_row(
            row.inertia_at,
            number(row.inertia),
            number(row.delay_s * 1e3),
            *(_shown(row) if row.stable else ("[red]unstable[/red]", "", "", "")),
        )
    return table


def _conditions(name: str, axis: Part) -> Table:
    robust, second = axis["robust_gain"], axis["assumption_2"]
    title = f"Axis {name}: conditions of the guarantee"
    table = open_table(title, ("condition", "where", "value", "needs", "verdict"))
    for key, where in (("at_initial", "theta(0)"), ("over_bounds", "all of the bounds")):
        condition = robust[key]
        decay = condition["decay_1_s"]
        verdict = "fails; sufficient, not necessary"
        if condition["satisfied"]:
            verdict = f"[green]holds[/green], lambda {number(decay)} 1/s"
        if not robust["applies"]:
            verdict = "does not apply behind a filter"
        table.add_row(
            "gain ks1",
            where,
            f"ks {number(robust['ks_v_s_m'])}",
            f"> {number(condition['required_ks1_v_s_m'], 4)} + k2",
            verdict,
        )
    needs = f">= {number(second['margin'])} over |u| <= {number(second['u_max_v'])} V"
    rows = [
        ("theta(0)", second["initial"]["slope"], second["initial"]["slope"] >= second["margin"])
    ]
    for corner in second["corners"]:
        where = ", ".join(f"{key} {number(value)}" for key, value in corner["theta"].items())
        rows.append((f"corner {where}", corner["slope"], corner["satisfied"]))
    for where, slope, satisfied in rows:
        verdict = "[green]holds[/green]" if satisfied else "kept away by the projection"
        table.add_row("Assumption 2", where, f"dv/du {number(slope, 3)}", needs, verdict)
    return table


def _programs(programs: Part, axes: Part, m: str) -> Table:
    """Draw those of all axes whose positions are in one unit."""
    columns = ("program", "axis", f"range {m}", f"v {m}/s", f"a {m}/s^2", f"jerk {m}/s^3")
    title = "Programs: peaks, and the command needed at theta(0)"
    table = open_table(title, (*columns, "needs V", "of V", "lasts s"), numbers=True)
    for name, program in programs.items():
        for axis, peaks in program["axes"].items():
            if axes[axis]["position_unit"] != m:
                continue
            low, high = peaks["range_m"]
            table.add_row(
                name,
                axis,
                f"{number(low)} to {number(high)}",
                number(peaks["max_velocity_m_s"], 4),
                number(peaks["max_acceleration_m_s2"], 4),
                number(peaks["max_jerk_m_s3"], 4),
                number(abs(peaks["command_v"]), 4),
                number(axes[axis]["limits"]["max_voltage_v"]),
                number(program["duration_s"], 4),
            )
    return table
