// Rates and smoothed values for the panel.

/** Events per second over the last second or so. */
export class Rate {
  value = 0;
  total = 0;
  private since = 0;
  private counted = 0;

  count(now: number): void {
    if (this.since === 0) this.since = now;
    this.counted += 1;
    this.total += 1;
  }

  advance(now: number): void {
    const span = now - this.since;
    if (this.since === 0 || span < 900) return;
    this.value = (1000 * this.counted) / span;
    this.counted = 0;
    this.since = now;
  }
}

/** Exponential mean; NaN before the first value. */
export class Smooth {
  value = NaN;

  add(x: number): void {
    this.value = Number.isNaN(this.value) ? x : this.value + 0.08 * (x - this.value);
  }
}
