// What is chosen at the head of the page: panels, axes, alignment.

import { element } from "./frame.js";
import { PANELS } from "./kinds.js";

/** Show what may be chosen; `changed` is told the new layout. */
export function showChoices(logs, layout, changed) {
  const axes = [...new Set(logs.flatMap((log) => log.axes))];
  const names = Object.keys(PANELS).filter((name) => name !== "path" || logs.some((log) => log.axes.length > 1));
  const toggled = (list, name, order) => {
    const next = list.includes(name) ? list.filter((each) => each !== name) : [...list, name];
    return order.filter((each) => next.includes(each));
  };
  fill("panels", names, layout.panels, (name) => PANELS[name].title, (name) => {
    changed({ ...layout, panels: toggled(layout.panels, name, names) });
  });
  fill("axes", axes, layout.axes, (name) => `axis ${name}`, (name) => {
    changed({ ...layout, axes: toggled(layout.axes, name, axes) });
  });
  const align = document.getElementById("align");
  align.value = layout.align;
  align.onchange = () => changed({ ...layout, align: align.value, from: null, to: null, a: null, b: null });
  const magnified = document.getElementById("magnified");
  magnified.value = String(layout.magnified);
  magnified.onchange = () => changed({ ...layout, magnified: Number(magnified.value) });
  document.getElementById("magnified-choice").hidden = !layout.panels.includes("path");
}

function fill(id, names, chosen, title, toggle) {
  document.getElementById(id).replaceChildren(...names.map((name) => {
    const button = element("button", { type: "button", "aria-pressed": chosen.includes(name), text: title(name), "data-name": name });
    button.onclick = () => toggle(name);
    return button;
  }));
}
