// Helpers that write only changed text into the page.

export type Row = [key: string, value: string, kind?: "title" | "bad" | "warn" | "words" | "bad words" | "", hint?: string];

/** Fills a list of keys and values. It changes only the texts that differ. */
export function setRows(box: Element, rows: Row[]): void {
  while (box.children.length > rows.length) box.lastElementChild!.remove();
  while (box.children.length < rows.length) {
    const row = element("div", "row");
    row.append(element("span", "key"), element("span", "value"));
    box.append(row);
  }
  rows.forEach(([key, value, kind = "", hint = ""], i) => {
    const row = box.children[i] as HTMLElement;
    row.className = kind === "title" ? "row title" : kind.endsWith("words") ? "row words" : "row";
    row.dataset["level"] = kind.startsWith("bad") ? "bad" : kind === "warn" ? "warn" : "";
    if (row.title !== hint) row.title = hint;
    setText(row.children[0], key);
    setText(row.children[1], value);
  });
}

export function setText(node: Element, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

export function element(tag: string, className = "", text = ""): HTMLElement {
  const node = document.createElement(tag);
  if (className) node.className = className;
  if (text) node.textContent = text;
  return node;
}
