// What stands at the two cursors, and how far apart it is.

import { element } from "./frame.js";
import { shown } from "./units.js";

/**
 * Fill the readout.
 * `logs` has for each log its name and rows of label, unit, a, b; a and b are numbers or null.
 */
export function fillReadout(place, { a, b }, logs) {
  place.hidden = a === null && b === null;
  document.getElementById("sheet").classList.toggle("measured", !place.hidden);
  if (place.hidden) return;
  const apart = a !== null && b !== null ? b - a : null;
  const times = ["time", shown(a, 9), shown(b, 9), shown(apart, 9), "s"];
  const tables = logs.map(({ name, rows }) => {
    const body = element("tbody", {}, line("td", times), ...rows.map(rowOf));
    const heading = [logs.length > 1 ? name : "", "A", "B", "B − A", ""];
    return element("table", {}, element("thead", {}, line("th", heading)), body);
  });
  const hertz = element("p", { text: apart ? `1 / (B − A) = ${shown(1 / Math.abs(apart))} Hz` : "" });
  place.replaceChildren(element("div", { class: "tables" }, ...tables), hertz);
}

function rowOf({ label, unit, a, b }) {
  const between = a !== null && b !== null ? b - a : null;
  return line("td", [label, shown(a, 7), shown(b, 7), shown(between, 7), unit]);
}

function line(tag, cells) {
  const classes = ["", "cursor-a", "cursor-b", "", ""];
  return element("tr", {}, ...cells.map((text, k) => element(k ? tag : "th", { text, class: tag === "th" ? classes[k] : "" })));
}
