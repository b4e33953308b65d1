// Sequences: those that the rig has, and one composed of steps, which is saved on the rig's side and run from there.

import { at, make } from "./link.js";

const STEPS = {
  "oil pressure": ["4 MPa", (value) => `oil: {pressure: ${value}}`],
  gear: ["I", (value) => `shift: {to: ${value}, timeout: 10 s}`],
  "motor speed": ["1500 rpm", (value) => `motor: {speed: ${value}}`],
  "load torque": ["80 Nm", (value) => `load: {torque: ${value}}`],
  wait: ["2 s", (value) => `wait: {for: ${value}}`],
  "motor off": ["", () => "motor: {off: true}"],
  "load off": ["", () => "load: {off: true}"],
};
const PLAIN = /^[\w. %°/+-]{0,40}$/; // what may stand as a value in the file

export class Sequences {
  constructor(link) {
    this.link = link;
    at("sequence").onchange = () => this.describe();
    at("run").onclick = () => this.give(at("sequence-said"), "sequence", { name: at("sequence").value });
    at("abort").onclick = () => this.give(at("sequence-said"), "abort", {});
    at("add-step").onclick = () => this.add();
    at("run-own").onclick = () => this.own();
    link.on("sequence", (message) => this.show(message));
    for (const kind of ["oil pressure", "gear", "motor speed", "wait"]) this.add(kind);
  }

  rig({ sequences }) {
    this.texts = new Map(sequences.map((one) => [one.name, one.text]));
    at("sequence").replaceChildren(...sequences.map((one) => make("option", { value: one.name }, one.name)));
    if (this.texts.has("demo")) at("sequence").value = "demo";
    at("run").disabled = !sequences.length;
    this.describe();
  }

  describe() {
    at("sequence-text").textContent = this.texts.get(at("sequence").value) ?? "This rig has no sequences of its own.";
  }

  async give(where, what, more) {
    where.classList.remove("bad");
    where.textContent = what === "abort" ? "" : "started";
    try {
      where.textContent = await this.link.ask(what, more);
    } catch (error) {
      where.textContent = error.message;
      where.classList.add("bad");
    }
  }

  show({ running, step = 0, steps = 1, text = "" }) {
    at("progress").hidden = !running;
    at("progress").max = steps;
    at("progress").value = step;
    at("abort").disabled = !running;
    if (running && text) at("sequence-said").textContent = `step ${step} of ${steps}: ${text}`;
  }

  add(kind = "wait") {
    const value = make("input", { size: 10, value: STEPS[kind][0], "aria-label": "value of the step" });
    const which = make("select", { "aria-label": "kind of step" }, ...Object.keys(STEPS).map((name) => make("option", { selected: name === kind }, name)));
    which.onchange = () => {
      value.value = STEPS[which.value][0];
      value.hidden = !value.value;
    };
    value.hidden = !value.value;
    const row = make("div", { class: "step" }, which, value, make("button", { "aria-label": "take this step out", onclick: () => row.remove() }, "×"));
    at("steps").append(row);
  }

  own() {
    const lines = [];
    for (const row of at("steps").children) {
      const value = row.querySelector("input").value.trim();
      if (!PLAIN.test(value)) {
        at("own-said").textContent = `'${value}' is no value with a unit`;
        at("own-said").classList.add("bad");
        return;
      }
      lines.push(`  - ${STEPS[row.querySelector("select").value][1](value)}`);
    }
    const name = at("sequence-name").value.trim();
    this.give(at("own-said"), "own sequence", { name, content: `description: composed on the page\nsteps:\n${lines.join("\n")}\n` });
  }
}
