// All panels of all logs: a column a log, a row a panel; they share the time that is in view.

import { askArrays, askJson } from "./ask.js";
import { Band } from "./band.js";
import { LEFT, RIGHT, element } from "./frame.js";
import { PLANE_PANELS, TIME_PANELS, seriesOf, timeKinds } from "./kinds.js";
import { PlanePanel } from "./plane_panel.js";
import { TimePanel } from "./time_panel.js";

const LEAST_PLANE_WIDTH = 420, GAP = 10;

export class Sheet {
  constructor(place, logs, hears) {
    this.place = place;
    this.logs = logs;
    this.hears = hears;
  }

  /** Lay the panels out anew. */
  lay(layout) {
    this.layout = layout;
    this.place.replaceChildren();
    this.place.style.gridTemplateColumns = `repeat(${this.logs.length}, minmax(0, 1fr))`;
    this.columns = this.logs.map((log, index) => ({ log, index, time: [], planes: [], band: new Band(log) }));
    for (const { log } of this.columns) this.place.append(logHead(log));
    const named = layout.panels.filter((name) => name in TIME_PANELS);
    const times = named.flatMap((name) => timeKinds(name, this.logs, layout.axes).map((kind) => [name, kind]));
    times.forEach(([name, kind], k) => {
      for (const column of this.columns) {
        const series = seriesOf(kind, column.log, layout.axes);
        const panel = new TimePanel(kind, column.log, series, k === times.length - 1, this.hears);
        panel.root.dataset.panel = name;
        if (kind.parameter) panel.root.dataset.parameter = kind.parameter;
        column.time.push(panel);
        this.place.append(panel.root);
      }
    });
    for (const column of this.columns) this.place.append(column.band.root);
    for (const column of this.columns) {
      const planes = element("div", { class: "planes" });
      for (const name of layout.panels.filter((each) => each in PLANE_PANELS)) {
        const kind = PLANE_PANELS[name];
        if (kind.path && !column.log.paths.length) continue;
        const axes = layout.axes.filter((axis) => column.log.axes.includes(axis));
        const panel = new PlanePanel(kind, column.log, column.index, axes);
        panel.root.dataset.panel = name;
        column.planes.push(panel);
        planes.append(panel.root);
      }
      this.place.append(planes);
    }
    this.drawn = false;
  }

  drawEmpty() {
    for (const column of this.columns) {
      column.width = this.place.clientWidth / this.logs.length - GAP - 16;
      for (const panel of column.time) panel.draw(panel.root.clientWidth);
    }
    this.drawn = true;
  }

  /** Show what is there already in a new view, before the server has answered. */
  move(view) {
    for (const column of this.columns) {
      for (const panel of column.time) panel.show(view);
      column.band.show(view);
    }
  }

  /** Ask for a view of each log and show it; return whether to ask again. */
  async fill(view, offsets, signal) {
    if (!this.drawn) this.drawEmpty();
    const coarse = await Promise.all(this.columns.map((column) => this.fillColumn(column, view, offsets[column.index], signal)));
    this.columns[0].time.forEach((_, k) => {
      const row = this.columns.map((column) => column.time[k]);
      const low = Math.min(...row.map((panel) => panel.own[0])), high = Math.max(...row.map((panel) => panel.own[1]));
      for (const panel of row) panel.show(view, low, high);
    });
    for (const column of this.columns) column.band.show(view);
    return coarse.includes(true);
  }

  async fillColumn(column, view, offset, signal) {
    const { log, index } = column;
    const stretch = { log: index, begin_s: view[0] + offset, end_s: view[1] + offset };
    const names = [...new Set(column.time.flatMap((panel) => panel.series.map((one) => one.column)))];
    const [told, states] = await Promise.all([
      askArrays("signals", { ...stretch, columns: names.join(","), pixels: this.pixels(column) }, signal),
      askJson("bands", stretch, signal),
    ]);
    const timeS = told.arrays.time_s.map((t) => t - offset);
    for (const panel of column.time) panel.take(timeS, told);
    column.band.take(states, offset);
    return told.coarse || states.coarse;
  }

  /** Ask for what is drawn of one thing over another. */
  async fillPlanes(view, offsets, magnified, signal) {
    for (const column of this.columns) {
      const own = view.map((t) => t + offsets[column.index]);
      await Promise.all(column.planes.map(async (panel) => {
        await panel.ask(own, magnified, signal);
        panel.draw(Math.max(LEAST_PLANE_WIDTH - 20, panel.root.clientWidth));
      }));
    }
  }

  setCursors(cursors) {
    for (const column of this.columns) for (const panel of column.time) panel.setCursors(cursors);
  }

  /** Return the series that the time panels show, for the readout. */
  series(index) {
    return this.columns[index].time.flatMap((panel) => panel.series);
  }

  pixels(column) {
    return column.time[0]?.pixels ?? Math.max(50, Math.round(column.width - LEFT - RIGHT));
  }
}

function logHead(log) {
  const told = [log.machine, ...Object.entries(log.controllers).map(([axis, c]) => `${axis} ${c}`)];
  const size = log.live ? `running now at ${log.rate_hz} Hz` : `${log.rows} rows at ${log.rate_hz} Hz`;
  const words = [...told.filter(Boolean), size, ...log.notes].join(" · ");
  return element("div", { class: "log-head" }, element("b", { text: `${log.name} ` }), element("span", { text: words }));
}

