// Columns over time: one plot, zoomed by dragging, with the two cursors in it.

import { LEFT, PADDING, RIGHT, axes, element, extent, head, tickWords, widened } from "./frame.js";
import { shown } from "./units.js";

const HEIGHT = 150, HEIGHT_OF_ESTIMATES = 96;
const CURSOR_COLOURS = { a: "#b8860b", b: "#7a5195" };

export class TimePanel {
  /** `hears` has zoom, pan, wheel, twice, cursor and pointer. */
  constructor(kind, log, series, last, hears) {
    this.kind = kind;
    this.log = log;
    this.series = series;
    this.hears = hears;
    this.limits = [0, 1];
    this.view = [0, 1];
    this.cursors = { a: null, b: null };
    this.head = head(kind.title, series);
    this.root = element("div", { class: "panel time-panel" }, this.head.line);
    this.last = last;
  }

  /** Beside the axis; of estimates it stands with each, as it may be longer than a low panel is high. */
  get unit() {
    if (this.kind.bounds) return " ";
    return [...new Set(this.series.map((one) => one.unit))].join(", ");
  }

  draw(width) {
    this.plot?.destroy();
    const options = {
      width, height: (this.kind.bounds ? HEIGHT_OF_ESTIMATES : HEIGHT) + (this.last ? 16 : 0),
      padding: PADDING,
      legend: { show: false },
      cursor: {
        drag: { x: true, y: false, setScale: false },
        sync: { key: "scope", scales: ["x", null] },
        points: { show: false },
        bind: { dblclick: () => () => this.hears.twice() },
      },
      scales: {
        x: { time: false, range: () => this.view },
        y: { range: () => this.limits },
      },
      axes: axes(this.last ? "s" : null, this.unit, {
        x: { values: (u, ticks) => tickWords(ticks) },
        y: { values: (u, ticks) => tickWords(ticks) },
      }),
      series: [{}, ...this.series.map((one) => ({
        stroke: one.colour, width: 1.25, dash: one.dashed ? [5, 4] : undefined,
        points: { show: false }, spanGaps: false,
      }))],
      hooks: {
        setSelect: [(u) => this.selected(u)],
        setCursor: [(u) => this.pointed(u)],
        draw: [(u) => this.drawMarks(u)],
      },
    };
    this.plot = new uPlot(options, [[], ...this.series.map(() => [])], this.root);
    this.watchPointer(this.plot.over);
  }

  /** Take what the server told, with times already as the page shows them. */
  take(timeS, told) {
    const lines = this.series.map((one) => {
      const values = told.arrays[one.column];
      return values ? Array.from(values, (v) => (Number.isNaN(v) ? null : v * one.factor)) : [];
    });
    this.data = [Array.from(timeS), ...lines];
    this.everyRow = told.every_row;
    this.root.dataset.everyRow = told.every_row;
    this.root.dataset.points = timeS.length;
    const deadline = this.kind.deadline ? [[0, this.deadline]] : [];
    const bounds = this.series.map((one) => one.bounds ?? []);
    this.own = extent([...lines.map((line) => line.filter((v) => v !== null)), ...deadline, ...bounds]);
  }

  get deadline() {
    return 1e6 / this.log.rate_hz;
  }

  show(view, low, high) {
    this.view = view;
    if (low !== undefined) this.limits = widened(low, high);
    if (!this.plot) return;
    this.plot.batch(() => {
      if (this.data) this.plot.setData(this.data, false);
      this.plot.setScale("x", { min: view[0], max: view[1] });
      this.plot.setScale("y", { min: this.limits[0], max: this.limits[1] });
    });
    this.root.dataset.low = this.limits[0];
    this.root.dataset.high = this.limits[1];
  }

  selected(u) {
    const { left, width } = u.select;
    if (width > 4 && this.dragged) {
      this.hears.zoom(u.posToVal(left, "x"), u.posToVal(left + width, "x"));
    }
    if (width) u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }

