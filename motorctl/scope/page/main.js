// The page: which logs there are, which stretch of time is in view, and who is told when it changes.

import { askJson, Refused } from "./ask.js";
import { showChoices } from "./choices.js";
import { element } from "./frame.js";
import { listen } from "./keyboard.js";
import { Live } from "./live.js";
import { hashOf, layoutOf } from "./layout.js";
import { fillReadout } from "./readout.js";
import { Sheet } from "./sheet.js";

const LEAST_ROWS = 4; // in view, zoomed in as far as it goes
const WAIT_MS = 40; // after the last movement, until the server is asked
const PLANES_WAIT_MS = 250;

let logs, layout, sheet, pointer = null, asking = null, waiting = null, planesAsked = "", beforeClick = null, live = null;

const offsets = () => logs.map((log) => (layout.align === "program" ? log.program_begins_s : 0));
const whole = () => {
  const shift = offsets();
  return [Math.min(...logs.map((log, k) => log.begin_s - shift[k])), Math.max(...logs.map((log, k) => log.end_s - shift[k]))];
};
const view = () => (layout.from === null ? whole() : [layout.from, layout.to]);

function say(words) {
  document.getElementById("notes").replaceChildren(...words.map((text) => element("li", { text })));
}

function setView(from, to) {
  const [low, high] = whole();
  const least = LEAST_ROWS / Math.max(...logs.map((log) => log.rate_hz));
  if (to - from < least) [from, to] = [(from + to - least) / 2, (from + to + least) / 2];
  if (to - from >= (high - low) * (1 - 1e-9)) [from, to] = [null, null];
  else if (from < low) [from, to] = [low, low + (to - from)];
  else if (to > high) [from, to] = [high - (to - from), high];
  layout = { ...layout, from, to };
  live?.follow(false);
  sheet.move(view());
  ask();
}

function ask() {
  document.body.dataset.settled = "false";
  history.replaceState(null, "", hashOf(layout));
  clearTimeout(waiting);
  waiting = setTimeout(answer, WAIT_MS);
}

async function answer() {
  asking?.abort();
  asking = new AbortController();
  const { signal } = asking;
  try {
    while (await sheet.fill(view(), offsets(), signal));
    await cursorsChanged(signal);
    const planes = JSON.stringify([view(), layout.panels, layout.axes, layout.magnified, layout.align, logs.map((log) => log.rows)]);
    if (planes !== planesAsked) {
      await new Promise((done) => { setTimeout(done, planesAsked ? PLANES_WAIT_MS : 0); });
      if (signal.aborted) return;
      await sheet.fillPlanes(view(), offsets(), layout.magnified, signal);
      planesAsked = planes;
    }
    document.body.dataset.settled = "true";
  } catch (error) {
    if (error.name === "AbortError") return;
    say([error instanceof Refused ? error.message : "motorctl scope does not answer: is it still running?"]);
    if (!(error instanceof Refused || error instanceof TypeError)) throw error;
  }
}

async function cursorsChanged(signal = undefined) {
  const cursors = { a: layout.a, b: layout.b };
  sheet.setCursors(cursors);
  const shift = offsets();
  const at = async (time, k) => (time === null ? {} : askJson("values", { log: k, at_s: time + shift[k] }, signal));
  const rows = await Promise.all(logs.map(async (log, k) => {
    const [a, b] = await Promise.all([at(cursors.a, k), at(cursors.b, k)]);
    const shown = (value, factor) => (value === null || value === undefined ? null : value * factor);
    const series = sheet.series(k).map((one) => ({
      label: one.label, unit: one.unit, a: shown(a[one.column], one.factor), b: shown(b[one.column], one.factor),
    }));
    return { name: log.name, rows: series };
  }));
  fillReadout(document.getElementById("readout"), cursors, rows);
}

function setCursor(name, time) {
  if (time === null) return;
  beforeClick = { a: layout.a, b: layout.b };
  layout = { ...layout, [name]: time };
  ask();
}

const hears = {
  zoom: setView,
  pan: (seconds) => { const [from, to] = view(); setView(from + seconds, to + seconds); },
  wheel: (time, delta) => zoomAbout(time, delta > 0 ? 1.25 : 0.8),
  twice: () => { layout = { ...layout, ...beforeClick }; setView(...whole()); },
  cursor: setCursor,
  pointer: (time) => { pointer = time; },
};

function zoomAbout(time, factor) {
  const [from, to] = view();
  setView(time - (time - from) * factor, time + (to - time) * factor);
}

/** What the live part of the page does with the rest of it. */
const livePage = () => ({
  log: logs[0],
  say,
  range: (begin, end) => { [logs[0].begin_s, logs[0].end_s] = [begin, end]; },
  async show(from, to, planes) {
    if (live?.following === false) return;
    asking?.abort();
    asking = new AbortController();
    layout = { ...layout, from, to };
    await sheet.fill([from, to], offsets(), asking.signal);
    if (planes) await sheet.fillPlanes([from, to], offsets(), layout.magnified, asking.signal);
    document.body.dataset.settled = "true";
  },
  hold(from, to, at) {
    layout = { ...layout, from, to, a: at };
    planesAsked = "";
    sheet.move(view());
    ask();
  },
  async anew() {
    await refresh();
    lay(layout);
  },
});

function lay(next) {
  layout = next;
  showChoices(logs, layout, lay);
  sheet.lay(layout);
  planesAsked = "";
  if (!live?.following) ask();
}

async function refresh() {
  const told = await askJson("logs");
  const changed = told.logs.some((log, k) => log.rows !== logs[k].rows || log.unfinished !== logs[k].unfinished);
  logs = told.logs;
  sheet.logs = logs;
  say(told.notes);
  if (changed) lay(layout);
}

async function begin() {
  const told = await askJson("logs");
  logs = told.logs;
  say(told.notes);
  document.title = `${logs.map((log) => log.name).join(", ")} – motorctl scope`;
  document.getElementById("all").hidden = logs[0].live;
  document.getElementById("align-choice").hidden = logs.length < 2;
  const axes = [...new Set(logs.flatMap((log) => log.axes))];
  const usual = { axes, align: logs.length > 1 ? "program" : "time" };
  sheet = new Sheet(document.getElementById("sheet"), logs, hears);
  lay(layoutOf(location.hash, usual));
  if (logs[0].live) live = new Live(livePage(), layout.span);
  document.getElementById("all").onclick = () => setView(...whole());
  const help = () => document.getElementById("keys").showModal();
  document.getElementById("help").onclick = help;
  listen({
    pan: (share) => { const [from, to] = view(); hears.pan(share * (to - from)); },
    zoom: (factor) => { const [from, to] = view(); zoomAbout(pointer !== null && pointer >= from && pointer <= to ? pointer : (from + to) / 2, factor); },
    all: () => setView(...whole()),
    cursor: (name) => setCursor(name, pointer),
    noCursors: () => { layout = { ...layout, a: null, b: null }; ask(); },
    refresh,
    follow: () => live?.follow(!live.following),
    help,
  });
  window.addEventListener("hashchange", () => lay(layoutOf(location.hash, usual)));
  let laid = null;
  window.addEventListener("resize", () => {
    clearTimeout(laid);
    laid = setTimeout(() => lay(layout), 150);
  });
}

begin().catch((error) => {
  say([error instanceof Refused ? error.message : "motorctl scope does not answer: is it still running?"]);
  if (!(error instanceof Refused || error instanceof TypeError)) throw error;
});
