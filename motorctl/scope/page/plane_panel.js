// One thing over another for the stretch of time in view: error over position, paths, spectra.

import { PADDING, axes, element, extent, head, tickWords, widened } from "./frame.js";
import { colourOf } from "./kinds.js";
import { askArrays } from "./ask.js";
import { scaled, shown } from "./units.js";

const HEIGHT = 320;
const REFERENCE = "#9aa5ad";
const LEAST_SHARE = 1e-5; // of a spectrum's highest line: what lies below it is not drawn

export class PlanePanel {
  constructor(kind, log, index, axisNames) {
    this.kind = kind;
    this.log = log;
    this.index = index;
    this.axisNames = axisNames;
    this.clouds = [];
    this.root = element("div", { class: "panel plane-panel" });
  }

  /** Ask for what is drawn; `view` is by the log's own clock. */
  async ask(view, magnified, signal) {
    const stretch = { log: this.index, begin_s: view[0], end_s: view[1] };
    if (this.kind.path) this.clouds = await this.askPath(stretch, magnified, signal);
    else {
      const asked = this.axisNames.map((axis) => this.askAxis(axis, stretch, signal));
      this.clouds = (await Promise.all(asked)).flat().filter((cloud) => cloud !== null);
    }
  }

  async askAxis(axis, stretch, signal) {
    const { kind, log } = this;
    const colour = colourOf(log, axis);
    const label = axis;
    if (kind.laps) return this.askLaps(axis, stretch, signal);
    if (kind.over) return this.askPlaces(axis, stretch, signal);
    if (kind.column) {
      const [factor, unit] = this.scale(axis, kind.column);
      if (factor === null) return null;
      const told = await askArrays("spectrum", { ...stretch, column: `${axis}.${kind.column[0]}` }, signal);
      const { frequency_hz: x, amplitude } = told.arrays;
      return { x: x.subarray(1), y: amplitude.subarray(1).map((v) => v * factor), line: true, note: told.note, colour, label, xUnit: "Hz", yUnit: `${unit} rms` };
    }
    const [xFactor, xUnit] = this.scale(axis, kind.x), [yFactor, yUnit] = this.scale(axis, kind.y);
    if (xFactor === null || yFactor === null) return null;
    const told = await askArrays("plane", { ...stretch, x: `${axis}.${kind.x[0]}`, y: `${axis}.${kind.y[0]}` }, signal);
    return { x: told.arrays.x.map((v) => v * xFactor), y: told.arrays.y.map((v) => v * yFactor), line: told.line, note: told.note, colour, label, xUnit, yUnit };
  }

  /** Waves over position: cycles by metre, or by turn of a rotary axis. */
  async askPlaces(axis, stretch, signal) {
    const [factor, unit] = this.scale(axis, this.kind.column);
    const position = `${axis}.position_m`;
    if (factor === null || !(position in this.log.units)) return null;
    const told = await askArrays("place_spectrum", { ...stretch, column: `${axis}.${this.kind.column[0]}`, position }, signal);
    const { cycles, amplitude } = told.arrays;
    return { x: cycles.subarray(1), y: amplitude.subarray(1).map((v) => v * factor), line: true, note: told.note, colour: colourOf(this.log, axis), label: axis, xUnit: told.unit, yUnit: `${unit} rms` };
  }

  /** Each lap is a line of its own: the first faint, the last dark. */
  async askLaps(axis, stretch, signal) {
    const [factor, unit] = this.scale(axis, this.kind.laps);
    if (factor === null || !(`${axis}.reference_m` in this.log.units)) return null;
    const told = await askArrays("laps", { ...stretch, axis, column: `${axis}.${this.kind.laps[0]}` }, signal);
    const { x, y, rows } = told.arrays;
    const colour = colourOf(this.log, axis), common = { line: true, note: told.note, colour, xUnit: "s in the cycle", yUnit: unit };
    if (!rows.length) return { ...common, x, y, label: axis };
    let end = 0;
    return Array.from(rows, (count, k) => {
      const begin = end;
      end += count;
      const last = k === rows.length - 1;
      const label = last ? `${axis}, laps ${told.first} to ${told.first + rows.length - 1} of ${shown(told.period_s, 4)} s` : undefined;
      return { ...common, x: x.subarray(begin, end), y: y.subarray(begin, end).map((v) => v * factor), label, alpha: rows.length > 1 ? 0.2 + 0.8 * k / (rows.length - 1) : 1 };
    });
  }

