// Light or dark theme, as the system prefers, and the colours of the style sheet for other code.

const light = matchMedia("(prefers-color-scheme: light)");

export function isLight(): boolean {
  return light.matches;
}

export function onTheme(changed: () => void): void {
  light.addEventListener("change", changed);
}

/** A colour of the style sheet, such as `--muted`. */
export function ink(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}
