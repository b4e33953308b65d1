// The driveline as a picture that lives: the rig's own SVG, whose bodies and joints are in the order of its description.

import { at, shown } from "./link.js";

const SVG = "http://www.w3.org/2000/svg";
const MODES = ["open", "slipping", "locked"];
const RPM = 60 / (2 * Math.PI);

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
    return `${shown(this.charts.latest(name), digits)} ${this.charts.known.get(name)?.unit ?? ""}`;
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
    const units = new Map(signals.map((one) => [one.name, one.unit]));
    const wanted = new Set();
    const see = (name) => name && wanted.add(name);
    this.parts = [];
    const rects = [...drawn.querySelectorAll("rect.body")];
    const lines = [...drawn.querySelectorAll("line")];
    const signs = [...drawn.querySelectorAll("path.clutch")]; // those of the joints first, then those of brakes
    picture.links.forEach((link, k) => {
      const sign = link.kind === "clutch" ? signs.shift() : null;
      if (!link.clutch || !lines[k]) return;
      const [x1, x2, y] = ["x1", "x2", "y1"].map((key) => +lines[k].getAttribute(key));
      this.parts.push(this.clutch(link.clutch, [lines[k], sign], (x1 + x2) / 2, y + 22, "middle", drawn, see));
    });
    picture.bodies.forEach((body, k) => {
      const rect = rects[k];
      if (!rect) return;
      const [x, y, width, height] = ["x", "y", "width", "height"].map((key) => +rect.getAttribute(key));
      body.speed?.forEach(([name]) => see(name));
      body.torque.forEach(see);
      if (body.speed) {
        const bar = document.createElementNS(SVG, "rect");
        for (const [key, value] of Object.entries({ class: "turn", x, y: y + height - 5, width: 0, height: 5 })) bar.setAttribute(key, value);
        const label = rect.nextElementSibling.nextElementSibling; // its second line, in place of the inertia
        const torques = text(x + width, y - 5, "small", "end");
        label.setAttribute("class", "live");
        drawn.append(bar, torques);
        this.parts.push(() => {
          let speed = 0; // rad/s; signals come in the unit that people read
          for (const [name, weight] of body.speed) {
            const value = this.charts.latest(name);
            if (value == null) return;
            speed += weight * (units.get(name) === "rpm" ? value / RPM : value);
          }
          this.fastest = Math.max(this.fastest ?? 1, Math.abs(speed));
          bar.setAttribute("width", (Math.abs(speed) / this.fastest) * width);
          label.textContent = `${(speed * RPM).toFixed(0)} rpm`;
          torques.textContent = body.torque.map((name) => this.value(name, 3)).join(", ");
        });
      }
      body.brakes.forEach((brake, n) => this.parts.push(this.clutch(brake, [n ? null : signs.shift()], x + width + 4, y + height + 12 + 34 * n, "start", drawn, see)));
    });
    this.signals = [...wanted];
  }

  clutch(one, marks, x, y, anchor, drawn, see) {
    ["mode", "torque", "slip", "pressure"].forEach((what) => see(one[what]));
    const [label, more] = [text(x, y, "small", anchor), text(x, y + 13, "small", anchor)];
    drawn.append(label, more);
    let offset = 0;
    return () => {
      const mode = MODES[Math.round(this.charts.latest(one.mode) ?? 0)] ?? "open";
      const [torque, slip, pressure] = ["torque", "slip", "pressure"].map((what) => (one[what] ? this.charts.latest(one[what]) : null));
      offset -= Math.sign(torque ?? 0) * Math.min(3, Math.abs(torque ?? 0) / 20);
      for (const mark of marks) {
        if (!mark) continue;
        mark.classList.remove(...MODES, "flow");
        mark.classList.add(mode);
        if (mark.tagName === "line" && Math.abs(torque ?? 0) > 1) {
          mark.classList.add("flow");
          mark.setAttribute("stroke-dashoffset", offset.toFixed(1));
        }
      }
      label.textContent = `${mode}${torque == null || mode === "open" ? "" : ` ${this.value(one.torque, 3)}`}`;
      more.textContent = [pressure == null ? "" : this.value(one.pressure, 3), slip == null || mode === "locked" ? "" : this.value(one.slip, 3)]
        .filter(Boolean)
        .join(", ");
    };
  }

  draw() {
    for (const part of this.parts) part();
  }
}
