// Sequences and procedures: those that the rig has, and a sequence composed of steps, which is saved on the rig's side and run from there.

import { at, decimal, make } from "./link.js";
import { order, say } from "./orders.js";

const PLAIN = /^[\w. %°/+-]{0,40}$/; // what may stand as a value in the file
const HOLE = "VALUE"; // of the line of a kind of step
const HEAD = ["description: composed on the page", "steps:"];

export class Sequences {
  constructor(link) {
    this.link = link;
    at("sequence").onchange = () => this.describe();
    at("run").onclick = () => {
      const [kind, name] = this.chosen();
      this.give(at("run"), at("sequence-said"), kind, kind === "procedure" ? { name, series: at("series").value } : { name });
    };
    at("abort").onclick = () => this.give(at("abort"), at("sequence-said"), "abort", {});
    at("add-step").onclick = () => this.add();
    at("run-own").onclick = () => this.own();
    at("load-own").onclick = () => this.load();
    link.on("sequence", (message) => this.show(message));
    link.on("found", (message) => this.found(message));
    link.on("own sequences", ({ names }) => {
      this.saved = names;
      at("own-sequences").replaceChildren(...names.map((value) => make("option", { value })));
      if (this.offered) this.offer();
    });
  }

  rig({ sequences, procedures, steps }) {
    this.compose(steps);
    this.offered = { sequence: sequences, procedure: procedures };
    this.offer();
  }

  // What can be run: the rig's own, and what was composed here.
  offer() {
    const before = at("sequence").value;
    const composed = (this.saved ?? []).map((name) => ({ name, text: `Composed on the page, in runs/sequences/${name}.yaml.` }));
    const all = { ...this.offered, "own sequence": composed };
    this.texts = new Map(Object.entries(all).flatMap(([kind, ones]) => ones.map((one) => [`${kind} ${one.name}`, one.text])));
    at("sequence").replaceChildren(
      ...Object.entries(all)
        .filter(([, ones]) => ones.length)
        .map(([kind, ones]) => make("optgroup", { label: `${kind}s` }, ...ones.map(({ name }) => make("option", { value: `${kind} ${name}` }, name)))),
    );
    const wanted = [before, "sequence demo"].find((one) => this.texts.has(one));
    if (wanted) at("sequence").value = wanted;
    at("run").disabled = !this.texts.size;
    if (!wanted || wanted !== before) this.describe();
  }

  // Kind and name of what is to be run.
  chosen() {
    const [, kind, name] = /^(own sequence|\w+) (.*)$/.exec(at("sequence").value) ?? ["", "", ""];
    return [kind, name];
  }

  async describe() {
    const [kind, name] = this.chosen();
    const text = this.texts.get(at("sequence").value) ?? "This rig has no sequences of its own.";
    at("sequence-text").textContent = text;
    at("series-of").hidden = kind !== "procedure";
    if (kind !== "procedure") return;
    const series = await this.link.ask("series", { name }).catch((error) => error.message);
    if (this.chosen()[1] === name) at("sequence-text").textContent = `${text}. ${series}. The rig is started anew for each run.`;
  }

  // What the series of a procedure have found up to the last run.
  found({ procedure, head, rows }) {
    const cells = (tag, ones) => make("tr", {}, ...ones.map((one) => make(tag, {}, one)));
    at("found").hidden = false;
    at("found").replaceChildren(make("table", {}, make("caption", { class: "dim" }, `Found by ${procedure}, means of the runs of each series`), cells("th", head), ...rows.map((row) => cells("td", row))));
  }

  give(control, where, what, more) {
    order(this.link, where, what, more, { control, begun: "started" });
  }

  show({ running, what = "step", step = 0, steps = 1, text = "" }) {
    at("progress").hidden = !running;
    at("progress").max = steps;
    at("progress").value = step;
    at("abort").disabled = !running;
    const said = at("sequence-said");
    if (running && text) say(said, (this.told = `${what} ${step} of ${steps}: ${text}`));
    else if (!running && said.textContent === this.told) say(said, text); // nobody here has the answer to the order
  }

  // The kinds of steps of a rig; one with other kinds than the rig before begins with those up to "wait".
  compose(steps) {
    const before = this.steps?.keys();
    this.steps = new Map(steps.map((one) => [one.kind, one]));
    const kinds = [...this.steps.keys()];
    if (before && kinds.join() === [...before].join()) return;
    at("steps").replaceChildren();
    for (const kind of kinds.slice(0, kinds.indexOf("wait") + 1)) this.add(kind);
  }

  add(kind = "wait", given = this.steps.get(kind).value) {
    const value = make("input", { size: 10, value: given, "aria-label": "value of the step" });
    const which = make("select", { "aria-label": "kind of step" }, ...[...this.steps.keys()].map((name) => make("option", { selected: name === kind }, name)));
    which.onchange = () => {
      value.value = this.steps.get(which.value).value;
      value.hidden = !value.value;
    };
    value.hidden = !value.value;
    const row = make("div", { class: "step" }, which, value, make("button", { "aria-label": "take this step out", onclick: () => row.remove() }, "×"));
    at("steps").append(row);
  }

  own() {
    const lines = [];
    for (const row of at("steps").children) {
      const value = decimal(row.querySelector("input").value);
      if (!PLAIN.test(value)) {
        return say(at("own-said"), `'${value}' is no value with a unit`, "refused");
      }
      lines.push(`  - ${this.steps.get(row.querySelector("select").value).line.replace(HOLE, value)}`);
    }
    const name = at("sequence-name").value.trim();
    const content = `${[...HEAD, ...lines].join("\n")}\n`;
    this.give(at("run-own"), at("own-said"), "own sequence", { name, content, replace: at("replace").checked });
    at("replace").checked = false;
  }

  // Takes up the steps of a saved sequence, as far as they are of the kinds of this rig.
  async load() {
    const name = at("sequence-name").value.trim();
    let text = "";
    try {
      text = await this.link.ask("steps", { name });
    } catch (error) {
      return say(at("own-said"), error.message, "refused");
    }
    const lines = text.split("\n").filter((line) => line.trim() && !HEAD.includes(line));
    const found = lines.map((line) => this.read(line.replace(/^ *- /, "")));
    if (!found.every(Boolean)) return say(at("own-said"), `'${name}' has a step that is not composed here: ${lines[found.indexOf(null)].trim()}`, "refused");
    at("steps").replaceChildren();
    for (const [kind, value] of found) this.add(kind, value);
    at("replace").checked = true; // it is changed
    say(at("own-said"), `'${name}' is taken up`);
  }

  // Kind and value of a step by its line; null when it is of no kind of this rig.
  read(line) {
    for (const { kind, line: form } of this.steps.values()) {
      const [begin, end] = form.split(HOLE);
      if (end == null ? line === form : line.startsWith(begin) && line.endsWith(end)) return [kind, end == null ? "" : line.slice(begin.length, line.length - end.length)];
    }
    return null;
  }
}
