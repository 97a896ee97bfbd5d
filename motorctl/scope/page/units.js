// Numbers as people read them.

const SCALED = {
  position: { m: [1e3, "mm"], rad: [1, "rad"] },
  error: { m: [1e6, "µm"], rad: [1e6, "µrad"] },
  velocity: { "m/s": [1e3, "mm/s"], "rad/s": [1, "rad/s"] },
  time: { s: [1e6, "µs"] },
};

/** Return by which factor a quantity in `unit` is shown, and in which unit then. */
export function scaled(quantity, unit) {
  return SCALED[quantity]?.[unit] ?? [1, unit];
}

export function shown(value, digits = 5) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  return size >= 1e6 || size < 1e-4 ? value.toExponential(digits - 2) : String(Number(value.toPrecision(digits)));
}

/** Return a time with as many digits as tell it apart on a screen that spans `span` seconds. */
export function shownTime(seconds, span) {
  const digits = Math.min(7, Math.max(0, Math.ceil(3 - Math.log10(span || 1))));
  return seconds.toFixed(digits);
}
