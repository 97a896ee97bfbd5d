// A running machine: the page follows its rows, arms triggers, and shows what was captured.

import { askJson, Refused, send } from "./ask.js";
import { element } from "./frame.js";
import { shown } from "./units.js";

const PERIOD_MS = 100, PLANES_MS = 1000, AUTO_HOLD_MS = 2000;

/** `page` has log, range(begin, end), show(from, to, planes), hold(from, to), anew(), say(words). */
export class Live {
  constructor(page, span) {
    this.page = page;
    this.following = true;
    this.planesAt = 0;
    this.captured = null;
    this.marks = null;
    document.getElementById("live").hidden = false;
    this.spans = document.getElementById("span");
    this.spans.value = String(span);
    this.spans.onchange = () => { this.follow(true); };
    this.button = document.getElementById("follow");
    this.button.onclick = () => this.follow(!this.following);
    this.form = document.getElementById("trigger");
    this.fillForm();
    this.run();
  }

  get span() {
    return Number(this.spans.value);
  }

  follow(on) {
    this.following = on;
    this.button.setAttribute("aria-pressed", on);
    document.body.dataset.following = on;
  }

  async run() {
    this.follow(true);
    for (;;) {
      const begun = performance.now();
      try {
        await this.look();
        document.body.dataset.heard = "true";
        if (this.silent) this.page.say([]);
        this.silent = false;
      } catch (error) {
        if (!(error instanceof Refused || error instanceof TypeError || error.name === "AbortError")) throw error;
        if (error.name !== "AbortError") {
          this.silent = true;
          this.page.say([error instanceof Refused ? error.message : "motorctl scope does not answer: is it still running?"]);
        }
      }
      const left = PERIOD_MS - (performance.now() - begun);
      await new Promise((done) => { setTimeout(done, Math.max(20, left)); });
    }
  }

  async look() {
    const state = await askJson("live");
    const marks = `${state.run} ${state.columns}`;
    if (this.marks !== null && marks !== this.marks) await this.page.anew();
    this.marks = marks;
    this.page.range(state.begin_s, state.end_s);
    this.tell(state);
    if (this.captured !== null && state.captured > this.captured) this.hold(state.captures.at(-1), state.armed);
    this.captured = state.captured;
    if (!this.following) return;
    const planes = performance.now() - this.planesAt > PLANES_MS;
    if (planes) this.planesAt = performance.now();
    await this.page.show(state.end_s - this.span, state.end_s, planes);
  }

  tell(state) {
    const heard = document.getElementById("heard");
    heard.textContent = state.failure ? `ended: ${state.failure}` : state.gone ? "the daemon is gone: waiting for the next one" : `${shown(state.end_s, 7)} s · ${state.lost} rows lost`;
    heard.dataset.lost = state.lost;
    heard.dataset.gone = state.gone;
    this.form.dataset.armed = state.armed !== null;
    this.form.elements.arm.textContent = state.armed ? `armed: ${state.armed.kind}` : "arm";
    const newest = state.captures.at(-1);
    const place = document.getElementById("captured");
    if (!newest) return;
    const words = newest.path ? `captured at ${shown(newest.time_s, 7)} s: ${newest.path}` : `not captured: ${newest.failure}`;
    if (place.textContent !== words) place.replaceChildren(element("span", { text: words }));
  }

  /** Stay at what was captured; with a trigger that is `auto` for a moment only. */
  hold(capture, armed) {
    this.follow(false);
    this.page.hold(capture.begin_s, capture.end_s, capture.time_s);
    if (armed?.mode === "auto") setTimeout(() => this.follow(true), AUTO_HOLD_MS);
  }

  fillForm() {
    const { form, page } = this;
    const fields = form.elements;
    const option = (value, text = value) => element("option", { value, text });
    fields.axis.replaceChildren(option("", "any"), ...page.log.axes.map((axis) => option(axis)));
    const columns = Object.keys(page.log.units).filter((name) => !["tick", "time_s"].includes(name));
    fields.column.replaceChildren(...columns.map((name) => option(name)));
    const usual = columns.find((name) => name.endsWith(".following_error_m"));
    if (usual) fields.column.value = usual;
    const arranged = () => {
      const level = fields.kind.value === "level";
      form.querySelector(".of-level").hidden = !level;
      form.querySelector(".of-axis").hidden = level;
      fields.unit.textContent = page.log.units[fields.column.value];
    };
    form.onchange = arranged;
    arranged();
    form.onsubmit = (event) => { event.preventDefault(); this.arm(); };
    fields.disarm.onclick = () => this.send("");
  }

  arm() {
    const fields = this.form.elements;
    const number = (name) => Number(fields[name].value);
    const level = fields.kind.value === "level";
    const wanted = {
      kind: fields.kind.value, mode: fields.mode.value, pre_s: number("pre_s"), post_s: number("post_s"),
      ...(level ? { column: fields.column.value, level: number("level"), hysteresis: number("hysteresis"), edge: fields.edge.value } : {}),
      ...(!level && fields.axis.value ? { axis: fields.axis.value } : {}),
    };
    this.follow(true);
    this.send(JSON.stringify(wanted));
  }

  async send(body) {
    try {
      await send("trigger", body);
      this.page.say([]);
    } catch (error) {
      this.page.say([error.message]);
    }
  }
}
