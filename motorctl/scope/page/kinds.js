// Which panels there are, and what each draws.

import { scaled } from "./units.js";

export const COLOURS = ["#b5482e", "#1f5f8b", "#3f7f3f", "#7a5195", "#8a6d3b"];

/** Over time: series of each axis, or of the tick. `quantity` tells in which unit they are shown. */
export const TIME_PANELS = {
  position: {
    title: "position", quantity: "position",
    series: [["reference_m", "reference", true], ["position_m", "position", false]],
  },
  error: { title: "error", quantity: "error", series: [["following_error_m", "error", false]] },
  command: { title: "command", quantity: "command", series: [["command_v", "command", false]] },
  velocity: {
    title: "velocity", quantity: "velocity",
    series: [["reference_velocity_m_s", "reference", true], ["velocity_m_s", "velocity", false]],
  },
  estimates: { title: "estimates", theta: true },
  turnaround: {
    title: "turnaround", quantity: "time", deadline: true,
    tick: [["turnaround_s", "turnaround", "#1f5f8b"], ["lateness_s", "lateness", "#b5482e"]],
  },
};

/** One thing over another, of the stretch of time that is in view. */
export const PLANE_PANELS = {
  error_position: { title: "error over position", x: ["position_m", "position"], y: ["following_error_m", "error"] },
  phase: { title: "phase plane", x: ["position_m", "position"], y: ["velocity_m_s", "velocity"] },
  path: { title: "path", path: true },
  laps: { title: "error against the cycle", laps: ["following_error_m", "error"] },
  error_spectrum: { title: "error spectrum", column: ["following_error_m", "error"] },
  command_spectrum: { title: "command spectrum", column: ["command_v", "command"] },
  error_place: { title: "error spectrum over position", column: ["following_error_m", "error"], over: true },
  command_place: { title: "command spectrum over position", column: ["command_v", "command"], over: true },
};

export const PANELS = { ...TIME_PANELS, ...PLANE_PANELS };
export const USUAL = ["position", "error", "command"];

const THETA = "theta_hat_", D0 = "d0_hat_v";

/** Return the kinds of a named time panel: one, but of estimates one for each parameter of any log. */
export function timeKinds(name, logs, axes) {
  const kind = TIME_PANELS[name];
  if (!kind.theta) return [kind];
  const signals = logs.flatMap((log) => Object.keys(log.units).map((column) => column.split("."))
    .filter(([axis, signal]) => axes.includes(axis) && (signal?.startsWith(THETA) || signal === D0)).map(([, signal]) => signal));
  const found = [...new Set(signals)];
  const order = [...found.filter((signal) => signal !== D0), ...found.filter((signal) => signal === D0)];
  return order.map((signal) => {
    const word = signal === D0 ? "d0" : signal.slice(THETA.length);
    return { title: `estimate: ${word}`, series: [[signal, word, false]], bounds: true, parameter: word };
  });
}

/** Return the series of a time panel for a log: column, label, colour, dashed, factor, unit, bounds. */
export function seriesOf(panel, log, axes) {
  const found = [];
  const add = (column, label, colour, dashed) => {
    if (!(column in log.units)) return;
    const [factor, unit] = scaled(panel.quantity, log.units[column]);
    const bounds = panel.bounds ? log.bounds?.[column] : undefined;
    const words = panel.bounds && unit ? `${label} [${unit}]` : label;
    found.push({ column, label: words, colour, dashed, factor, unit, bounds });
  };
  for (const [column, label, colour] of panel.tick ?? []) add(column, label, colour, false);
  for (const axis of axes) {
    for (const [signal, label, dashed] of panel.series ?? []) {
      add(`${axis}.${signal}`, `${axis} ${label}`, colourOf(log, axis), dashed);
    }
  }
  return found;
}

export function colourOf(log, axis) {
  return COLOURS[Math.max(0, log.axes.indexOf(axis)) % COLOURS.length];
}
