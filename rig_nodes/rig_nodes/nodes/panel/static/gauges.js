// Gauges: the present value of signals by name, on the scale of each signal's range.

import { at, make, shown } from "./link.js";

const KEY = "rig-gauges";

export class Gauges {
  // ``changed`` is called with the names when they are others.
  constructor(charts, changed) {
    Object.assign(this, { charts, changed, names: [], parts: [] });
    at("gauge").onchange = () => {
      const name = at("gauge").value.trim();
      at("gauge-said").textContent = !name || charts.known.has(name) ? "" : `there is no signal '${name}'`;
      if (!charts.known.has(name)) return;
      at("gauge").value = "";
      if (!this.names.includes(name)) this.set([...this.names, name]);
    };
  }

  rig({ name }) {
    this.key = `${KEY} ${name}`;
    let saved = null;
    try {
      saved = JSON.parse(localStorage.getItem(this.key));
    } catch {
      // what was kept is not ours
    }
    this.names = Array.isArray(saved) ? saved.filter((one) => typeof one === "string") : [];
    this.build();
  }

  set(names) {
    this.names = names;
    localStorage.setItem(this.key, JSON.stringify(names));
    this.build();
    this.changed(names);
  }

  build() {
    this.parts = this.names.map((name) => {
      const { text = name, unit = "", low, high } = this.charts.known.get(name) ?? {};
      const value = make("strong", {}, "–");
      const ranged = Number.isFinite(low) && Number.isFinite(high);
      const scale = ranged ? make("meter", { min: low, max: high, "aria-label": name, hidden: true }) : null;
      const ends = ranged ? make("span", { class: "ends dim" }, make("span", {}, shown(low)), make("span", {}, shown(high))) : null;
      const gone = make("button", { "aria-label": `remove the gauge of ${name}`, title: "remove it" }, "×");
      gone.onclick = () => this.set(this.names.filter((other) => other !== name));
      return { name, value, scale, node: make("div", { class: "gauge", title: text, "data-gauge": name }, make("span", {}, name, gone), make("span", {}, value, ` ${unit === "-" ? "" : unit}`), scale, ends) };
    });
    at("gauges").replaceChildren(...this.parts.map(({ node }) => node));
  }

  draw() {
    for (const { name, value, scale } of this.parts) {
      const now = this.charts.latest(name);
      value.textContent = this.charts.read(name, now);
      if (!scale) continue;
      scale.hidden = now == null; // no value is no needle at the low end
      if (now != null) scale.value = now;
    }
  }
}
