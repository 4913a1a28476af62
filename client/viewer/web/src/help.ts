// The list of all keys and gestures.

const SECTIONS: [string, [string, string][]][] = [
  ["Look", [
    ["drag", "turns the view; the right button moves it"], ["wheel", "zooms; over tissue with a tool it sets the depth"],
    ["F", "brings what is held into view"], ["5 6 7 8", "from the front, the right, above, the corner"],
    ["V", "colours, mesh, probes, curves"], ["H", "numbers"], ["P", "saves the picture"],
  ]],
  ["Touch", [
    ["O or Esc", "turn the view, put the tool away"], ["1", "poke: press the tissue"], ["2", "grab: hold and pull it"],
    ["3 or C", "cut along the drag"], ["Shift", "held: the drag turns the view, whatever the tool"],
  ]],
  ["Time", [["Space", "pause or go on"], [".", "one step, when paused"], ["R", "back to the start; asks first when there are cuts"]]],
  ["Colours", [
    ["displacement", "how far each point is from where it rests"], ["von Mises stress", "how much the material is strained in shape, in pascal"],
    ["solver iterations", "work of the last step"], ["loose parts", "what hangs together"],
  ]],
  ["Numbers", [
    ["real time", "simulated seconds per second; 1 keeps pace"], ["latency", "age of the picture when it is drawn"],
    ["error left", "what the solver left of a step's imbalance; red above its goal"],
  ]],
  ["Address", [["?up=y", "this axis is up (x, y, z); otherwise gravity says"], ["?quality=full", "never lower the resolution"]]],
];

export class Help {
  private readonly box = document.getElementById("help")!;

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
    this.box.append(card);
    this.box.onclick = () => this.toggle(false);
  }

  get isOpen(): boolean {
    return !this.box.hidden;
  }

  toggle(open = !this.isOpen): void {
    this.box.hidden = !open;
  }
}
