"""Tables of a checked machine, for people."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import Console
from rich.markup import escape
from rich.table import Table

from motorctl.config.analysis import LoopMargins
from motorctl.config.summary import MarginsAt
from motorctl.printable import one_line

Part = Mapping[str, Any]


def print_summary(console: Console, summary: Part) -> None:
    """Print what `motorctl.config.summarise` gives."""
    period_us = summary["period_s"] * 1e6
    console.print(
        f"[bold]{escape(summary['name'])}[/bold]  {_number(summary['rate_hz'])} Hz, "
        f"Ts = {_number(period_us)} us  ({escape(summary['source'])})"
    )
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
        console.print(_programs(summary["programs"], summary["axes"]))
    console.print(f"Logs: {escape(_recording(summary['recording']))}", highlight=False)
    console.print(f"When an axis trips: {escape(_together(summary['stop_together']))}")
    if any(code["origin"] != "motorctl" for code in summary["code"]):
        print_code(console, summary)
    for note in summary["notes"]:
        console.print(f"[yellow]note[/yellow]  {escape(note)}")
    console.print("[green]valid[/green]")


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


def _recording(recording: Part) -> str:
    """Return in words how much is recorded, and how long it is kept."""
    told = [
        f"{recording['row_bytes']} bytes a row, {recording['recorded_mb_h']:,.0f} MB an hour while "
        f"recorded, about {recording['closed_mb_h']:,.0f} closed "
        f"({recording['closed_gb_year']:,.0f} GB a year)"
    ]
    if recording["while_off"] == "pause":
        told.append("none while every axis is off")
    if recording["log_h"] is not None:
        told.append(
            f"a new log after {_number(round(recording['log_h'] * 60, 1))} min or "
            f"{recording['largest_log_mb']:,.0f} MB"
        )
    kept, free = recording["kept_days"], recording["retention"]["min_free_mb"]
    if kept is not None:
        told.append(f"the oldest are removed after about {_number(round(kept, 1))} days")
    if free is not None:
        told.append(f"the oldest are removed while less than {free:,.0f} MB are free")
    if kept is None and free is None:
        told.append("none is ever removed")
    return "; ".join(told)


def _together(groups: list[list[str]] | None) -> str:
    """Return in words which axes stop when one trips."""
    if groups is None:
        return "the other axes of its running program are ramped down"
    if not groups:
        return "no other axis is stopped"
    return f"those of its group are ramped down: {'; '.join(' + '.join(g) for g in groups)}"


def _table(title: str, *columns: str, numbers: bool = True) -> Table:
    table = Table(title=title, title_justify="left", title_style="bold")
    for index, column in enumerate(columns):
        justify = "right" if numbers and index else "left"
        table.add_column(column, justify=justify, overflow="fold")  # type: ignore[arg-type]
    return table


def _budgets(drivers: Part) -> Table:
    title = "Drivers and rate budgets"
    columns = ("driver", "type", "axes", "rate", "at most", "used", "delay", "no sample")
    table = _table(title, *columns, numbers=False)
    for name, driver in drivers.items():
        used = "?" if driver["used"] is None else f"{100 * driver['used']:.0f} %"
        most = driver["max_rate_hz"]
        table.add_row(
            name,
            driver["type"],
            ", ".join(driver["axes"]),
            f"{_number(driver['rate_hz'])} Hz",
            "any" if most is None else f"{_number(most)} Hz",
            used,
            f"{_number(driver['delay_s'] * 1e3)} ms" if driver["delay_s"] else "none",
            _late(driver["late"]),
        )
    return table


def _late(late: Part) -> str:
    """Return in words what happens in ticks without a new sample, until the axes trip."""
    ticks = late["hold_ticks"]
    if not ticks:
        return "trip"
    meant = "predict" if late["predict"] else "hold"
    return f"{meant} {ticks} tick{'s' if ticks > 1 else ''}"


def _wiring(name: str, axis: Part) -> Table:
    limits, gains, encoder = axis["limits"], axis["gains"], axis["encoder"]
    error, homing = limits["following_error"], axis["homing"]
    low, high = limits["travel_m"]
    dual = axis["dual_drive"]
    channels = f"channels {axis['channel']} + {dual['channel']}" if dual else ""
    channels = channels or f"channel {axis['channel']}"
    title = f"Axis {name}: {axis['controller']} on {axis['driver']} {channels}"
    table = _table(title, "", "", numbers=False)
    table.show_header = False
    for label, text in (
        (
            "encoder",
            f"{_number(encoder['resolution_m'] * 1e6)} um a count, {encoder['counter_bits']} bits, "
            f"direction {encoder['direction']:+d}, offset {_number(encoder['offset_m'])} m",
        ),
        (
            "limits",
            f"travel {_number(low)} to {_number(high)} m, {_number(limits['max_velocity_m_s'])} "
            f"m/s, {_number(limits['max_acceleration_m_s2'])} m/s^2, "
            f"{_number(limits['max_jerk_m_s3'])} m/s^3, {_number(limits['max_voltage_v'])} V",
        ),
        (
            "following error",
            f"{_number(error['minimum_m'] * 1e3)} mm + {_number(error['per_velocity_s'] * 1e3)} "
            f"ms x |v| for {_number(error['filter_time_s'] * 1e3)} ms",
        ),
        (
            "stop",
            f"{_number(limits['stop_acceleration_m_s2'])} m/s^2, "
            f"{_number(limits['stop_jerk_m_s3'])} m/s^3",
        ),
        ("guards", _guards(axis["guards"])),
        ("quick stop", _quick_stops(axis["guards"])),
        (
            "gains",
            f"k1 {_number(gains['k1_1_s'])} 1/s, ks {_number(gains['ks_v_s_m'])} V*s/m, "
            f"gamma_d {_number(gains['gamma_d'])} V/m, |d0| <= {_number(gains['d_hat_max_v'])} V, "
            f"velocity {gains['velocity']}",
        ),
        *((("dual drive", _dual_drive(dual)),) if dual else ()),
        ("effects", _effects(axis["effect_options"])),
        ("adaptation", _adaptation(axis["adaptation"])),
        ("homing", _homing(homing)),
        ("program", axis["program"] or "none: holds"),
    ):
        table.add_row(label, text)
    return table


def _dual_drive(dual: Part) -> str:
    """Return in words how the two ends are held together, and squared."""
    skew, apart_m = dual["skew"], dual["max_out_of_square_m"]
    return (
        f"skew held by k1 {_number(skew['k1_1_s'])} 1/s, ks {_number(skew['ks_v_s_m'])} V*s/m, "
        f"gamma_d {_number(skew['gamma_d'])} V/m with at most {_number(skew['max_voltage_v'])} V, "
        f"squared at {_number(skew['squaring_velocity_m_s'] * 1e3)} mm/s"
        + (f", homed within {_number(apart_m * 1e3)} mm" if apart_m else "")
    )


def _guards(guards: Part) -> str:
    """Return in words how far each guard lets the axis go."""
    stuck, noise, saturation, thermal = (
        guards[name] for name in ("encoder_stuck", "encoder_noise", "saturation", "thermal")
    )
    told = []
    if stuck:
        told.append(f"encoder stuck over {_number(stuck['distance_m'] * 1e3)} mm")
    if noise:
        told.append(f"encoder noise {_number(noise['rms_m'] * 1e6)} um rms")
    if saturation:
        told.append(f"saturated for {_number(saturation['time_s'])} s")
    if thermal:
        told.append(
            f"I2t {_number(thermal['continuous_voltage_v'])} V over "
            f"{_number(thermal['time_constant_s'])} s"
        )
    if guards["skew"]:
        told.append(f"skew {_number(guards['skew']['limit_m'] * 1e3)} mm")
    frozen_s = guards["host_frozen"]["time_s"]
    if frozen_s is None:
        told.append("computer frozen: never, its time waits")
    else:
        told.append(f"computer frozen for {_number(frozen_s)} s")
    told.append(f"supervisor silent for {_number(guards['supervisor_lost']['time_s'])} s")
    return ", ".join(told)


def _quick_stops(guards: Part) -> str:
    """Return in words for which guards the axis is ramped down; the others let it go at once."""
    names = [name for name, guard in guards.items() if guard and guard["reaction"] == "quick_stop"]
    return f"on {', '.join(names) or 'nothing'}; else zero volts and disable"


def _effects(effects: Part) -> str:
    """List the effects, in the order of theta, each with the options that it runs with."""
    told = []
    for name, options in effects.items():
        given = (f"{key} {_option(value)}" for key, value in options.items() if value is not None)
        text = ", ".join(given)
        told.append(f"{name} ({text})" if text else name)
    return escape("; ".join(told))


def _option(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(_option(item) for item in value)
    return _number(value) if isinstance(value, int | float) else str(value)


def _adaptation(adaptation: Part) -> str:
    if not adaptation["enabled"]:
        return "off"
    return (
        f"alpha {_number(adaptation['forgetting_1_s'])} 1/s, nu "
        f"{_number(adaptation['normalisation'])}, filter {_number(adaptation['filter_rad_s'])} "
        f"rad/s, above {_number(adaptation['gate_velocity_m_s'])} m/s or "
        f"{_number(adaptation['gate_acceleration_m_s2'])} m/s^2, input delay "
        f"{_number(adaptation['input_delay_s'] * 1e3)} ms"
    )


def _homing(homing: Part) -> str:
    if homing["method"] == "absolute":
        return "absolute encoder"
    search = homing["search_velocity_m_s"]
    return (
        f"{homing['method']}: "
        + (f"search at {_number(search)} m/s, " if search else "")
        + f"latch at {_number(homing['latch_velocity_m_s'])} m/s, home at "
        f"{_number(homing['home_position_m'])} m, within {_number(homing['timeout_s'])} s"
    )


def _parameters(name: str, axis: Part) -> Table:
    columns = ("parameter", "symbol", "theta(0)", "lower", "upper", "unit", "Gamma(0)")
    table = _table(f"Axis {name}: parameters", *columns)
    for parameter, values in axis["parameters"].items():
        numbers = (_number(values[key]) for key in ("initial", "lower", "upper"))
        covariance = _number(values["covariance"])
        table.add_row(parameter, values["symbol"], *numbers, values["unit"], covariance)
    return table


def _skew_margins(name: str, dual: Part) -> Table:
    """Margins of the loop that holds the two ends together, without and with a sample more."""
    columns = ("delay ms", "crossover rad/s", "phase deg", "gain x", "gain /")
    table = _table(f"Axis {name}: margins of the sampled skew loop", *columns)
    for row in (LoopMargins(**row) for row in dual["skew_margins"]):
        shown = _shown(row) if row.stable else ("[red]unstable[/red]", "", "", "")
        table.add_row(_number(row.delay_s * 1e3), *shown)
    return table


def _shown(row: LoopMargins) -> tuple[str, ...]:
    return (
        _number(row.crossover_rad_s, 4),
        _number(row.phase_margin_deg, 3),
        _number(row.gain_margin, 3),
        _number(_inverse(row.gain_reduction), 3),
    )


def _margins(name: str, axis: Part) -> Table:
    title = f"Axis {name}: margins of the sampled loop, fast adaptation included"
    if lag_s := max(row["lag_s"] for row in axis["margins"]):
        title += f", behind a lag of {_number(lag_s * 1e3)} ms"
    columns = ("inertia at", "V*s^2/m", "delay ms", "crossover rad/s", "phase deg")
    table = _table(title, *columns, "gain x", "gain /")
    for row in (MarginsAt(**row) for row in axis["margins"]):
        table.add_row(
            row.inertia_at,
            _number(row.inertia),
            _number(row.delay_s * 1e3),
            *(_shown(row) if row.stable else ("[red]unstable[/red]", "", "", "")),
        )
    return table


def _conditions(name: str, axis: Part) -> Table:
    robust, second = axis["robust_gain"], axis["assumption_2"]
    title = f"Axis {name}: conditions of the guarantee"
    table = _table(title, "condition", "where", "value", "needs", "verdict", numbers=False)
    for key, where in (("at_initial", "theta(0)"), ("over_bounds", "all of the bounds")):
        condition = robust[key]
        decay = condition["decay_1_s"]
        verdict = "fails; sufficient, not necessary"
        if condition["satisfied"]:
            verdict = f"[green]holds[/green], lambda {_number(decay)} 1/s"
        table.add_row(
            "gain ks1",
            where,
            f"ks {_number(robust['ks_v_s_m'])}",
            f"> {_number(condition['required_ks1_v_s_m'], 4)} + k2",
            verdict,
        )
    needs = f">= {_number(second['margin'])} over |u| <= {_number(second['u_max_v'])} V"
    rows = [
        ("theta(0)", second["initial"]["slope"], second["initial"]["slope"] >= second["margin"])
    ]
    for corner in second["corners"]:
        where = ", ".join(f"{key} {_number(value)}" for key, value in corner["theta"].items())
        rows.append((f"corner {where}", corner["slope"], corner["satisfied"]))
    for where, slope, satisfied in rows:
        verdict = "[green]holds[/green]" if satisfied else "kept away by the projection"
        table.add_row("Assumption 2", where, f"dv/du {_number(slope, 3)}", needs, verdict)
    return table


def _programs(programs: Part, axes: Part) -> Table:
    columns = ("program", "axis", "range m", "v m/s", "a m/s^2", "jerk m/s^3", "needs V", "of V")
    table = _table("Programs: peaks, and the command needed at theta(0)", *columns, "lasts s")
    for name, program in programs.items():
        for axis, peaks in program["axes"].items():
            low, high = peaks["range_m"]
            table.add_row(
                f"{name} ({program['kind']})",
                axis,
                f"{_number(low)} to {_number(high)}",
                _number(peaks["max_velocity_m_s"], 4),
                _number(peaks["max_acceleration_m_s2"], 4),
                _number(peaks["max_jerk_m_s3"], 4),
                _number(abs(peaks["command_v"]), 4),
                _number(axes[axis]["limits"]["max_voltage_v"]),
                _number(program["duration_s"], 4),
            )
    return table


def _inverse(value: float | None) -> float | None:
    return 1.0 / value if value else None


def _number(value: float | None, digits: int = 6) -> str:
    if value is None:
        return "inf"
    rounded = round(value, 12)
    return f"{rounded or 0.0:.{digits}g}"
