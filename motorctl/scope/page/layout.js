// What is shown, as the page's address tells it: a link shows what its sender saw.

import { PANELS, USUAL } from "./kinds.js";

const MAGNIFIED = [1, 10, 100, 1000, 10000];
const SPANS = [1, 5, 20, 60];

/** Return the layout that an address tells, with what is usual in place of what it does not. */
export function layoutOf(hash, usual) {
  const told = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name) => {
    const value = Number.parseFloat(told.get(name));
    return Number.isFinite(value) ? value : null;
  };
  const panels = told.get("panels")?.split(",").filter((name) => name in PANELS);
  const axes = told.get("axes")?.split(",").filter((name) => usual.axes.includes(name));
  let [from, to] = [number("from"), number("to")];
  if (from === null || to === null || from >= to) [from, to] = [null, null];
  const magnified = number("magnified");
  return {
    panels: panels?.length ? panels : (usual.panels ?? USUAL),
    axes: axes?.length ? axes : usual.axes,
    align: ["program", "time"].includes(told.get("align")) ? told.get("align") : usual.align,
    from, to,
    a: number("a"), b: number("b"),
    span: SPANS.includes(number("span")) ? number("span") : 5,
    magnified: MAGNIFIED.includes(magnified) ? magnified : 1000,
  };
}

/** Return the address' part that tells a layout. */
export function hashOf(layout) {
  const told = new URLSearchParams();
  told.set("panels", layout.panels.join(","));
  told.set("axes", layout.axes.join(","));
  told.set("align", layout.align);
  for (const name of ["from", "to", "a", "b"]) {
    if (layout[name] !== null) told.set(name, String(Number(layout[name].toPrecision(12))));
  }
  told.set("magnified", String(layout.magnified));
  return `#${told.toString().replaceAll("%2C", ",")}`;
}
