// The list of all keys and gestures.

const SECTIONS: [string, [string, string][]][] = [
  ["Look", [
    ["drag", "turn the view; with the right button, move it"], ["wheel", "zoom; over tissue with a tool, set the depth"],
    ["← → ↑ ↓", "turn the view; + and − zoom"], ["F", "bring held bodies into view"], ["5 6 7 8", "view from the front, the right, above, the corner"],
    ["V", "show colours, mesh, probes, curves"], ["H", "show or hide the numbers"], ["P", "save the picture"],
  ]],
  ["Touch", [
    ["O or Esc", "turn the view, put the tool away"], ["1", "poke: press the tissue"], ["2", "grab: hold and pull it"],
    ["3 or C", "cut along the drag"], ["4", "forceps: the jaws close on the tissue while you press"],
    ["K", "keep the jaws closed, and open them again"], ["J", "turn the forceps about their shaft"], ["Shift", "hold it to turn the view with any tool, by mouse or arrow keys"],
    ["← → ↑ ↓", "move the tool over the tissue"], ["Enter", "press the tool, and lift it again"], ["PgDn PgUp", "press deeper, less deep"],
  ]],
  ["Time", [["Space", "pause or resume"], [".", "make one step while paused"], ["R", "return to the start; asks first if there are cuts"]]],
  ["Colours", [
    ["displacement", "distance of each point from its rest position"], ["von Mises stress", "equivalent stress, a measure of distortion, in pascals"],
    ["solver iterations", "iterations of the last step"], ["loose parts", "one colour for each connected part"],
  ]],
  ["Numbers", [
    ["real time", "simulated seconds per second; 1 is real time"], ["latency", "age of the picture when it is drawn"],
    ["residual", "relative residual of the solver after a step; red above the tolerance"],
  ]],
  ["Address", [["?up=y", "axis that points up (x, y, z); the default follows gravity"], ["?quality=full", "never lower the resolution"], ["?name=Anna", "your name, which the others see"]]],
];

export class Help {
  private readonly box = document.getElementById("help")!;
  private readonly card: HTMLElement;
  /** What had the keyboard before the list was opened. */
  private before: HTMLElement | null = null;

  constructor() {
    const card = document.createElement("div");
    card.className = "card";
    const title = document.createElement("h1");
    title.textContent = "Keys and words";
    const columns = document.createElement("div");
    columns.className = "columns";
    for (const [name, entries] of SECTIONS) {
      const section = document.createElement("section"), heading = document.createElement("h2"), list = document.createElement("dl");
      heading.textContent = name;
      for (const [key, words] of entries) {
        const term = document.createElement("dt"), text = document.createElement("dd");
        const isKey = name === "Look" || name === "Touch" || name === "Time";
        if (isKey) term.append(...key.split(" ").map((k) => (k === "or" ? " or " : Object.assign(document.createElement("kbd"), { textContent: k }))));
        else term.textContent = key;
        text.textContent = words;
        list.append(term, text);
      }
      section.append(heading, list);
      columns.append(section);
    }
    card.append(title, columns);
    // Focus lets the keyboard scroll it.
    card.tabIndex = -1;
    this.card = card;
    this.box.append(card);
    this.box.onclick = () => this.toggle(false);
  }

  get isOpen(): boolean {
    return !this.box.hidden;
  }

  toggle(open = !this.isOpen): void {
    if (open === this.isOpen) return;
    if (open) this.before = document.activeElement instanceof HTMLElement ? document.activeElement : null;
    this.box.hidden = !open;
    if (open) this.card.focus();
    else this.before?.focus();
  }
}
