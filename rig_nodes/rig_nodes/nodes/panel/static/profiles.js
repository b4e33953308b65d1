// The valve profiles P1 to P6 of each output: two curves that one drags; what is drawn solid is what the rig has.

import { at, fetched, make } from "./link.js";
import { order, say } from "./orders.js";

const SVG = "http://www.w3.org/2000/svg";
const [WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM, GAP] = [440, 210, 40, 8, 12, 30, 26];
const SOON = 500; // ms in which the rig's new values come behind its answer
const STEPS = { time: 0.005, current: 0.005 }; // s and A of an arrow key

function draw(tag, attributes, text) {
  const one = document.createElementNS(SVG, tag);
  for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
  if (text != null) one.textContent = text;
  return one;
}

export class Profiles {
  constructor(link) {
    this.link = link;
    this.curves = new Map();
    at("load-controller").onchange = async () => {
      const [file] = at("load-controller").files;
      if (!file) return;
      say(at("controller-said"), "asked", "asked");
      const { ok, text } = await fetched("controller.yaml", { method: "POST", body: await file.text() });
      say(at("controller-said"), text, ok ? "" : "refused");
      at("load-controller").value = "";
    };
  }

  rig({ outputs }) {
    at("profiles").hidden = !outputs.length;
    this.curves = new Map(outputs.map((one) => [one.key, new Curve(this.link, one)]));
    at("curves").replaceChildren(...[...this.curves.values()].map((one) => one.node));
  }

  values(values) {
    for (const [name, value] of Object.entries(values)) {
      const place = name.lastIndexOf(".");
      const curve = this.curves.get(name.slice(0, place));
      if (curve && Array.isArray(value)) curve.take(name.slice(place + 1), value);
    }
  }
}

