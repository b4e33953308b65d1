// Shifts that have ended: the figure with its verdict, metrics, and curves of several laid over each other and over a measured file.

import { at, colour, fetched, make } from "./link.js";
import { say } from "./orders.js";

const MOST = 12; // as the server keeps
const MEASURED = "measured"; // label of the file's curve
const LARGEST = 64e6; // bytes of a file, as the server takes

export class Shifts {
  constructor(link) {
    this.found = new Map();
    this.ticked = new Set();
    link.on("shift", (one) => this.take(one));
    at("overlay-signal").onchange = () => this.overlay();
    at("csv").onchange = () => this.measured(at("csv").files[0]);
    for (const id of ["csv-part", "csv-shift"]) at(id).oninput = () => this.overlay();
    document.addEventListener("dragover", (event) => event.preventDefault());
    document.addEventListener("drop", (event) => {
      event.preventDefault(); // the browser would leave the page for the file
      this.measured(event.dataTransfer.files[0]);
    });
    new ResizeObserver(() => this.plot?.setSize({ width: Math.max(200, at("overlay-chart").clientWidth), height: 240 })).observe(at("overlay-chart"));
  }

  rig({ gears, signals }) {
    at("shifts").hidden = !gears.length;
    this.units = new Map(signals.map((one) => [one.name, one.unit]));
  }

  take(one) {
    const known = this.found.has(one.number);
    this.found.set(one.number, one);
    while (this.found.size > MOST) this.found.delete(this.found.keys().next().value);
    if (!known) {
      this.picked = one.number;
      if (one.curves) this.ticked = new Set([...this.ticked, one.number].slice(-3));
    }
    this.show();
  }

  recolour() {
    if (this.found.size) this.show();
  }

  show() {
    at("no-shift").hidden = this.found.size > 0;
    at("shift-list").replaceChildren(
      ...[...this.found.values()].map((one) => {
        const box = make("input", { type: "checkbox", checked: this.ticked.has(one.number), "aria-label": `lay shift ${one.number} over the others`, disabled: !one.curves });
        box.onchange = () => {
          this.ticked[box.checked ? "add" : "delete"](one.number);
          this.overlay();
        };
        const button = make("button", { "aria-pressed": String(one.number === this.picked) }, `${one.number}: ${one.way ?? "?"} ${one.grade ?? ""}`);
        button.onclick = () => {
          this.picked = one.number;
          this.show();
        };
        return make("span", { class: "chip" }, box, button);
      }),
    );
    this.figure(this.found.get(this.picked));
    this.choose();
  }

  // Offers the signals of the shifts and of the file, and the file's orders, of which one like the shift that is shown comes first.
  choose() {
    const parts = this.file?.parts ?? [];
    const curves = [...this.found.values(), ...parts].map((one) => one.curves ?? {});
    const names = [...new Set(curves.flatMap(Object.keys))];
    const was = at("overlay-signal").value;
    at("overlay-signal").replaceChildren(...names.map((name) => make("option", { selected: name === was }, name)));
    at("overlay").hidden = !names.length;
    for (const id of ["csv-parts", "csv-move"]) at(id).hidden = !parts.length;
    this.overlay();
  }

  figure(one) {
    if (!one) return;
    if (one.error) return at("shift").replaceChildren(make("p", { class: "bad" }, `Shift ${one.number} has no figure: ${one.error}.`));
    const theme = document.documentElement.dataset.theme;
    const width = at("shift").clientWidth < 600 ? "narrow" : "wide";
    const reasons = one.valid ? one.reasons : [...one.reasons, `not valid: ${one.why.join("; ")}`];
    at("shift").replaceChildren(
      make("p", {}, make("strong", { class: one.grade === "good" ? "good" : ["poor", "failed"].includes(one.grade) ? "bad" : "" }, one.grade || "no verdict"), ` ${one.title}`),
      make("img", { src: `shift/${one.key}/${width}_${theme}.svg`, alt: `${one.title}: pressures, torques and speeds over time. ${reasons.join("; ")}` }),
      make("ul", { class: "metrics" }, ...one.metrics.map(({ name, what, value, unit }) => make("li", {}, make("span", {}, make("strong", {}, name), ` ${what}`), make("span", {}, `${value} ${unit}`)))),
    );
  }

  // Has the server read a measured file: its signals by the rig's names, in the units of the charts.
  async measured(file) {
    if (!file || at("shifts").hidden) return; // a rig without gears has no shifts
    at("csv").value = "";
    if (file.size > LARGEST) return say(at("csv-said"), `${file.name} has more than ${LARGEST / 1e6} MB; cut it`, "refused");
    say(at("csv-said"), `${file.name} is read`, "asked");
    const { ok, text } = await fetched(`measured?name=${encodeURIComponent(file.name)}`, { method: "POST", body: file });
    if (!ok) return say(at("csv-said"), text, "refused");
    this.file = JSON.parse(text);
    say(at("csv-said"), [file.name, ...this.file.notes].join("; "));
    const way = this.found.get(this.picked)?.way;
    at("csv-part").replaceChildren(...this.file.parts.map((one, k) => make("option", { value: k, selected: k === this.file.parts.findIndex((other) => other.way === way) }, one.text)));
    this.choose();
  }

  overlay() {
    this.plot?.destroy();
    this.plot = null;
    const name = at("overlay-signal").value;
    const all = [...this.found.values()].filter((one) => this.ticked.has(one.number) && one.curves?.[name]).map((one) => [`shift ${one.number}`, one.curves[name].t, one.curves[name].v]);
    const measured = this.file?.parts[+at("csv-part").value]?.curves[name];
    const moved = +at("csv-shift").value || 0;
    if (measured) all.push([MEASURED, measured.t.map((t) => t + moved), measured.v]);
    const node = at("overlay-chart");
    node.replaceChildren(make("p", { class: "chips" }, ...all.map(([label], k) => {
      const mark = make("i");
      mark.style.background = `var(--c${k % 6})`;
      return make("span", { class: "chip" }, mark, label);
    })));
    if (!all.length) return;
    const ink = colour("dim");
    const grid = { stroke: colour("grid"), width: 1 };
    const unit = this.units?.get(name) ?? "";
    this.plot = new uPlot(
      {
        width: Math.max(200, node.clientWidth),
        height: 240,
        legend: { show: false },
        scales: { x: { time: false } },
        series: [{}, ...all.map((_, k) => ({ stroke: colour(`c${k % 6}`), width: 1.7, points: { show: false }, spanGaps: true }))],
        axes: [
          { stroke: ink, grid, ticks: grid, values: (_, ticks) => ticks.map((t) => `${t} ms`) },
          { stroke: ink, grid, ticks: grid, size: 64, label: `${name} [${unit}]` },
        ],
      },
      uPlot.join(all.map(([, t, v]) => [t, v])),
      node,
    );
  }
}
