// Numbers formatted for people.

/** A length in the unit that gives one to three digits before the point. */
export function length(metres: number): string {
  const size = Math.abs(metres);
  if (size >= 1) return `${metres.toFixed(2)} m`;
  if (size >= 0.1) return `${(metres * 100).toFixed(1)} cm`;
  return `${(metres * 1000).toFixed(size < 0.01 ? 1 : 0)} mm`;
}

export function volume(cubicMetres: number): string {
  if (cubicMetres >= 1e-3) return `${(cubicMetres * 1e3).toFixed(3)} L`;
  return `${(cubicMetres * 1e6).toFixed(2)} mL`;
}

export function count(n: number): string {
  return Math.round(n).toLocaleString("en").replaceAll(",", "\u202f");
}

/** Three significant digits, without exponents within the range of the panel. */
export function short(x: number): string {
  if (!Number.isFinite(x)) return "–";
  const size = Math.abs(x);
  return size >= 100 ? x.toFixed(0) : size >= 10 ? x.toFixed(1) : x.toFixed(2);
}

export function exponent(x: number): string {
  return x === 0 ? "0" : x.toExponential(1).replace("e-", "e−").replace("e+", "e");
}

/** A number with the prefix that gives one to three digits before the point. */
export function engineering(x: number, unit: string): string {
  const size = Math.abs(x);
  const [factor, prefix] = size >= 1e9 ? [1e-9, "G"] : size >= 1e6 ? [1e-6, "M"] : size >= 1e3 ? [1e-3, "k"]
    : size >= 1 || size === 0 ? [1, ""] : size >= 1e-3 ? [1e3, "m"] : size >= 1e-6 ? [1e6, "µ"] : [1e9, "n"];
  return `${short(x * factor)} ${prefix}${unit}`;
}