class Curve {
  constructor(link, { key, output, name, limit }) {
    Object.assign(this, { link, key, limit, had: {}, wanted: null });
    this.svg = draw("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: "group", "aria-label": `profile of output ${output}` });
    this.said = make("p", { class: "said", role: "alert" });
    this.inputs = { times: [], currents: [] };
    const rows = [["times", "ms", 1e3], ["currents", "mA", 1e3]].map(([column, unit, factor]) =>
      make("tr", {}, make("th", { scope: "row" }, unit), ...[0, 1, 2, 3, 4, 5].map((k) => {
        const input = make("input", { type: "text", inputmode: "decimal", "aria-label": `output ${output}, P${k + 1}, ${unit}` });
        input.oninput = () => (this.typed = input); // what is being typed is not written over
        input.onblur = () => {
          this.typed = null;
          if (this.had.times && this.had.currents) this.fill(); // not the points, of which one may be getting the focus
        };
        input.onchange = () => {
          this.typed = null;
          const value = Number(input.value.replace(",", "."));
          if (!this.had.times || !this.had.currents) return; // the rig has not told its values yet
          if (input.value.trim() === "" || !Number.isFinite(value)) return say(this.said, `P${k + 1}: '${input.value}' is no number`, "refused");
          this.want()[column][k] = value / factor;
          this.give();
        };
        this.inputs[column].push(input);
        return make("td", {}, input);
      })));
    this.node = make("div", { class: "curve", "data-output": key }, make("h3", {}, `Output ${output}${name ? `, clutch ${name}` : ", not connected"}`), this.svg, this.said,
      make("table", {}, make("tbody", {}, make("tr", {}, make("td"), ...[1, 2, 3, 4, 5, 6].map((k) => make("th", { scope: "col" }, `P${k}`))), ...rows)));
  }

  take(column, values) {
    this.had[column] = values;
    if (!this.dragged && !this.ordering) this.wanted = null;
    if (this.had.times && this.had.currents) this.show();
  }

  want() {
    return (this.wanted ??= { times: [...this.had.times], currents: [...this.had.currents] });
  }

  // Orders what is wanted; while an order waits, what is wanted meanwhile is ordered behind it, the newest only.
  async give() {
    this.show();
    this.again = true;
    if (this.ordering) return;
    this.ordering = true;
    let good = false;
    while (this.again && this.wanted && !this.dragged) {
      this.again = false;
      for (const column of ["times", "currents"]) this.wanted[column] = this.wanted[column].map((value) => Math.round(value * 1e3) / 1e3); // ms and mA
      good = await order(this.link, this.said, "profile", { key: this.key, ...this.wanted }, { quiet: true });
    }
    this.ordering = false;
    clearTimeout(this.soon);
    const held = () => {
      if (!this.ordering && !this.dragged) this.wanted = null;
      this.show();
    };
    if (good) this.soon = setTimeout(held, SOON); // what the rig has comes behind its answer
    else held();
  }

  // Time axes: P1 to P3 at the left, P4 to P6 at the right, each as long as what lies in it.
  axes(points) {
    const half = (WIDTH - LEFT - RIGHT - GAP) / 2;
    return [0, 1].map((side) => {
      const all = [...this.had.times, ...points.times].filter((_, k) => (k % 6 < 3) === (side === 0));
      const most = Math.max(0.05, ...all) * 1.15;
      const from = LEFT + side * (half + GAP);
      return { from, half, most, x: (t) => from + (t / most) * half };
    });
  }

  y(current) {
    return HEIGHT - BOTTOM - (current / this.limit) * (HEIGHT - BOTTOM - TOP);
  }

  show() {
    const points = this.wanted ?? this.had;
    if (!this.scale || !this.dragged) this.scale = this.axes(points);
    const path = (one, side) => [0, 1, 2].map((k) => `${k ? "L" : "M"}${this.scale[side].x(one.times[3 * side + k])} ${this.y(one.currents[3 * side + k])}`).join(" ");
    const held = this.svg.contains(document.activeElement) ? document.activeElement.dataset.point : null;
    const parts = [];
    this.scale.forEach((axis, side) => {
      parts.push(draw("line", { class: "axis", x1: axis.from, x2: axis.from + axis.half, y1: this.y(0), y2: this.y(0) }));
      parts.push(draw("line", { class: "axis", x1: axis.from, x2: axis.from, y1: this.y(0), y2: TOP }));
      parts.push(draw("text", { x: axis.from, y: HEIGHT - 12 }, side ? "from switch-off" : "from switch-on"));
      parts.push(draw("text", { x: axis.from + axis.half, y: HEIGHT - 12, "text-anchor": "end" }, `${Math.round(axis.most * 1e3)} ms`));
      parts.push(draw("path", { class: "had", d: path(this.had, side) }));
      if (this.wanted) parts.push(draw("path", { class: "wanted", d: path(this.wanted, side) }));
    });
    parts.push(draw("text", { x: LEFT - 4, y: TOP + 8, "text-anchor": "end" }, `${Math.round(this.limit * 1e3)}`), draw("text", { x: LEFT - 4, y: this.y(0), "text-anchor": "end" }, "0 mA"));
    for (let k = 0; k < 6; k += 1) parts.push(this.point(k, points));
    this.svg.replaceChildren(...parts);
    if (held != null) this.svg.querySelector(`[data-point="${held}"]`)?.focus();
    this.fill();
  }

  fill() {
    const points = this.wanted ?? this.had;
    for (const [column, inputs] of Object.entries(this.inputs)) inputs.forEach((input, k) => {
      if (this.typed !== input) input.value = +(points[column][k] * 1e3).toFixed(2);
    });
  }

  point(k, points) {
    const axis = this.scale[k < 3 ? 0 : 1];
    const words = `P${k + 1}: ${Math.round(points.times[k] * 1e3)} ms, ${Math.round(points.currents[k] * 1e3)} mA`;
    const one = draw("circle", { cx: axis.x(points.times[k]), cy: this.y(points.currents[k]), r: 8, tabindex: 0, role: "slider", "data-point": k,
      "aria-label": words, "aria-valuetext": words, "aria-valuenow": Math.round(points.currents[k] * 1e3), "aria-valuemin": 0, "aria-valuemax": Math.round(this.limit * 1e3) });
    one.append(draw("title", {}, words));
    one.addEventListener("pointerdown", (event) => {
      event.preventDefault();
      this.dragged = true;
      const box = this.svg.getBoundingClientRect();
      const move = ({ clientX, clientY }) => {
        const wanted = this.want();
        wanted.times[k] = Math.max(0, (((clientX - box.left) / box.width) * WIDTH - axis.from) / axis.half) * axis.most;
        const high = (HEIGHT - BOTTOM - ((clientY - box.top) / box.height) * HEIGHT) / (HEIGHT - BOTTOM - TOP);
        wanted.currents[k] = Math.min(1, Math.max(0, high)) * this.limit;
        this.show();
      };
      const end = () => {
        removeEventListener("pointermove", move);
        removeEventListener("pointerup", end);
        removeEventListener("pointercancel", end);
        this.dragged = false;
        if (this.wanted) this.give();
      };
      addEventListener("pointermove", move);
      addEventListener("pointerup", end);
      addEventListener("pointercancel", end);
    });
    one.addEventListener("keydown", (event) => {
      const [column, way] = { ArrowLeft: ["times", -1], ArrowRight: ["times", 1], ArrowDown: ["currents", -1], ArrowUp: ["currents", 1] }[event.key] ?? [];
      if (!column) return;
      event.preventDefault();
      const wanted = this.want();
      const step = (column === "times" ? STEPS.time : STEPS.current) * way * (event.shiftKey ? 10 : 1);
      wanted[column][k] = Math.max(0, wanted[column][k] + step);
      if (column === "currents") wanted[column][k] = Math.min(this.limit, wanted[column][k]);
      this.give();
    });
    return one;
  }
}
