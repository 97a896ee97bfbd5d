// What all plots share: size, margins, how axes look.

export const LEFT = 64, RIGHT = 22;
const INK = "#5a6b78", GRID = { stroke: "#e6e1d6", width: 1 };
const FONT = "11px system-ui, 'DejaVu Sans', sans-serif";

export function axes(xLabel, yLabel, extra = {}) {
  const common = { stroke: INK, grid: GRID, ticks: { ...GRID, size: 4 }, font: FONT, labelFont: FONT };
  return [
    { ...common, size: 24, gap: 3, label: xLabel, labelSize: 14, labelGap: 0, ...extra.x },
    { ...common, size: LEFT - 16, label: yLabel, labelSize: 16, labelGap: 0, ...extra.y },
  ];
}

export const PADDING = [6, RIGHT, 0, 0];

/** Return ticks in words, with as many digits as tell two of them apart. */
export function tickWords(ticks) {
  const there = ticks.filter((tick) => tick !== null);
  const step = there.length > 1 ? there[1] - there[0] : 1;
  let digits = 0;
  while (digits < 9 && Math.abs(step * 10 ** digits - Math.round(step * 10 ** digits)) > 1e-3 * step * 10 ** digits) digits += 1;
  return ticks.map((tick) => (tick === null ? "" : tick.toFixed(digits)));
}

/** Return limits a little wider than the values, and never without extent. */
export function widened(low, high) {
  if (!(low <= high)) return [-1, 1];
  const margin = (high - low) * 0.05 || Math.abs(high) * 0.05 || 1;
  return [low - margin, high + margin];
}

/** Return least and greatest of arrays, leaving out what is no number. */
export function extent(arrays) {
  let low = Infinity, high = -Infinity;
  for (const values of arrays) {
    for (const value of values) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low, high];
}

export function element(tag, options = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(options)) {
    if (name === "text") made.textContent = value;
    else if (name === "class") made.className = value;
    else made.setAttribute(name, value);
  }
  made.append(...children);
  return made;
}

/** Return the line above a plot: its title, and what each line in it is. */
export function head(title, series) {
  const line = element("div", { class: "panel-head" }, element("b", { text: title }));
  for (const one of series) {
    const mark = element("i", { class: one.dashed ? "dashed" : "" });
    mark.style.color = one.colour;
    const value = element("output");
    line.append(element("span", { class: "series" }, mark, `${one.label} `, value));
  }
  const note = element("span", { class: "panel-note" });
  line.append(note);
  return { line, note, values: [...line.querySelectorAll("output")] };
}
