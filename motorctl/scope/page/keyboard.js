// Keys, for those whose hands are there.

const STEP = 0.1, FINE_STEP = 0.02, FACTOR = 1.5;

/** `does` has pan(share), zoom(factor), all, cursor(name), noCursors, refresh, follow, help. */
export function listen(does) {
  window.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input, dialog *")) return;
    if (event.key === " " && event.target.matches("button")) return;
    const step = event.shiftKey ? FINE_STEP : STEP;
    const keys = {
      ArrowLeft: () => does.pan(-step), ArrowRight: () => does.pan(step),
      PageUp: () => does.pan(-0.9), PageDown: () => does.pan(0.9),
      "+": () => does.zoom(1 / FACTOR), "=": () => does.zoom(1 / FACTOR), "-": () => does.zoom(FACTOR),
      0: does.all, Home: does.all,
      a: () => does.cursor("a"), b: () => does.cursor("b"), x: does.noCursors, Escape: does.noCursors,
      r: does.refresh, " ": does.follow, "?": does.help,
    };
    if (!(event.key in keys)) return;
    event.preventDefault();
    keys[event.key]();
  });
}