  async askPath(stretch, magnified, signal) {
    const [x, y] = pathOf(this.log, this.axisNames);
    const told = await askArrays("path", { ...stretch, x, y, magnified }, signal);
    const units = [x, y].map((axis) => this.log.units[`${axis}.position_m`]);
    const [[xFactor, xWord], [yFactor, yWord]] = units.map((unit) => scaled("position", unit));
    const size = (value, k) => {
      const [factor, unit] = scaled("error", units[k]);
      return `${shown(value * factor, 3)} ${unit}`;
    };
    this.alike = units[0] === units[1];
    const { arrays } = told;
    const words = [];
    if (told.worst !== undefined) words.push(`across the path: worst ${size(told.worst, 0)}, rms ${size(told.rms, 0)}`);
    if (told.worst_x !== undefined && told.worst_y !== undefined) words.push(`worst: ${x} ${size(told.worst_x, 0)}, ${y} ${size(told.worst_y, 1)}; ${units[0]} and ${units[1]} have no distance in common, so each axis' own error`);
    const note = [told.note, ...words].filter(Boolean).join("; ");
    const cloud = (atX, atY, rest) => ({ x: atX.map((v) => v * xFactor), y: atY.map((v) => v * yFactor), xUnit: `${x} ${xWord}`, yUnit: `${y} ${yWord}`, ...rest });
    return [
      cloud(arrays.reference_x, arrays.reference_y, { line: told.reference_line, colour: REFERENCE, label: `${x}, ${y} reference` }),
      cloud(arrays.x, arrays.y, { line: told.line, colour: "#b5482e", label: `error${this.alike ? " across it" : ""} × ${magnified}`, note }),
    ];
  }

  scale(axis, [signal, quantity]) {
    const unit = this.log.units[`${axis}.${signal}`];
    return unit === undefined ? [null, null] : scaled(quantity, unit);
  }

  draw(width) {
    this.plot?.destroy();
    const { clouds, kind } = this;
    const { line, note } = head(kind.title, clouds.filter((cloud) => cloud.label));
    note.textContent = clouds.map((cloud) => cloud.note).find(Boolean) ?? "";
    this.root.replaceChildren(line);
    this.root.dataset.lines = clouds.length;
    this.root.dataset.points = clouds.reduce((sum, cloud) => sum + cloud.x.length, 0);
    if (!clouds.some((cloud) => cloud.x.length)) return;
    const logarithmic = Boolean(kind.column);
    const [x, y] = logarithmic ? this.spectrumLimits() : this.limits(width);
    const words = (u, ticks) => (logarithmic ? decadeWords(ticks) : tickWords(ticks));
    const scale = (limits) => ({ time: false, distr: logarithmic ? 3 : 1, range: () => limits, auto: false, min: limits[0], max: limits[1] });
    this.plot = new uPlot({
      mode: 2, width, height: HEIGHT, padding: PADDING,
      legend: { show: false },
      cursor: { show: false },
      scales: { x: scale(x), y: scale(y) },
      axes: axes(clouds[0].xUnit, clouds[0].yUnit, { x: { scale: "x", values: words }, y: { scale: "y", values: words } }),
      series: [{}, ...clouds.map((cloud) => ({ stroke: cloud.colour, facets: [{ scale: "x", auto: false }, { scale: "y", auto: false }], paths: drawCloud(cloud) }))],
    }, [null, ...clouds.map((cloud) => [cloud.x, cloud.y])], this.root);
  }

  limits(width) {
    const x = widened(...extent(this.clouds.map((cloud) => cloud.x)));
    const y = widened(...extent(this.clouds.map((cloud) => cloud.y)));
    if (!this.kind.path || !this.alike) return [x, y];
    // Both directions alike: a circle is one.
    const [w, h] = [width - 76, HEIGHT - 46];
    const aPixel = Math.max((x[1] - x[0]) / w, (y[1] - y[0]) / h);
    const around = ([low, high], pixels) => [(low + high - aPixel * pixels) / 2, (low + high + aPixel * pixels) / 2];
    return [around(x, w), around(y, h)];
  }

  spectrumLimits() {
    const [xLow, xHigh] = extent(this.clouds.map((cloud) => cloud.x));
    const [, high] = extent(this.clouds.map((cloud) => cloud.y));
    const least = high * LEAST_SHARE;
    const [low] = extent(this.clouds.map((cloud) => cloud.y.filter((v) => v > least)));
    return [[xLow, xHigh], high > 0 ? [low * 0.7, high * 1.5] : [0.1, 10]];
  }
}

/** Return powers of ten in words, and nothing of other ticks: where the scale begins is none. */
function decadeWords(ticks) {
  const round = (tick) => Math.abs(Math.log10(tick) - Math.round(Math.log10(tick))) < 1e-6;
  const decades = ticks.some((tick) => tick !== null && round(tick));
  return ticks.map((tick) => (tick === null || (decades && !round(tick)) ? "" : shown(tick)));
}

/** Return the two axes of a log whose path is drawn: of those that are shown, where there are two. */
function pathOf(log, shownAxes) {
  return log.paths.find((pair) => pair.every((axis) => shownAxes.includes(axis))) ?? log.paths[0];
}

/** Return what draws a cloud of points, or a line through them in their order. */
function drawCloud(cloud) {
  return (u) => {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.beginPath();
    ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
    ctx.clip();
    ctx.strokeStyle = ctx.fillStyle = cloud.colour;
    ctx.lineWidth = devicePixelRatio;
    ctx.globalAlpha = cloud.alpha ?? 1;
    const size = 1.5 * devicePixelRatio;
    ctx.beginPath();
    for (let k = 0; k < cloud.x.length; k += 1) {
      const x = u.valToPos(cloud.x[k], "x", true), y = u.valToPos(cloud.y[k], "y", true);
      if (!cloud.line) ctx.fillRect(x - size / 2, y - size / 2, size, size);
      else if (k) ctx.lineTo(x, y);
      else ctx.moveTo(x, y);
    }
    if (cloud.line) ctx.stroke();
    ctx.restore();
    return null;
  };
}