  pointed(u) {
    const { left, idx } = u.cursor;
    const inside = left >= 0 && idx !== null && idx !== undefined;
    if (inside) this.hears.pointer(u.posToVal(left, "x"));
    this.head.values.forEach((output, k) => {
      output.textContent = inside ? this.under(k + 1, idx) : "";
    });
  }

  /** Return what stands under the pointer: a value, or least and greatest of its pixel. */
  under(k, idx) {
    const line = this.data?.[k] ?? [];
    const at = line[idx];
    const other = this.everyRow ? at : line[idx % 2 ? idx - 1 : idx + 1];
    const words = at === other ? shown(at) : [at, other].sort((p, q) => p - q).map((v) => shown(v)).join(" … ");
    return `${words} ${this.series[k - 1].unit}`;
  }

  drawMarks(u) {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.lineWidth = devicePixelRatio;
    ctx.textAlign = "left";
    ctx.textBaseline = "alphabetic";
    ctx.font = `${11 * devicePixelRatio}px sans-serif`;
    if (this.kind.deadline) {
      const y = u.valToPos(this.deadline, "y", true);
      this.stroke(ctx, "#c0392b", [6, 3], bbox.left, y, bbox.left + bbox.width, y);
      ctx.fillStyle = "#c0392b";
      ctx.fillText(`deadline ${shown(this.deadline)} µs`, bbox.left + 6, y + 13 * devicePixelRatio);
    }
    for (const one of this.series) {
      for (const bound of one.bounds ?? []) {
        const y = u.valToPos(bound, "y", true);
        this.stroke(ctx, one.colour, [2, 4], bbox.left, y, bbox.left + bbox.width, y);
      }
    }
    for (const [name, time] of Object.entries(this.cursors)) {
      if (time === null || time < this.view[0] || time > this.view[1]) continue;
      const x = u.valToPos(time, "x", true);
      this.stroke(ctx, CURSOR_COLOURS[name], [], x, bbox.top, x, bbox.top + bbox.height);
      ctx.fillStyle = CURSOR_COLOURS[name];
      ctx.fillText(name.toUpperCase(), x + 3, bbox.top + 11 * devicePixelRatio);
    }
    ctx.restore();
  }

  stroke(ctx, colour, dash, x0, y0, x1, y1) {
    ctx.strokeStyle = colour;
    ctx.setLineDash(dash.map((part) => part * devicePixelRatio));
    ctx.beginPath();
    ctx.moveTo(x0, y0);
    ctx.lineTo(x1, y1);
    ctx.stroke();
  }

  setCursors(cursors) {
    this.cursors = cursors;
    this.plot?.redraw(false);
  }

  /** Shift + drag pans, a click without a drag sets a cursor, the wheel zooms. */
  watchPointer(over) {
    const timeAt = (event) => this.plot.posToVal(event.clientX - over.getBoundingClientRect().left, "x");
    let begun = null, lastX = 0;
    over.addEventListener("mousedown", (event) => {
      if (event.button !== 0) return;
      begun = lastX = event.clientX;
      this.dragged = !event.shiftKey;
      this.panning = event.shiftKey;
      if (event.shiftKey) event.stopImmediatePropagation();
    }, true);
    window.addEventListener("mousemove", (event) => {
      if (begun === null || !this.panning) return;
      const aPixel = (this.view[1] - this.view[0]) / over.clientWidth;
      this.hears.pan((lastX - event.clientX) * aPixel);
      lastX = event.clientX;
    });
    window.addEventListener("mouseup", (event) => {
      if (begun !== null && event.detail < 2 && Math.abs(event.clientX - begun) < 3) {
        this.hears.cursor(event.shiftKey ? "b" : "a", timeAt(event));
      }
      begun = null;
      this.panning = this.dragged = false;
    });
    over.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.hears.wheel(timeAt(event), event.deltaY);
    }, { passive: false });
  }

  get pixels() {
    return Math.max(50, Math.round(this.root.clientWidth - LEFT - RIGHT));
  }
}
