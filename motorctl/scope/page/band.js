// States and faults in words, below the time axis.

import { element } from "./frame.js";
import { shownTime } from "./units.js";

const NARROW = 0.006; // of the width: a word in less is cut to nothing

export class Band {
  constructor(log) {
    this.log = log;
    this.root = element("div", { class: "band" });
  }

  /** Take what the server told of the states, and the shift from the log's clock to the page's. */
  take(told, offset) {
    this.stretches = told.axes;
    this.missed = told.missed;
    this.offset = offset;
  }

  show([from, to]) {
    const rows = [];
    for (const [axis, stretches] of Object.entries(this.stretches ?? {})) {
      const track = element("div", { class: "track", "data-axis": axis });
      for (const stretch of stretches) this.place(track, stretch, from, to);
      const missed = this.missed[axis] ?? { rows: 0, stretches: [] };
      for (const stretch of missed.stretches) this.placeMissed(track, stretch, from, to);
      const words = element("span", { class: "missed-words", text: `${missed.rows} ${missed.rows === 1 ? "row" : "rows"} without a new sample` });
      rows.push(element("span", { class: "name", text: axis }), track);
      if (missed.rows) rows.push(element("span"), words);
    }
    this.root.replaceChildren(...rows);
  }

  placeMissed(track, [begin, end], from, to) {
    const mark = element("div", { class: "missed", title: "no new sample of the device" });
    mark.style.left = `${(100 * (begin - this.offset - from)) / (to - from)}%`;
    mark.style.width = `${(100 * (end - begin)) / (to - from)}%`;
    track.append(mark);
  }

  place(track, stretch, from, to) {
    const begin = Math.max(stretch.from_s - this.offset, from);
    const end = Math.min(stretch.to_s - this.offset, to);
    if (end < begin) return;
    const width = (end - begin) / (to - from);
    const words = stretch.fault ? `fault: ${stretch.fault}` : stretch.state;
    const span = to - from;
    const when = `${shownTime(stretch.from_s - this.offset, span)} to ${shownTime(stretch.to_s - this.offset, span)} s`;
    const narrow = width < NARROW && !stretch.fault ? " narrow" : "";
    const made = element("div", {
      class: `stretch ${stretch.state.split(" ")[0]}${narrow}`, title: `${words}, ${when}`, text: words,
    });
    made.style.left = `${(100 * (begin - from)) / span}%`;
    made.style.width = `${100 * width}%`;
    track.append(made);
  }
}
