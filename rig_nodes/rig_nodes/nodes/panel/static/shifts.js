// Shifts that have ended: the figure with its verdict, metrics, and curves of several laid over each other and over a measured file.

import { at, colour, make, shown } from "./link.js";

const MOST = 12; // as the server keeps
const MEASURED = "measured";

export class Shifts {
  constructor(link) {
    this.found = new Map();
    this.ticked = new Set();
    link.on("shift", (one) => this.take(one));
    at("overlay-signal").onchange = () => this.overlay();
    at("csv").onchange = () => at("csv").files[0]?.text().then((text) => this.measured(text));
    at("csv-column").onchange = () => this.overlay();
    at("csv-shift").oninput = () => this.overlay();
    const place = at("shifts");
    place.addEventListener("dragover", (event) => event.preventDefault());
    place.addEventListener("drop", (event) => {
      event.preventDefault();
      event.dataTransfer.files[0]?.text().then((text) => this.measured(text));
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
    const names = [...new Set([...this.found.values()].flatMap((one) => Object.keys(one.curves ?? {})))];
    const was = at("overlay-signal").value;
    at("overlay-signal").replaceChildren(...names.map((name) => make("option", { selected: name === was }, name)));
    at("overlay").hidden = !names.length;
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
      make("ul", { class: "metrics" }, ...one.metrics.map(({ name, value, unit }) => make("li", {}, make("span", {}, name), make("span", {}, `${shown(value)} ${unit}`)))),
    );
  }

  // Takes a CSV file: a head line with names, and the time in s in the first column.
  measured(text) {
    const lines = text.replace(/^\ufeff/, "").split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
    const sign = [";", "\t", ","].find((one) => lines[0]?.includes(one)) ?? ",";
    const names = (lines[0] ?? "").split(sign).map((one) => one.trim().replace(/^"|"$/g, ""));
    const number = (cell) => (cell === undefined || cell.trim() === "" ? NaN : Number(sign === ";" ? cell.replace(",", ".") : cell));
    const rows = lines.slice(1).map((line) => line.split(sign).map(number)).filter((row) => Number.isFinite(row[0]));
    const good = names.length > 1 && rows.length > 1;
    at("csv-said").textContent = good ? "" : "The file has no table with a head line and the time in its first column.";
    for (const id of ["csv-columns", "csv-move"]) at(id).hidden = !good;
    this.file = good ? { names, rows } : null;
    at("csv-column").replaceChildren(...names.slice(1).map((name, k) => make("option", { value: k + 1, selected: name === at("overlay-signal").value }, name)));
    this.overlay();
  }

  overlay() {
    this.plot?.destroy();
    this.plot = null;
    const name = at("overlay-signal").value;
    const all = [...this.found.values()].filter((one) => this.ticked.has(one.number) && one.curves?.[name]).map((one) => [`shift ${one.number}`, one.curves[name].t, one.curves[name].v]);
    if (this.file) {
      const column = +at("csv-column").value;
      const moved = +at("csv-shift").value || 0;
      const rows = this.file.rows.filter((row) => Number.isFinite(row[column]));
      all.push([MEASURED, rows.map((row) => row[0] * 1e3 + moved), rows.map((row) => row[column])]);
    }
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
