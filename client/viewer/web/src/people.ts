// Who else is here: people at pages of this relay and clients of the server, each with a name, a role and a colour.

import type { Stats } from "../gen/scindo/v1/server_pb";
import type { ViewerPerson } from "../gen/scindo/v1/viewer_pb";
import { element, setText } from "./dom";
import type { Relay } from "./relay";
import type { Session } from "./session";

/** Colours of the others, told apart from each other and from the blue of one's own tool. */
const COLOURS = ["#e0884f", "#7fb85f", "#c98bdb", "#d9b441", "#e5738a", "#4fb5b0", "#a59bd8", "#b98f6a"];
const MOST_CHARS = 32;
const KEPT = "scindo-name";
/** Characters that take no room or turn the direction of text. The server refuses them. */
const HIDDEN = /[\p{Cc}\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff]/gu;

/** What a role may do, in the words of the server's certificates. */
const ROLES: Record<string, string> = {
  viewer: "watches",
  haptic: "touches and cuts",
  teacher: "touches, cuts and gives orders",
  client: "a program",
};

export interface Person {
  id: string;
  name: string;
  role: string;
  tools: string[];
  colour: string;
  own: boolean;
}

export class People {
  name = "";
  list: Person[] = [];
  /** The people or their names have changed, and with them the labels of tools. */
  onChange: () => void = () => {};
  private pages: readonly ViewerPerson[] = [];
  private stats: Stats | null = null;
  private readonly colours = new Map<string, string>();
  private readonly box = document.getElementById("people")!;
  private readonly field = document.getElementById("name") as HTMLInputElement;

  constructor(private readonly session: Session, private readonly relay: Relay) {
    this.name = clean(new URLSearchParams(location.search).get("name") ?? kept());
    this.field.value = this.name;
    this.field.maxLength = MOST_CHARS;
    this.field.onchange = () => {
      this.choose(this.field.value);
      this.field.blur();
    };
  }

  /** Takes a name and tells it to everybody. */
  choose(name: string): void {
    this.name = clean(name);
    this.field.value = this.name;
    try {
      localStorage.setItem(KEPT, this.name);
    } catch {
      // A browser that keeps nothing asks again next time.
    }
    this.tell();
  }

  /** Tells the relay the name of this page, which it does not know after a new connection. */
  tell(): void {
    this.relay.send({ case: "name", value: { name: this.name } });
  }

  setPages(pages: readonly ViewerPerson[]): void {
    this.pages = pages;
    this.refresh();
  }

  setStats(stats: Stats): void {
    this.stats = stats;
    this.refresh();
  }

  /** Name and colour to be shown at a tool that somebody else holds; null for one's own tool and one of the scene. */
  holderOf(owner: string): Person | null {
    return this.list.find((person) => (person.id === owner || `${person.id}-left` === owner) && !person.own) ?? null;
  }

  private refresh(): void {
    const before = JSON.stringify(this.list);
    this.list = this.gather();
    if (JSON.stringify(this.list) === before) return;
    this.draw();
    this.onChange();
  }

  private gather(): Person[] {
    const tools = (id: string) => (this.stats?.tools ?? []).filter((tool) => tool.owner === id || tool.owner === `${id}-left`);
    const person = (id: string, name: string, role: string): Person => {
      const held = tools(id);
      const own = id === this.session.toolId;
      const colour = own ? "" : this.colourOf(id);
      return { id, name: name || held.find((tool) => tool.name)?.name || "", role, tools: held.map((tool) => tool.toolId), colour, own };
    };
    const here = this.pages.map((page) => person(page.toolId, page.name, page.readOnly ? "viewer" : page.operator ? "teacher" : "haptic"));
    const known = new Set([...here.map((one) => one.id), this.session.clientId]);
    const others = (this.stats?.clients ?? []).filter((client) => !known.has(client.clientId) && !known.has(client.clientId.replace(/-left$/, ""))).map((client) => person(client.clientId, "", pageRole(client.clientId, client.role)));
    return [...here.filter((one) => one.own), ...here.filter((one) => !one.own), ...others];
  }

  /** A colour that stays with a person for as long as the page is open. */
  private colourOf(id: string): string {
    let colour = this.colours.get(id);
    if (!colour) {
      colour = COLOURS[this.colours.size % COLOURS.length];
      this.colours.set(id, colour);
    }
    return colour;
  }

  private draw(): void {
    const unseen = Math.max(0, (this.stats?.clientCount ?? 0) - (this.stats?.clients.length ?? 0));
    this.box.replaceChildren(...this.list.map((person) => {
      const row = element("div", "person");
      const dot = element("i");
      dot.style.setProperty("--of", person.own ? "var(--accent)" : person.colour);
      const name = element("span", "key", person.own ? `${person.name || "you"}${person.name ? " (you)" : ""}` : person.name || person.id);
      const held = person.tools.length > 0 && !person.own ? ` · ${person.tools.filter((tool) => !tool.startsWith(person.id)).join(", ") || "mouse"}` : "";
      const role = element("span", "value", person.role + held);
      row.append(dot, name, role);
      row.title = `${person.id}: ${ROLES[person.role] ?? person.role}`;
      return row;
    }));
    if (unseen > 0) this.box.append(element("div", "muted", `and ${unseen} more`));
    setText(document.getElementById("people-count")!, `${this.list.length + unseen}`);
  }
}

/** A mouse of a page behind another viewer has the token of a viewer; it touches all the same. */
function pageRole(id: string, role: string): string {
  return role === "viewer" && /-mouse-\d+(-left)?$/.test(id) ? "haptic" : role;
}

function clean(name: string): string {
  return [...name.replace(HIDDEN, "").trim()].slice(0, MOST_CHARS).join("");
}

function kept(): string {
  try {
    return localStorage.getItem(KEPT) ?? "";
  } catch {
    return "";
  }
}
