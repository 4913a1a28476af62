// Light or dark, as the system says; colours that are not style sheet's business.

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
