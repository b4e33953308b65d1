// The driveline as a picture that lives: the rig's own SVG, whose bodies and joints are in the order of its description.

import { at } from "./link.js";

const SVG = "http://www.w3.org/2000/svg";
const MODES = ["open", "slipping", "locked"]; // classes of a clutch's mode, whose words are the signal's own
const RPM = 60 / (2 * Math.PI);
const SEEN = 1; // W; a smaller power is no flow that is seen
const FAST = 3; // largest way of the dashes between two frames

function text(x, y, size = "", anchor = "start") {
  const one = document.createElementNS(SVG, "text");
  one.setAttribute("x", x);
  one.setAttribute("y", y);
  one.setAttribute("class", `live ${size}`);
  one.setAttribute("text-anchor", anchor);
  return one;
}

export class Driveline {
  constructor(charts) {
    this.charts = charts;
    this.signals = [];
    this.parts = [];
  }

  value(name, digits) {
    return `${this.charts.read(name, this.charts.latest(name), digits)} ${this.charts.known.get(name)?.unit ?? ""}`;
  }

  rig({ picture, signals }) {
    const svg = new DOMParser().parseFromString(picture.svg, "image/svg+xml").documentElement;
    svg.querySelector("style")?.remove();
    svg.querySelector("rect:not([class])")?.remove(); // the ground
    at("driveline").replaceChildren(document.importNode(svg, true));
    const drawn = at("driveline").firstChild;
    drawn.style.maxWidth = `${drawn.getAttribute("width")}px`;
    drawn.style.minWidth = `${Math.min(700, drawn.getAttribute("width"))}px`;
    for (const key of ["width", "height"]) drawn.removeAttribute(key); // the view box keeps its shape
    this.units = new Map(signals.map((one) => [one.name, one.unit]));
    this.bodies = new Map(picture.bodies.map((one) => [one.name, one]));
    const wanted = new Set();
    const see = (name) => name && wanted.add(name);
    this.parts = [];
    const rects = [...drawn.querySelectorAll("rect.body")];
    const lines = [...drawn.querySelectorAll("line")];
    const signs = [...drawn.querySelectorAll("path.clutch")]; // those of the joints first, then those of brakes
    const left = new Map(picture.bodies.map(({ name }, k) => [name, +rects[k]?.getAttribute("x")]));
    picture.links.forEach((link, k) => {
      const sign = link.kind === "clutch" ? signs.shift() : null;
      if (!lines[k]) return;
      const [x1, x2, y] = ["x1", "x2", "y1"].map((key) => +lines[k].getAttribute(key));
      see(link.torque);
      if (link.torque) this.parts.push(this.flow(link, lines[k], left.get(link.a) < left.get(link.b) ? 1 : -1));
      if (link.clutch) this.parts.push(this.clutch(link.clutch, [lines[k], sign], (x1 + x2) / 2, y + 22, "middle", drawn, see));
    });
    picture.bodies.forEach((body, k) => {
      const rect = rects[k];
      if (!rect) return;
      const [x, y, width, height] = ["x", "y", "width", "height"].map((key) => +rect.getAttribute(key));
      body.speed?.forEach(([name]) => see(name));
      body.torque.forEach(see);
      if (body.speed) this.parts.push(this.body(body, rect, { x, y, width, height }, drawn));
      const sign = body.braked ? signs.shift() : null; // one for all brakes of a body, also for those that no signal shows
      body.brakes.forEach((brake, n) => this.parts.push(this.clutch(brake, [n ? null : sign], x + width + 4, y + height + 12 + 34 * n, "start", drawn, see)));
    });
    this.signals = [...wanted];
  }

  // Speed of a body [rad/s], null where no signal tells it; signals come in the unit that people read.
  speed(name) {
    let speed = 0;
    for (const [signal, weight] of this.bodies.get(name)?.speed ?? [[null, 0]]) {
      const value = this.charts.latest(signal);
      if (value == null) return null;
      speed += weight * (this.units.get(signal) === "rpm" ? value / RPM : value);
    }
    return speed;
  }

  body(body, rect, { x, y, width, height }, drawn) {
    const bar = document.createElementNS(SVG, "rect");
    for (const [key, value] of Object.entries({ class: "turn", x, y: y + height - 5, width: 0, height: 5 })) bar.setAttribute(key, value);
    const label = rect.nextElementSibling.nextElementSibling; // its second line, in place of the inertia
    const torques = text(x + width, y - 5, "small", "end");
    label.setAttribute("class", "live");
    drawn.append(bar, torques);
    return () => {
      const speed = this.speed(body.name);
      label.textContent = speed == null ? "–" : `${(speed * RPM).toFixed(0)} rpm`;
      this.fastest = Math.max(this.fastest ?? 1, Math.abs(speed ?? 0));
      bar.setAttribute("width", (Math.abs(speed ?? 0) / this.fastest) * width);
      torques.textContent = body.torque.map((name) => this.value(name, 3)).join(", ");
    };
  }

  // The power that a joint carries, as dashes that run its way: torque times the mean speed of both ends, so none at standstill.
  flow({ a, b, torque }, line, way) {
    let offset = 0;
    return () => {
      const [moment, first, second] = [this.charts.latest(torque), this.speed(a), this.speed(b)];
      const power = moment == null || first == null || second == null ? 0 : (moment * (first + second)) / 2;
      const flows = Math.abs(power) > SEEN;
      line.classList.toggle("flow", flows);
      line.dataset.power = flows ? power.toFixed(0) : "0"; // W
      if (!flows) return;
      offset -= way * Math.sign(power) * Math.min(FAST, 0.3 + Math.abs(power) / 2000);
      line.setAttribute("stroke-dashoffset", offset.toFixed(1));
    };
  }

  clutch(one, marks, x, y, anchor, drawn, see) {
    ["mode", "torque", "slip", "pressure"].forEach((what) => see(one[what]));
    const [label, more] = [text(x, y, "small", anchor), text(x, y + 13, "small", anchor)];
    drawn.append(label, more);
    return () => {
      const [mode, torque, slip, pressure] = ["mode", "torque", "slip", "pressure"].map((what) => (one[what] ? this.charts.latest(one[what]) : null));
      const name = MODES[Math.round(mode ?? -1)];
      for (const mark of marks) {
        mark?.classList.remove(...MODES);
        if (name) mark?.classList.add(name);
      }
      label.textContent = `${this.charts.read(one.mode, mode)}${torque == null || name === "open" ? "" : ` ${this.value(one.torque, 3)}`}`;
      more.textContent = [pressure == null ? "" : this.value(one.pressure, 3), slip == null || name === "locked" ? "" : this.value(one.slip, 3)]
        .filter(Boolean)
        .join(", ");
    };
  }

  draw() {
    for (const part of this.parts) part();
  }
}
